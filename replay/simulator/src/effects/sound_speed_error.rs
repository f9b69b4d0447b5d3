//! A true speed of sound that differs from the configured one.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// The true speed of sound differs from the vehicle file's.
///
/// Echoes come earlier or later. Reported ranges, which are computed with the file's speed, are scaled by file / true.
/// One of two keys is required: `true_mps`, the true speed, from 1300 to 1700 m/s; or `share`, the relative excess of
/// the true speed over the file's, from -0.1 to 0.1.
pub(super) struct SoundSpeedErrorKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    /// Ratio of a reported range to the true range.
    scale: f64,
}

#[derive(Component)]
struct SoundSpeedError(Parameters);

impl EffectKind for SoundSpeedErrorKind {
    fn name(&self) -> &'static str {
        "sound_speed_error"
    }

    fn summary(&self) -> &'static str {
        "the speed of sound differs from the vehicle file, which scales all ranges"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            let true_mps = table.number("true_mps", 1300.0..=1700.0)?;
            let share = table.number("share", -0.1..=0.1)?;
            let scale = match (true_mps, share) {
                (Some(true_mps), None) => facts.sound_speed_mps / true_mps,
                (None, Some(share)) => 1.0 / (1.0 + share),
                _ => return Err(table.invalid("true_mps", "give exactly one of true_mps and share")),
            };
            Ok(Parameters { scale })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            sim.insert(*source, SoundSpeedError(*parameters));
        }
        sim.system(Stage::Hear, rescale);
        Ok(())
    }
}

fn rescale(mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &SoundSpeedError)>) {
    for (mut samples, SoundSpeedError(Parameters { scale })) in &mut sonars {
        for range_m in samples.list.iter_mut().filter_map(|sounding| sounding.range_m.as_mut()) {
            *range_m *= scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::Dive;

    fn assert_scaled(effects: &str, scale: f64) {
        let mut dive = Dive::with_head();
        dive.vehicle = "[water]\nsound_speed_mps = 1447";
        for (was, is) in dive.dive("").ranges_m(0).iter().zip(dive.dive(effects).ranges_m(0)) {
            assert!((is.unwrap() / was.unwrap() - scale).abs() < 1e-15, "{effects}");
        }
    }

    #[test]
    fn ranges_are_scaled_by_the_ratio_of_speeds() {
        assert_scaled("[effects.sound_speed_error]\ntrue_mps = 1482", 1447.0 / 1482.0);
        assert_scaled("[effects.sound_speed_error]\nshare = -0.02", 1.0 / 0.98);
        assert_scaled("[[effects.sound_speed_error]]\nsensors = [\"sonar_0\"]\ntrue_mps = 1447", 1.0);
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.sound_speed_error]\nshare = 0.01");
    }

    #[test]
    fn missing_or_conflicting_speeds_of_sound_are_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.sound_speed_error]\n{keys}"));
        assert!(refusal("").contains("give exactly one of true_mps and share"));
        assert!(refusal("true_mps = 1450\nshare = 0.01").contains("give exactly one of true_mps and share"));
        assert!(refusal("share = 0.2").contains("from -0.1 to 0.1"));
        assert!(refusal("true_mps = 340").contains("from 1300 to 1700"));
    }
}
