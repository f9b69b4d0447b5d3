//! Varying slack of the cable.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
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

/// The length of cable out differs from the vehicle's travel: its slack varies smoothly.
///
/// Slack is relative to its mean, which zeroing the counter removes, so it has either sign though no cable is shorter than
/// the distance. `reach_m` (0.15 by default) is the largest value either way; the standard deviation is 0.4 of it.
/// `period_s` (30 by default) is the period of the variation: control points of a cubic B-spline are half of it apart.
pub(super) struct TetherSlackKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    reach_m: f64,
    period_s: f64,
}

#[derive(Component)]
struct TetherSlack {
    slack: Knots,
}

impl EffectKind for TetherSlackKind {
    fn name(&self) -> &'static str {
        "tether_slack"
    }

    fn summary(&self) -> &'static str {
        "the cable's slack wanders"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            let reach_m = table.number("reach_m", 0.001..=50.0)?.unwrap_or(0.15);
            let period_s = table.number("period_s", 1.0..=3600.0)?.unwrap_or(30.0);
            Ok(Parameters { reach_m, period_s })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        let duration_s = sim.duration_s();
        for (source, Parameters { reach_m, period_s }) in &self.0 {
            let stream = sim.stream(*source);
            let slack = wandering(stream, duration_s, *period_s, [*reach_m, 0.0, 0.0, 0.0, 0.0, 0.0]);
            sim.insert(*source, TetherSlack { slack });
        }
        sim.system(Stage::Feel, hang);
        Ok(())
    }
}

fn hang(mut counters: Query<'_, '_, (&mut Samples<Payout>, &TetherSlack)>) {
    for (mut samples, TetherSlack { slack }) in &mut counters {
        for payout in &mut samples.list {
            let [more_m, ..] = slack.at(payout.at.since(START).as_secs_f64());
            payout.chainage_m += more_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use super::*;
    use crate::testing_motion::{Bench, LONG, refusal, same_in_any_slices};

    /// The correlation of a cubic B-spline with independent control points falls to zero over four of them.
    #[test]
    fn slack_has_its_reach_spread_and_time() {
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
        // Some 600 independent stretches.
        assert!((math::sqrt(variance) / (0.15 * 0.3997) - 1.0).abs() < 0.1, "{variance}");
        // Source: the autocorrelation of the cubic B-spline, 2416 : 1191 : 120 : 1 at 0, 1, 2, 3 spacings.
        for (spacings, wanted) in [(1, 1191.0), (2, 120.0), (3, 1.0), (4, 0.0)] {
            let correlation = product(25 * spacings) / variance;
            assert!((correlation - wanted / 2416.0).abs() < 0.15, "{spacings}: {correlation}");
        }
    }

    #[test]
    fn slices_make_no_difference_and_other_sensors_are_refused() {
        same_in_any_slices(&Bench::turning("[effects.tether_slack]\n"));
        assert!(refusal("[effects.tether_slack]\nsensors = [\"imu\"]\n").contains("can act on: tether"));
    }
}
