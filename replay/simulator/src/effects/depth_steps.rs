//! Quantisation of reported depths.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Pressure;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::{Samples, Scenery};
use crate::stages::Stage;

/// A depth sensor reports the depth below the surface rounded to the nearest step.
///
/// `quantum_m` is the step in metres of the site's water, 0.031 by default. The default is a 32,768th of a sensor's
/// range of 100 bar. The device's wire format adds its own quantisation.
pub(super) struct DepthStepsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    quantum_m: f64,
}

#[derive(Component)]
struct DepthSteps {
    quantum_m: f64,
}

impl EffectKind for DepthStepsKind {
    fn name(&self) -> &'static str {
        "depth_steps"
    }

    fn summary(&self) -> &'static str {
        "depth readings are quantised"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Depth], |table| {
            Ok(Parameters { quantum_m: table.number("quantum_m", 1e-4..=1.0)?.unwrap_or(0.031) })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, Parameters { quantum_m }) in &self.0 {
            sim.insert(*source, DepthSteps { quantum_m: *quantum_m });
        }
        sim.system(Stage::Feel, step);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]
fn step(scenery: Res<'_, Scenery>, mut sensors: Query<'_, '_, (&mut Samples<Pressure>, &DepthSteps)>) {
    for (mut samples, DepthSteps { quantum_m }) in &mut sensors {
        for pressure in &mut samples.list {
            let steps = math::round_to_i64(scenery.site.depth_m(pressure.pressure_pa) / quantum_m);
            pressure.pressure_pa = scenery.site.pressure_pa(steps as f64 * quantum_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, LEGS, refusal};

    #[test]
    fn reported_depths_are_multiples_of_the_step_within_half_a_step() {
        let wander = "[effects.pilot_drift]\nup_m = 0.5\n";
        let keys = format!("{wander}[effects.depth_steps]\n");
        let (plain, stepped) =
            (Bench::on(LEGS, wander).run::<Pressure>("depth"), Bench::on(LEGS, &keys).run("depth"));
        let site = headrace_geometry::site::Site { surface_above_floor_m: 50.0, ..Default::default() };
        let mut steps = Vec::new();
        for (plain, stepped) in plain.iter().zip(&stepped) {
            let [was_m, is_m] = [plain, stepped].map(|p| site.depth_m(p.pressure_pa));
            assert!((was_m - is_m).abs() <= 0.0155 + 1e-9);
            let whole = math::round_to_i64(is_m / 0.031);
            assert!((is_m / 0.031 - whole as f64).abs() < 1e-6);
            steps.push(whole);
        }
        steps.sort_unstable();
        steps.dedup();
        assert!(steps.len() > 4, "{steps:?}");
    }

    #[test]
    fn depth_quantisation_of_an_inertial_unit_is_refused() {
        assert!(refusal("[effects.depth_steps]\nsensors = [\"imu\"]\n").contains("can act on: depth"));
    }
}
