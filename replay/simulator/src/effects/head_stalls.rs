//! Heads that stall for a while and ping at one angle.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::behind::Behind;
use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Samples;
use crate::stages::Stage;

/// Interval between the times at which a stall can start.
const STEP: DurNs = DurNs(100_000_000);

/// From time to time a head stalls and pings repeatedly at one angle. Later it continues from the same angle, so it
/// stays behind the commanded angles.
///
/// Stalls begin `per_hour` times per hour, with equal probability at any tenth of a second. The duration is uniformly
/// distributed over `seconds = [least, most]`, by default 2 to 20. A stall that begins during another one may extend
/// it. If `told` is true, as by default, the head reports its true angle; otherwise it reports the commanded angle.
pub(super) struct HeadStallsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    per_hour: f64,
    seconds: [f64; 2],
    is_reported: bool,
}

#[derive(Component)]
struct HeadStalls {
    parameters: Parameters,
    stalls: Stalls,
    behind: Behind,
}

/// Draws the times at which a head stalls.
struct Stalls {
    stream: Stream,
    chance: f64,
    seconds: [f64; 2],
    next_step: u64,
    until: MonoNs,
}

impl EffectKind for HeadStallsKind {
    fn name(&self) -> &'static str {
        "head_stalls"
    }

    fn summary(&self) -> &'static str {
        "heads stop for a while and then continue from the same angle"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Head], |table| {
            let per_hour = keys::or_zero(table, "per_hour", 0.0..=3600.0)?;
            keys::some_not_zero(table, &[("per_hour", per_hour)])?;
            let seconds = keys::span(table, "seconds", 0.1..=3600.0, [2.0, 20.0])?;
            Ok(Parameters { per_hour, seconds, is_reported: table.boolean("told")?.unwrap_or(true) })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let stalls = Stalls::new(sim.stream(*source), parameters);
            let stalling = HeadStalls { parameters: *parameters, stalls, behind: Behind::default() };
            sim.insert(*source, stalling);
        }
        sim.system(Stage::Turn, stall);
        Ok(())
    }
}

impl Stalls {
    fn new(stream: Stream, parameters: &Parameters) -> Self {
        let chance = parameters.per_hour * STEP.as_secs_f64() / 3600.0;
        Self { stream, chance, seconds: parameters.seconds, next_step: 0, until: START }
    }

    /// Whether the head is stalled at this time. The times of successive calls must not decrease.
    fn at(&mut self, at: MonoNs) -> bool {
        let step = at.since(START).0.max(0).unsigned_abs() / STEP.0.unsigned_abs();
        while self.next_step <= step {
            let [chance, size] = self.stream.at(self.next_step).uniform();
            if chance < self.chance {
                let [least, most] = self.seconds;
                let begins_s = self.next_step as f64 * STEP.as_secs_f64();
                let ends_s = begins_s + least + (most - least) * size;
                self.until = self.until.max(START + DurNs::from_secs_f64(ends_s));
            }
            self.next_step += 1;
        }
        at < self.until
    }
}

fn stall(mut heads: Query<'_, '_, (&mut Samples<Sounding>, &mut HeadStalls)>) {
    for (mut samples, mut stalling) in &mut heads {
        let HeadStalls { parameters, stalls, behind } = &mut *stalling;
        for sounding in &mut samples.list {
            let is_stalled = stalls.at(sounding.at);
            behind.step(sounding, !is_stalled, parameters.is_reported);
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    /// If stalls may overlap, the share of time without a stall is exp(-rate x mean length).
    #[test]
    fn stalls_have_the_given_rate_and_length() {
        let parameters = Parameters { per_hour: 60.0, seconds: [2.0, 10.0], is_reported: true };
        let mut stalls = Stalls::new(Stream::new(5, "head_stalls", "head"), &parameters);
        let (hours, step_s) = (200, 0.1);
        let count = hours * 36_000;
        let (mut begun, mut still, mut before) = (0, 0, false);
        for k in 0..count {
            let is_stalled = stalls.at(START + DurNs::from_secs_f64(f64::from(k) * step_s));
            (begun, still) = (begun + i32::from(is_stalled && !before), still + i32::from(is_stalled));
            before = is_stalled;
        }
        let free = math::exp(-6.0 / 60.0);
        let share = f64::from(still) / f64::from(count);
        // The tolerance is that of a mean over 12,000 stalls whose lengths vary.
        assert!((share - (1.0 - free)).abs() < 5.0 * 0.095 / math::sqrt(12_000.0) * 1.5, "{share}");
        let wanted = f64::from(hours) * 60.0 * free;
        assert!((f64::from(begun) - wanted).abs() < 5.0 * math::sqrt(wanted), "{begun} {wanted}");
    }

    #[test]
    fn stalled_head_repeats_one_angle_and_continues_in_whole_steps() {
        for is_reported in [true, false] {
            let keys =
                format!("[effects.head_stalls]\nper_hour = 600\nseconds = [1, 1]\ntold = {is_reported}\n");
            let (plain, pings) = (
                Bench::turning("").run::<Sounding>("head_a"),
                Bench::turning(&keys).run::<Sounding>("head_a"),
            );
            let step_rad = plain[1].angle_rad - plain[0].angle_rad;
            let step = |a: f64, b: f64| math::wrap_signed(b - a, math::TAU);
            let steps: Vec<f64> = pings.windows(2).map(|w| step(w[0].angle_rad, w[1].angle_rad)).collect();
            assert!(steps.iter().all(|s| s.abs() < 1e-9 || (s - step_rad).abs() < 1e-9));
            assert!(steps.iter().any(|s| s.abs() < 1e-9));
            for (ping, plain) in pings.iter().zip(&plain) {
                let wanted = if is_reported { ping.angle_rad } else { plain.angle_rad };
                assert!(step(ping.reported_rad, wanted).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::sectors("[effects.head_stalls]\nper_hour = 600\nseconds = [0.5, 3]\n"));
        assert!(refusal("[effects.head_stalls]\n").contains("must not be zero"));
        assert!(refusal("[effects.head_stalls]\nper_hour = 1\nseconds = [3, 2]\n").contains("[least, most]"));
    }
}
