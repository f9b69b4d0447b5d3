//! Quantisation of the cable counter's readings.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Payout;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// The cable counter's readings are rounded to equal steps, counted from chainage zero.
///
/// `quantum_m` is the step, 0.01 by default. The device's wire format adds its own quantisation.
pub(super) struct TetherQuantumKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    quantum_m: f64,
}

#[derive(Component)]
struct TetherQuantum {
    quantum_m: f64,
}

impl EffectKind for TetherQuantumKind {
    fn name(&self) -> &'static str {
        "tether_quantum"
    }

    fn summary(&self) -> &'static str {
        "cable counter readings are quantised"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            Ok(Parameters { quantum_m: table.number("quantum_m", 1e-4..=10.0)?.unwrap_or(0.01) })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, Parameters { quantum_m }) in &self.0 {
            sim.insert(*source, TetherQuantum { quantum_m: *quantum_m });
        }
        sim.system(Stage::Feel, step);
        Ok(())
    }
}

fn step(mut counters: Query<'_, '_, (&mut Samples<Payout>, &TetherQuantum)>) {
    for (mut samples, TetherQuantum { quantum_m }) in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m = math::round_to_i64(payout.chainage_m / quantum_m) as f64 * quantum_m;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::Bench;

    #[test]
    fn cable_counter_readings_are_whole_steps_with_uniform_rounding_errors() {
        let plain: Vec<Payout> = Bench::long("").run("tether");
        let stepped: Vec<Payout> = Bench::long("[effects.tether_quantum]\nquantum_m = 0.05\n").run("tether");
        let mut squares = 0.0;
        for (plain, stepped) in plain.iter().zip(&stepped) {
            let (steps, off_m) = (stepped.chainage_m / 0.05, stepped.chainage_m - plain.chainage_m);
            assert!((steps - math::round_to_i64(steps) as f64).abs() < 1e-9 && off_m.abs() <= 0.025 + 1e-9);
            squares += off_m * off_m;
        }
        let sd_m = math::sqrt(squares / plain.len() as f64);
        assert!((sd_m / (0.05 / math::sqrt(12.0)) - 1.0).abs() < 0.02, "{sd_m}");
    }
}
