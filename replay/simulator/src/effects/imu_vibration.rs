//! Vibration of inertial units caused by thrusters.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Inertia;

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

/// Thrusters shake an inertial unit at one frequency.
///
/// Keys, with defaults in brackets:
/// - `frequency_hz`, 1 to 2,000 (required): the shaft's turns per second, or that number times the number of blades.
/// - `accel_mps2` and `gyro_degps`, the amplitudes along and about each axis of the unit, zero by default.
///
/// Each axis has its own phase. A unit that integrates between samples sees the mean over its sample period T. The
/// amplitude is therefore multiplied by sin(pi f T) / (pi f T). Frequencies above half the sample rate appear as lower
/// frequencies.
/// Source: sampling theorem; strapdown units integrate between their outputs.
pub(super) struct ImuVibrationKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    frequency_hz: f64,
    accel_mps2: f64,
    gyro_radps: f64,
}

#[derive(Component)]
struct ImuVibration {
    parameters: Parameters,
    /// Phases of the vibration, radians: for the force along each axis, then for the turn rate about each axis.
    phases_rad: [f64; 6],
}

impl EffectKind for ImuVibrationKind {
    fn name(&self) -> &'static str {
        "imu_vibration"
    }

    fn summary(&self) -> &'static str {
        "inertial units measure the vibration of thrusters"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Inertial], |table| {
            let frequency_hz = table.number("frequency_hz", 1.0..=2000.0)?;
            let accel_mps2 = keys::or_zero(table, "accel_mps2", 0.0..=100.0)?;
            let gyro_degps = keys::or_zero(table, "gyro_degps", 0.0..=100.0)?;
            keys::some_not_zero(table, &[("accel_mps2", accel_mps2), ("gyro_degps", gyro_degps)])?;
            let frequency_hz = table.required("frequency_hz", frequency_hz)?;
            Ok(Parameters { frequency_hz, accel_mps2, gyro_radps: gyro_degps.to_radians() })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let vibration = ImuVibration::new(*parameters, sim.stream(*source));
            sim.insert(*source, vibration);
        }
        sim.system(Stage::Feel, shake);
        Ok(())
    }
}

fn shake(mut units: Query<'_, '_, (&mut Samples<Inertia>, &ImuVibration)>) {
    for (mut samples, vibration) in &mut units {
        for inertia in &mut samples.list {
            vibration.shake(inertia);
        }
    }
}

impl ImuVibration {
    fn new(parameters: Parameters, stream: Stream) -> Self {
        let [[a, b], [c, d], [e, f]] = [0, 1, 2].map(|step| stream.at(step).uniform());
        Self { parameters, phases_rad: [a, b, c, d, e, f].map(|turn| math::TAU * turn) }
    }

    fn shake(&self, inertia: &mut Inertia) {
        let Parameters { frequency_hz, accel_mps2, gyro_radps } = self.parameters;
        let half_rad = math::TAU / 2.0 * frequency_hz * inertia.period.as_secs_f64();
        let kept = if half_rad > 0.0 { math::sin(half_rad) / half_rad } else { 1.0 };
        // Whole turns are removed from the phase before the sine is computed, so that no digits are lost after hours of
        // diving.
        let turns = frequency_hz * inertia.at.since(START).as_secs_f64();
        let now_rad = math::TAU * math::wrap(turns, 1.0);
        let [a, b, c, d, e, f] = self.phases_rad.map(|phase_rad| math::sin(now_rad + phase_rad));
        inertia.force_mps2 = inertia.force_mps2 + Vec3::new(a, b, c).scaled(accel_mps2 * kept);
        inertia.rate_radps = inertia.rate_radps + Vec3::new(d, e, f).scaled(gyro_radps * kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    /// A function that returns the component of a measurement along or about one axis.
    type Axis = fn(&Inertia) -> f64;

    /// Compares the samples with an oscillation of 83 Hz that is integrated over each sample's period in many small
    /// steps.
    ///
    /// The phase of each axis, found from the first samples, must fit all samples. No two axes may have the same phase.
    #[test]
    fn samples_are_means_of_a_separate_oscillation_per_axis() {
        let keys = "[effects.imu_vibration]\nfrequency_hz = 83\naccel_mps2 = 4\ngyro_degps = 6\n";
        let (plain, shaken) =
            (Bench::turning("").run::<Inertia>("imu"), Bench::turning(keys).run::<Inertia>("imu"));
        let period_s = plain[0].period.as_secs_f64();
        let rate_radps = f64::to_radians(6.0);
        let axes: [(f64, Axis); 6] = [
            (4.0, |inertia| inertia.force_mps2.x()),
            (4.0, |inertia| inertia.force_mps2.y()),
            (4.0, |inertia| inertia.force_mps2.z()),
            (rate_radps, |inertia| inertia.rate_radps.x()),
            (rate_radps, |inertia| inertia.rate_radps.y()),
            (rate_radps, |inertia| inertia.rate_radps.z()),
        ];
        let mut firsts: Vec<f64> = Vec::new();
        for (amplitude, axis) in axes {
            let error = |k: usize| (axis(&shaken[k]) - axis(&plain[k])) / amplitude;
            let mean = |k: usize, phase_rad: f64| {
                let at_s = plain[k].at.since(START).as_secs_f64() - period_s / 2.0;
                let parts = 100;
                let part = |i: i32| {
                    let then_s = at_s + (f64::from(i) + 0.5) * period_s / f64::from(parts);
                    math::sin(math::TAU * 83.0 * then_s + phase_rad)
                };
                (0..parts).map(part).sum::<f64>() / f64::from(parts)
            };
            let square = |x: f64| x * x;
            let off = |phase_rad: f64| (0..25).map(|k| square(error(k) - mean(k, phase_rad))).sum::<f64>();
            let tried = (0..1000).map(|i| math::TAU * f64::from(i) / 1000.0);
            let phase_rad = tried.min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap();
            let worst = (0..plain.len()).map(|k| (error(k) - mean(k, phase_rad)).abs()).fold(0.0, f64::max);
            let largest = (0..plain.len()).map(|k| error(k).abs()).fold(0.0, f64::max);
            assert!(plain.len() > 3000 && largest > 0.125 && worst < 0.005, "{largest} {worst}");
            let apart = |other: &f64| (error(0) - other).abs() > 1e-6;
            assert!(firsts.iter().all(apart), "{phase_rad} {firsts:?}");
            firsts.push(error(0));
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.imu_vibration]\nfrequency_hz = 25\ngyro_degps = 1\n"));
        assert!(refusal("[effects.imu_vibration]\naccel_mps2 = 1\n").contains("frequency_hz: is missing"));
        assert!(
            refusal("[effects.imu_vibration]\nfrequency_hz = 9\n").contains("gyro_degps must not be zero")
        );
    }
}
