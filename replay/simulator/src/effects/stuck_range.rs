//! A sonar that reports a constant range.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// A sonar reports a constant range, whatever its beam meets. Possible causes are the sonar's own frame, or a bubble in
/// front of the transducer.
///
/// Keys, with defaults in brackets: the range `range_m` (0.55), from 0.01 to 200 m; the start `from_s` (0) and the end
/// `to_s` (never), in seconds from the dive's start. Source: a head in its frame reported 0.55 m throughout a whole
/// dive.
pub(super) struct StuckRangeKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    range_m: f64,
    from_s: f64,
    to_s: f64,
}

#[derive(Component)]
struct StuckRange {
    range_m: f64,
    between: [MonoNs; 2],
}

impl EffectKind for StuckRangeKind {
    fn name(&self) -> &'static str {
        "stuck_range"
    }

    fn summary(&self) -> &'static str {
        "a sonar always reports the same range"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            let range_m = table.number("range_m", 0.01..=200.0)?.unwrap_or(0.55);
            let from_s = table.number("from_s", 0.0..=1.0e6)?.unwrap_or(0.0);
            let to_s = table.number("to_s", 0.0..=1.0e6)?.unwrap_or(1.0e6);
            if to_s <= from_s {
                return Err(table.invalid("to_s", &format!("must be above from_s, which is {from_s}")));
            }
            Ok(Parameters { range_m, from_s, to_s })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, Parameters { range_m, from_s, to_s }) in &self.0 {
            let between = [from_s, to_s].map(|after_s| START + DurNs::from_secs_f64(*after_s));
            sim.insert(*source, StuckRange { range_m: *range_m, between });
        }
        sim.system(Stage::Hear, stick);
        Ok(())
    }
}

fn stick(mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &StuckRange)>) {
    for (mut samples, StuckRange { range_m, between: [from, to] }) in &mut sonars {
        for (_, sounding) in samples.steps() {
            if (*from..*to).contains(&sounding.at) {
                sounding.range_m = Some(*range_m);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::testing::Dive;

    #[test]
    fn range_is_constant_while_stuck_and_true_otherwise() {
        let dive = Dive { seconds: 30.0, ..Dive::with_head() };
        let effect = "[effects.stuck_range]\nrange_m = 0.7\nfrom_s = 10\nto_s = 20";
        let (base, dived) = (dive.dive(""), dive.dive(effect));
        let stuck = dived.ranges_m(0).iter().filter(|range_m| **range_m == Some(0.7)).count();
        let changed = base.ranges_m(0).iter().zip(&dived.ranges_m(0)).filter(|(a, b)| a != b).count();
        assert_eq!(stuck, changed);
        let third = base.rows.len() / 3;
        assert!((third - 3..=third + 3).contains(&stuck), "{stuck} of {}", base.rows.len());
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.stuck_range]\nfrom_s = 2");
    }

    #[test]
    fn stuck_range_that_ends_before_its_start_is_refused() {
        let refusal = Dive::with_head().refusal("[effects.stuck_range]\nfrom_s = 5\nto_s = 4");
        assert!(refusal.contains("must be above from_s"));
    }
}
