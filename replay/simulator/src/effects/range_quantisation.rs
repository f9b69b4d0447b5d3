//! Quantisation of measured ranges.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use super::targets::targets;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::{Head, Samples, Scenery};
use crate::stages::Stage;

/// Ranges are rounded to steps, as if read from an echo with a limited number of points.
///
/// Keys, with defaults in brackets. At most one is allowed:
/// - `quantum_m`, the step in metres as the device computes them, from 0.0005 to 1. A head computes with 1500 m/s. An
///   echosounder's step is in true metres.
/// - `points`, the number of steps over a head's range setting, from 50 to 10,000 (500).
///
/// Steps are in the device's own metres because the device measures time. Its wire format adds its own step. Source:
/// Jorge et al. 2021, §6 (eta) and §9.2 (500 points over 10 m: 0.02 m).
pub(super) struct RangeQuantisationKind;

#[derive(Debug, Clone, Copy)]
enum Step {
    QuantumM(f64),
    Points(f64),
}

#[derive(Component)]
struct RangeQuantisation(Step);

impl EffectKind for RangeQuantisationKind {
    fn name(&self) -> &'static str {
        "range_quantisation"
    }

    fn summary(&self) -> &'static str {
        "ranges are quantised"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            let quantum_m = table.number("quantum_m", 0.0005..=1.0)?;
            let points = table.number("points", 50.0..=10_000.0)?;
            match (quantum_m, points) {
                (Some(quantum_m), None) => return Ok(Step::QuantumM(quantum_m)),
                (Some(_), Some(_)) => {
                    return Err(table.invalid("points", "and quantum_m both set the step; give one of them"));
                }
                _ => {}
            }
            let heads = targets(table, facts, &senses)?;
            if heads.iter().any(|source| facts.sensors.get(*source).is_none_or(|s| s.head.is_none())) {
                let problem = "is needed for echosounders, which have no range setting to divide into points";
                return Err(table.invalid("quantum_m", problem));
            }
            Ok(Step::Points(points.unwrap_or(500.0)))
        })?))
    }
}

impl Effect for PerSensor<Step> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, step) in &self.0 {
            sim.insert(*source, RangeQuantisation(*step));
        }
        sim.system(Stage::Hear, round);
        Ok(())
    }
}

impl Step {
    /// Step to which ranges are rounded, converted from the device's metres to true metres.
    fn in_water_m(self, head: Option<&Head>, sound_speed_mps: f64) -> f64 {
        let water_per_device = head.map_or(1.0, |Head(spec)| sound_speed_mps / spec.sound_speed_mps);
        let quantum_m = match self {
            Self::QuantumM(quantum_m) => quantum_m,
            Self::Points(points) => head.map_or(0.0, |Head(spec)| spec.range_m[1] / points),
        };
        quantum_m * water_per_device
    }
}

type Stepped<'a> = (&'a mut Samples<Sounding>, &'a RangeQuantisation, Option<&'a Head>);

fn round(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Stepped<'_>>) {
    for (mut samples, RangeQuantisation(step), head) in &mut sonars {
        let step_m = step.in_water_m(head, scenery.site.sound_speed_mps);
        for range_m in samples.list.iter_mut().filter_map(|sounding| sounding.range_m.as_mut()) {
            *range_m = math::round_to_i64(*range_m / step_m) as f64 * step_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use crate::testing::Dive;

    fn assert_lattice(dive: &Dive, effects: &str, step_m: f64) {
        let (base, dived) = (dive.dive(""), dive.dive(effects));
        let mut differ = 0;
        for (was, is) in base.ranges_m(0).iter().zip(dived.ranges_m(0)) {
            let (was, is) = (was.unwrap(), is.unwrap());
            let steps = is / step_m;
            assert!((steps - math::round_to_i64(steps) as f64).abs() < 1e-9, "{effects}: {is}");
            assert!((is - was).abs() <= step_m / 2.0 + 1e-12, "{effects}");
            differ += usize::from(is.to_bits() != was.to_bits());
        }
        assert!(differ > base.rows.len() / 2, "{effects}");
    }

    #[test]
    fn head_ranges_are_rounded_to_steps_in_device_metres() {
        let mut dive = Dive::with_head();
        dive.vehicle = "[water]\nsound_speed_mps = 1447";
        let water = 1447.0 / 1500.0;
        assert_lattice(&dive, "[effects.range_quantisation]", 0.02 * water);
        assert_lattice(&dive, "[effects.range_quantisation]\npoints = 250", 0.04 * water);
        assert_lattice(&dive, "[effects.range_quantisation]\nquantum_m = 0.1", 0.1 * water);
    }

    #[test]
    fn echosounder_ranges_are_rounded_to_steps_in_true_metres() {
        let mut dive = Dive::with_sounder();
        dive.trajectory = "place_m = [0.123, 2]";
        assert_lattice(&dive, "[effects.range_quantisation]\nquantum_m = 0.15", 0.15);
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.range_quantisation]");
    }

    #[test]
    fn missing_and_conflicting_quantisation_steps_are_refused() {
        let refusal =
            |dive: &Dive, keys: &str| dive.refusal(&format!("[effects.range_quantisation]\n{keys}"));
        assert!(refusal(&Dive::with_sounder(), "").contains("no range setting"));
        assert!(refusal(&Dive::with_sounder(), "points = 200").contains("no range setting"));
        assert!(refusal(&Dive::with_head(), "points = 200\nquantum_m = 0.1").contains("both set the step"));
        assert!(refusal(&Dive::with_head(), "quantum_m = 0").contains("from 0.0005 to 1"));
    }
}
