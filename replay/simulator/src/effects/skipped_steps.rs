//! Skipped steps of heads.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::behind::Behind;
use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Samples;
use crate::stages::Stage;

/// From time to time a head misses a commanded step. From then on it lags by that step, because hosts command steps and
/// not angles.
///
/// `per_thousand` is the mean number of missed steps in a thousand. Each step is missed independently. If `is_reported` is
/// true, the head reports its true angle; otherwise, as by default, it reports the commanded angle.
pub(super) struct SkippedStepsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    share: f64,
    is_reported: bool,
}

#[derive(Component)]
struct SkippedSteps {
    parameters: Parameters,
    stream: Stream,
    behind: Behind,
}

impl EffectKind for SkippedStepsKind {
    fn name(&self) -> &'static str {
        "skipped_steps"
    }

    fn summary(&self) -> &'static str {
        "heads skip steps and fall behind"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Head], |table| {
            let per_thousand = keys::or_zero(table, "per_thousand", 0.0..=500.0)?;
            keys::some_not_zero(table, &[("per_thousand", per_thousand)])?;
            Ok(Parameters {
                share: per_thousand * 1e-3,
                is_reported: table.boolean("told")?.unwrap_or(false),
            })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let stream = sim.stream(*source);
            let skipped = SkippedSteps { parameters: *parameters, stream, behind: Behind::default() };
            sim.insert(*source, skipped);
        }
        sim.system(Stage::Turn, skip);
        Ok(())
    }
}

fn skip(mut heads: Query<'_, '_, (&mut Samples<Sounding>, &mut SkippedSteps)>) {
    for (mut samples, mut skipped) in &mut heads {
        let SkippedSteps { parameters, stream, behind } = &mut *skipped;
        for (step, sounding) in samples.steps() {
            let [chance, _] = stream.at(step).uniform();
            behind.step(sounding, chance >= parameters.share, parameters.is_reported);
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    #[test]
    fn skipped_steps_have_the_given_rate_and_are_not_caught_up_later() {
        let plain: Vec<Sounding> = Bench::long("").run("head_a");
        let step_rad = plain[1].angle_rad - plain[0].angle_rad;
        for is_reported in [false, true] {
            let keys = format!("[effects.skipped_steps]\nper_thousand = 20\ntold = {is_reported}\n");
            let pings: Vec<Sounding> = Bench::long(&keys).run("head_a");
            let mut missing = 0;
            let off = |k: usize| math::wrap_signed(pings[k].angle_rad - plain[k].angle_rad, math::TAU);
            for k in 1..pings.len() {
                let fell_rad = math::wrap_signed(off(k - 1) - off(k), math::TAU);
                let skipped = fell_rad.abs() > 1e-9;
                assert!(!skipped || (fell_rad - step_rad).abs() < 1e-9, "{k}: {fell_rad}");
                missing += usize::from(skipped);
                let reported_rad = if is_reported { pings[k].angle_rad } else { plain[k].angle_rad };
                assert!(math::wrap_signed(pings[k].reported_rad - reported_rad, math::TAU).abs() < 1e-9);
            }
            let wanted = 0.02 * (pings.len() - 1) as f64;
            assert!((missing as f64 - wanted).abs() < 5.0 * math::sqrt(wanted), "{missing} of {wanted}");
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::sectors("[effects.skipped_steps]\nper_thousand = 50\n"));
        assert!(refusal("[effects.skipped_steps]\n").contains("must not be zero"));
    }
}
