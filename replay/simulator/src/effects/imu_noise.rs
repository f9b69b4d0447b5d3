//! White noise of inertial units.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Rot, Sensor, Vec3};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Inertia;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Samples;
use crate::stages::Stage;

/// Indices of the first block of random numbers for turn rate, force and attitude. Each vector takes two blocks.
const RATE: u64 = 0;
const FORCE: u64 = 2;
const ATTITUDE: u64 = 4;

/// White noise of an inertial unit, independent for each axis.
///
/// `gyro_degps_rthz` and `accel_mps2_rthz` are densities. The standard deviation of a sample is the density times the
/// root of the unit's rate. The standard deviation of an integral over t seconds is the density times the root of t.
/// `attitude_deg` is the standard deviation of the rotation of each attitude about each axis of the unit. All are zero
/// by default. Source: IEEE Std 952-1997, C.1 (angle random walk); a MEMS unit's data sheet has 0.007 deg/s/sqrt(Hz).
pub(super) struct ImuNoiseKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    gyro_radps_rthz: f64,
    accel_mps2_rthz: f64,
    attitude_rad: f64,
}

#[derive(Component)]
struct ImuNoise {
    parameters: Parameters,
    stream: Stream,
}

impl EffectKind for ImuNoiseKind {
    fn name(&self) -> &'static str {
        "imu_noise"
    }

    fn summary(&self) -> &'static str {
        "angular rates, accelerations and attitudes have noise"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Inertial], |table| {
            let gyro = keys::or_zero(table, "gyro_degps_rthz", 0.0..=10.0)?;
            let accel_mps2_rthz = keys::or_zero(table, "accel_mps2_rthz", 0.0..=1.0)?;
            let attitude = keys::or_zero(table, "attitude_deg", 0.0..=30.0)?;
            let values =
                [("gyro_degps_rthz", gyro), ("accel_mps2_rthz", accel_mps2_rthz), ("attitude_deg", attitude)];
            keys::some_not_zero(table, &values)?;
            let (gyro_radps_rthz, attitude_rad) = (gyro.to_radians(), attitude.to_radians());
            Ok(Parameters { gyro_radps_rthz, accel_mps2_rthz, attitude_rad })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let stream = sim.stream(*source);
            sim.insert(*source, ImuNoise { parameters: *parameters, stream });
        }
        sim.system(Stage::Feel, scatter);
        Ok(())
    }
}

fn scatter(mut units: Query<'_, '_, (&mut Samples<Inertia>, &ImuNoise)>) {
    for (mut samples, noise) in &mut units {
        for (step, inertia) in samples.steps() {
            noise.disturb(step, inertia);
        }
    }
}

impl ImuNoise {
    fn disturb(&self, step: u64, inertia: &mut Inertia) {
        let Parameters { gyro_radps_rthz, accel_mps2_rthz, attitude_rad } = self.parameters;
        let rthz = 1.0 / math::sqrt(inertia.period.as_secs_f64().max(1e-6));
        if gyro_radps_rthz > 0.0 {
            inertia.rate_radps = inertia.rate_radps + self.vector(step, RATE, gyro_radps_rthz * rthz);
        }
        if accel_mps2_rthz > 0.0 {
            inertia.force_mps2 = inertia.force_mps2 + self.vector(step, FORCE, accel_mps2_rthz * rthz);
        }
        if attitude_rad > 0.0 {
            let by = self.vector(step, ATTITUDE, attitude_rad);
            let turned = Rot::<Sensor, Sensor>::from_roll_pitch_yaw(by.x(), by.y(), by.z());
            inertia.attitude = inertia.attitude * turned;
        }
    }

    fn vector(&self, step: u64, block: u64, sd: f64) -> Vec3<Sensor> {
        let [x, y] = self.stream.block(step, block).normal();
        let [z, _] = self.stream.block(step, block + 1).normal();
        Vec3::new(x, y, z).scaled(sd)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const KEYS: &str =
        "[effects.imu_noise]\ngyro_degps_rthz = 0.007\naccel_mps2_rthz = 0.001\nattitude_deg = 0.5\n";

    /// White noise with density N has an Allan deviation of N / sqrt(t) for means over any time t.
    #[test]
    fn rate_and_force_noise_have_the_given_densities_for_any_averaging_time() {
        let (plain, noisy) = (Bench::long("").run::<Inertia>("imu"), Bench::long(KEYS).run::<Inertia>("imu"));
        let period_s = plain[0].period.as_secs_f64();
        let parts = |f: fn(&Inertia) -> [f64; 3]| -> Vec<[f64; 3]> {
            let difference = |(a, b): (&Inertia, &Inertia)| [0, 1, 2].map(|axis| f(b)[axis] - f(a)[axis]);
            plain.iter().zip(&noisy).map(difference).collect()
        };
        let rates = parts(|i| i.rate_radps.0.into());
        let forces = parts(|i| i.force_mps2.0.into());
        for (series, density) in [(rates, f64::to_radians(0.007)), (forces, 0.001)] {
            for length in [1, 10, 100] {
                let means: Vec<[f64; 3]> = series
                    .chunks_exact(length)
                    .map(|c| [0, 1, 2].map(|axis| c.iter().map(|v| v[axis]).sum::<f64>() / length as f64))
                    .collect();
                for axis in 0..3 {
                    let squares: f64 =
                        means.windows(2).map(|w| (w[1][axis] - w[0][axis]) * (w[1][axis] - w[0][axis])).sum();
                    let n = (means.len() - 1) as f64;
                    let variance = squares / n / 2.0;
                    let wanted = density * density / (period_s * length as f64);
                    // Each difference is between the means of two neighbouring spans, so neighbouring differences share
                    // one mean. The relative variance of the estimate from n differences is therefore 3 / n.
                    let off = variance / wanted - 1.0;
                    assert!(off.abs() < 5.0 * math::sqrt(3.0 / n), "{length} {axis}: {off}");
                }
            }
        }
    }

    #[test]
    fn attitude_noise_has_the_given_strength_about_each_axis() {
        let (plain, noisy) = (Bench::long("").run::<Inertia>("imu"), Bench::long(KEYS).run::<Inertia>("imu"));
        let mut squares = [0.0; 3];
        for (plain, noisy) in plain.iter().zip(&noisy) {
            let (roll, pitch, yaw) = (plain.attitude.inverse() * noisy.attitude).roll_pitch_yaw();
            for (sum, angle) in squares.iter_mut().zip([roll, pitch, yaw]) {
                *sum += angle * angle;
            }
        }
        let n = plain.len() as f64;
        let wanted = f64::to_radians(0.5) * f64::to_radians(0.5);
        for sum in squares {
            assert!((sum / n / wanted - 1.0).abs() < 5.0 * math::sqrt(2.0 / n));
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning(KEYS));
        assert!(refusal("[effects.imu_noise]\n").contains("accel_mps2_rthz, attitude_deg must not be"));
    }
}
