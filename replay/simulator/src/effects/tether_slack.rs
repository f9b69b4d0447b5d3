//! Slack of the cable that varies during the dive.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Payout;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;
use crate::trajectory::{Knots, wandering};

/// The length of cable out differs from the vehicle's travel by a slack that varies smoothly.
///
/// Slack is given relative to its mean, because zeroing the counter removes the mean. The slack can therefore have
/// either sign, although no cable is shorter than the distance. `reach_m` (0.15 by default) is the largest value either
/// way; the standard deviation is 0.4 of the reach. `period_s` (30 by default) is the period of the variation. The
/// control points of a cubic B-spline are half a period apart.
///
/// `swings` are tables of `reach_m` and `period_s`. With each, the cable swings as a sine of full reach and random
/// phase, even while the vehicle is stationary. If there are swings, the smooth variation is added only if `reach_m` is
/// given.
pub(super) struct TetherSlackKind;

#[derive(Debug, Clone)]
struct Parameters {
    /// Largest slack of the cable, m; 0 if the slack doesn't vary.
    reach_m: f64,
    period_s: f64,
    swings: Vec<Swing>,
}

#[derive(Debug, Clone, Copy)]
struct Swing {
    reach_m: f64,
    period_s: f64,
}

/// Step number that is reserved for drawing the swings' phases. No knot of the smooth variation has this number.
const PHASES: u64 = u64::MAX;

#[derive(Component)]
struct TetherSlack {
    slack: Knots,
    /// Swings of the cable, each with its phase in radians.
    swings: Vec<(Swing, f64)>,
}

impl EffectKind for TetherSlackKind {
    fn name(&self) -> &'static str {
        "tether_slack"
    }

    fn summary(&self) -> &'static str {
        "the cable's slack varies"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            let swings = table.sections("swings")?.into_iter().map(swing).collect::<Result<Vec<_>, _>>()?;
            let usual_m = if swings.is_empty() { 0.15 } else { 0.0 };
            let reach_m = table.number("reach_m", 0.001..=50.0)?.unwrap_or(usual_m);
            let period_s = table.number("period_s", 1.0..=3600.0)?.unwrap_or(30.0);
            Ok(Parameters { reach_m, period_s, swings })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        let duration_s = sim.duration_s();
        for (source, Parameters { reach_m, period_s, swings }) in &self.0 {
            let stream = sim.stream(*source);
            let slack = wandering(stream, duration_s, *period_s, [*reach_m, 0.0, 0.0, 0.0, 0.0, 0.0]);
            let phase_rad = |number: u64| math::TAU * stream.block(PHASES, number).uniform()[0];
            let swings = swings.iter().zip(0..).map(|(swing, number)| (*swing, phase_rad(number)));
            let swings = swings.collect();
            sim.insert(*source, TetherSlack { slack, swings });
        }
        sim.system(Stage::Feel, hang);
        Ok(())
    }
}

/// Reads one of the tables `swings`.
fn swing(table: Section<'_>) -> Result<Swing, ConfigError> {
    let needed = |key, allowed| table.number(key, allowed).and_then(|number| table.required(key, number));
    let swing =
        Swing { reach_m: needed("reach_m", 0.001..=50.0)?, period_s: needed("period_s", 0.1..=3600.0)? };
    table.finish()?;
    Ok(swing)
}

fn hang(mut counters: Query<'_, '_, (&mut Samples<Payout>, &TetherSlack)>) {
    for (mut samples, TetherSlack { slack, swings }) in &mut counters {
        for payout in &mut samples.list {
            let t = payout.at.since(START).as_secs_f64();
            let [more_m, ..] = slack.at(t);
            let swung_m = swings.iter().map(|(swing, phase_rad)| {
                swing.reach_m * math::sin(math::TAU * t / swing.period_s + phase_rad)
            });
            payout.chainage_m += more_m + swung_m.sum::<f64>();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, LONG, refusal, same_in_any_slices};

    /// The correlation of a cubic B-spline with independent control points falls to zero over four control points.
    #[test]
    fn slack_has_the_given_amplitude_sd_and_period() {
        let keys = "[effects.tether_slack]\nperiod_s = 1\n";
        let (plain, slack) = (Bench::on(LONG, "").run("tether"), Bench::on(LONG, keys).run("tether"));
        let more: Vec<f64> =
            plain.iter().zip(&slack).map(|(a, b): (&Payout, &Payout)| b.chainage_m - a.chainage_m).collect();
        assert!(more.iter().all(|more_m| more_m.abs() <= 0.15 + 1e-12));
        let product = |lag: usize| {
            let pairs = more.iter().zip(more.iter().skip(lag));
            pairs.map(|(a, b)| a * b).sum::<f64>() / (more.len() - lag) as f64
        };
        assert_eq!(plain[25].at.since(plain[0].at).0, 500_000_000);
        let variance = product(0);
        // The tolerance allows for the error of a standard deviation from some 600 independent values.
        assert!((math::sqrt(variance) / (0.15 * 0.3997) - 1.0).abs() < 0.1, "{variance}");
        // Source: the autocorrelation of the cubic B-spline, 2416 : 1191 : 120 : 1 at 0, 1, 2, 3 spacings.
        for (spacings, wanted) in [(1, 1191.0), (2, 120.0), (3, 1.0), (4, 0.0)] {
            let correlation = product(25 * spacings) / variance;
            assert!((correlation - wanted / 2416.0).abs() < 0.15, "{spacings}: {correlation}");
        }
    }

    /// Compares the slack with sines fitted by least squares. Each swing has its reach and period, and no other slack
    /// remains.
    #[test]
    fn each_slack_swing_is_a_sine_with_its_full_amplitude_and_period() {
        let keys = "[effects.tether_slack]\nswings = [{ reach_m = 0.03, period_s = 8 }, { reach_m = 0.055, period_s = 20 }]\n";
        let (plain, slack) = (Bench::on(LONG, "").run("tether"), Bench::on(LONG, keys).run("tether"));
        let more = plain
            .iter()
            .zip(&slack)
            .map(|(a, b): (&Payout, &Payout)| (a.at.since(START).as_secs_f64(), b.chainage_m - a.chainage_m));
        // The first 200 s contain whole periods of both swings.
        let more: Vec<(f64, f64)> = more.filter(|(t, _)| *t < 200.0).collect();
        assert!(more.len() > 9000, "{}", more.len());
        let mut left = more.clone();
        for (reach_m, period_s) in [(0.03, 8.0), (0.055, 20.0)] {
            let part = |wave: fn(f64) -> f64| {
                let sum: f64 = more.iter().map(|(t, m)| m * wave(math::TAU * t / period_s)).sum();
                2.0 * sum / more.len() as f64
            };
            let [s, c] = [part(math::sin), part(math::cos)];
            assert!((math::hypot(s, c) - reach_m).abs() < 5e-4, "{period_s}: {s} {c}");
            for (t, m) in &mut left {
                let turned = math::TAU * *t / period_s;
                *m -= s * math::sin(turned) + c * math::cos(turned);
            }
        }
        assert!(left.iter().all(|(_, m)| m.abs() < 2e-3));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.tether_slack]\n"));
        same_in_any_slices(&Bench::turning(
            "[effects.tether_slack]\nreach_m = 0.1\nswings = [{ reach_m = 0.1, period_s = 7 }]\n",
        ));
        assert!(refusal("[effects.tether_slack]\nsensors = [\"imu\"]\n").contains("can act on: tether"));
    }
}
