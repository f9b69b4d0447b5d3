//! Biases of inertial units: turn rate, force and attitude.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Rot, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Inertia;
use headrace_sensor::reading::Level;

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

/// Step number that is reserved for drawing the constant biases. No sample has this number.
const CONSTANT: u64 = u64::MAX;
/// Block of random numbers for the tilt, after the blocks for the biases.
const TILT: u64 = 3;

/// Varying and constant biases of an inertial unit, independent for each axis.
///
/// - `gyro_degps` and `accel_mps2` are the standard deviations of first-order Gauss-Markov processes whose correlation
///   falls to 1/e within `tau_s` (300 by default). The processes are stationary from the first sample.
/// - `gyro_constant_degps` and `accel_constant_mps2` are standard deviations of biases that are constant during the
///   dive.
/// - `attitude_drift_deg_per_hour` turns the unit's own attitude about the vertical at a constant rate, positive to the
///   left.
/// - `tilt_deg` is the standard deviation of another Gauss-Markov process, which tilts the attitude, with time constant
///   `tilt_tau_s` (30 by default). Apart from this, the influence of biases and accelerations on the unit's own filter
///   isn't simulated.
///
/// All are zero by default. Source: Brown and Hwang, Introduction to Random Signals and Applied Kalman Filtering, 4th
/// ed., §4.4 (exact steps).
pub(super) struct ImuBiasKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    gyro_radps: f64,
    accel_mps2: f64,
    tau_s: f64,
    gyro_constant_radps: f64,
    accel_constant_mps2: f64,
    drift_radps: f64,
    tilt_rad: f64,
    tilt_tau_s: f64,
}

#[derive(Component)]
struct ImuBias {
    parameters: Parameters,
    stream: Stream,
    constant: [f64; 6],
    /// Latest varying biases, in standard deviations: three of turn rates, then three of forces.
    wandering: [f64; 6],
    /// Latest tilt of the attitude in roll and pitch, in standard deviations.
    tilt: [f64; 2],
    before: Option<MonoNs>,
    /// Previous sample interval, with two factors for the biases and two for the tilt. The factors are the correlation
    /// over the interval and the weight of a new random number.
    ///
    /// The factors are kept because most samples have the same interval.
    kept: (DurNs, [[f64; 2]; 2]),
}

impl EffectKind for ImuBiasKind {
    fn name(&self) -> &'static str {
        "imu_bias"
    }

    fn summary(&self) -> &'static str {
        "angular rates and accelerations have drifting biases"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Inertial], |table| {
            let gyro = keys::or_zero(table, "gyro_degps", 0.0..=100.0)?;
            let accel_mps2 = keys::or_zero(table, "accel_mps2", 0.0..=10.0)?;
            let gyro_constant = keys::or_zero(table, "gyro_constant_degps", 0.0..=100.0)?;
            let accel_constant_mps2 = keys::or_zero(table, "accel_constant_mps2", 0.0..=10.0)?;
            let drift = keys::or_zero(table, "attitude_drift_deg_per_hour", -3600.0..=3600.0)?;
            let tilt = keys::or_zero(table, "tilt_deg", 0.0..=30.0)?;
            let values = [
                ("tilt_deg", tilt),
                ("gyro_degps", gyro),
                ("accel_mps2", accel_mps2),
                ("gyro_constant_degps", gyro_constant),
                ("accel_constant_mps2", accel_constant_mps2),
                ("attitude_drift_deg_per_hour", drift),
            ];
            keys::some_not_zero(table, &values)?;
            Ok(Parameters {
                gyro_radps: gyro.to_radians(),
                accel_mps2,
                tau_s: table.number("tau_s", 1.0..=1e6)?.unwrap_or(300.0),
                gyro_constant_radps: gyro_constant.to_radians(),
                accel_constant_mps2,
                drift_radps: drift.to_radians() / 3600.0,
                tilt_rad: tilt.to_radians(),
                tilt_tau_s: table.number("tilt_tau_s", 1.0..=1e6)?.unwrap_or(30.0),
            })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let bias = ImuBias::new(*parameters, sim.stream(*source));
            sim.insert(*source, bias);
        }
        sim.system(Stage::Feel, lean);
        Ok(())
    }
}

fn lean(mut units: Query<'_, '_, (&mut Samples<Inertia>, &mut ImuBias)>) {
    for (mut samples, mut bias) in &mut units {
        for (step, inertia) in samples.steps() {
            bias.wander(step, inertia.at);
            bias.disturb(inertia);
        }
    }
}

impl ImuBias {
    fn new(parameters: Parameters, stream: Stream) -> Self {
        let drawn = six(stream, CONSTANT);
        let sds = [parameters.gyro_constant_radps, parameters.accel_constant_mps2];
        let mut constant = drawn;
        for (axis, value) in constant.iter_mut().enumerate() {
            *value *= if axis < 3 { sds[0] } else { sds[1] };
        }
        let kept = (DurNs::ZERO, [[1.0, 0.0]; 2]);
        Self { parameters, stream, constant, wandering: [0.0; 6], tilt: [0.0; 2], before: None, kept }
    }

    fn wander(&mut self, step: u64, at: MonoNs) {
        let Parameters { gyro_radps, accel_mps2, tau_s, tilt_rad, tilt_tau_s, .. } = self.parameters;
        if gyro_radps == 0.0 && accel_mps2 == 0.0 && tilt_rad == 0.0 {
            return;
        }
        let drawn = six(self.stream, step);
        let tilted = if tilt_rad > 0.0 { self.stream.block(step, TILT).normal() } else { [0.0; 2] };
        match self.before {
            None => (self.wandering, self.tilt) = (drawn, tilted),
            Some(before) => {
                let elapsed = at.since(before);
                if self.kept.0 != elapsed {
                    let of = |tau_s: f64| {
                        let kept = math::exp(-elapsed.as_secs_f64() / tau_s);
                        [kept, math::sqrt((1.0 - kept * kept).max(0.0))]
                    };
                    self.kept = (elapsed, [of(tau_s), of(tilt_tau_s)]);
                }
                let (_, [[kept, fresh], [tilt_kept, tilt_fresh]]) = self.kept;
                for (value, new) in self.wandering.iter_mut().zip(drawn) {
                    *value = *value * kept + new * fresh;
                }
                for (value, new) in self.tilt.iter_mut().zip(tilted) {
                    *value = *value * tilt_kept + new * tilt_fresh;
                }
            }
        }
        self.before = Some(at);
    }

    fn disturb(&self, inertia: &mut Inertia) {
        let Parameters { gyro_radps, accel_mps2, drift_radps, tilt_rad, .. } = self.parameters;
        let [a, b, c, d, e, f] = self.wandering;
        let [p, q, r, s, t, u] = self.constant;
        let rate = Vec3::new(a, b, c).scaled(gyro_radps) + Vec3::new(p, q, r);
        let force = Vec3::new(d, e, f).scaled(accel_mps2) + Vec3::new(s, t, u);
        inertia.rate_radps = inertia.rate_radps + rate;
        inertia.force_mps2 = inertia.force_mps2 + force;
        if drift_radps != 0.0 {
            let yaw_rad = drift_radps * inertia.at.since(START).as_secs_f64();
            let turned = Rot::<Level, Level>::from_roll_pitch_yaw(0.0, 0.0, yaw_rad);
            inertia.attitude = turned * inertia.attitude;
        }
        if tilt_rad > 0.0 {
            let [roll, pitch] = self.tilt.map(|tilt| tilt_rad * tilt);
            let turned = Rot::<Level, Level>::from_roll_pitch_yaw(roll, pitch, 0.0);
            inertia.attitude = turned * inertia.attitude;
        }
    }
}

fn six(stream: Stream, step: u64) -> [f64; 6] {
    let [[a, b], [c, d], [e, f]] = [0, 1, 2].map(|block| stream.block(step, block).normal());
    [a, b, c, d, e, f]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    fn bias(seed: u64, tau_s: f64) -> ImuBias {
        let parameters = Parameters {
            gyro_radps: f64::to_radians(0.2),
            accel_mps2: 0.03,
            tau_s,
            gyro_constant_radps: 0.0,
            accel_constant_mps2: 0.0,
            drift_radps: 0.0,
            tilt_rad: f64::to_radians(0.5),
            tilt_tau_s: 30.0,
        };
        ImuBias::new(parameters, Stream::new(seed, "imu_bias", "imu"))
    }

    fn felt(bias: &mut ImuBias, step: u64, at: MonoNs) -> [f64; 6] {
        let mut inertia = Inertia::due(at, DurNs::from_millis(10));
        bias.wander(step, at);
        bias.disturb(&mut inertia);
        let ([a, b, c], [d, e, f]) = (inertia.rate_radps.0.into(), inertia.force_mps2.0.into());
        [a, b, c, d, e, f]
    }

    /// Over many seeds, the variance at the first sample and at a much later sample equals the given variance, and the
    /// correlation between the two samples is exp(-t / tau).
    #[test]
    fn biases_are_stationary_and_decorrelate_over_tau() {
        let (runs, steps, tau_s) = (4000, 50, 2.0);
        let (mut first, mut last, mut both) = (0.0, 0.0, 0.0);
        for seed in 0..runs {
            let mut bias = bias(seed, tau_s);
            let at = |step: u64| START + DurNs::from_millis(step as i64 * 20);
            let from = felt(&mut bias, 0, at(0));
            let mut to = from;
            for step in 1..=steps {
                to = felt(&mut bias, step, at(step));
            }
            for axis in 0..3 {
                let (a, b) = (from[axis] / f64::to_radians(0.2), to[axis + 3] / 0.03);
                let c = to[axis] / f64::to_radians(0.2);
                (first, last, both) = (first + a * a, last + b * b, both + a * c);
            }
        }
        let n = 3.0 * runs as f64;
        let tolerance = 5.0 * math::sqrt(2.0 / n);
        assert!((first / n - 1.0).abs() < tolerance && (last / n - 1.0).abs() < tolerance);
        let wanted = math::exp(-0.5);
        assert!((both / n - wanted).abs() < 5.0 * math::sqrt((1.0 + wanted * wanted) / n), "{}", both / n);
    }

    /// The bias doesn't depend on the sample rate. With twice as many samples per second, its change over a given time
    /// has the same variance.
    #[test]
    fn bias_change_depends_on_time_not_on_sample_count() {
        let change = |millis: i64| {
            let mut sum = 0.0;
            for seed in 0..4000 {
                let mut bias = bias(seed, 5.0);
                let steps = 1000 / millis;
                let series: Vec<f64> = (0..=steps)
                    .map(|k| felt(&mut bias, k.unsigned_abs(), START + DurNs::from_millis(k * millis))[4])
                    .collect();
                let by = series[series.len() - 1] - series[0];
                sum += by * by / (0.03 * 0.03) / 4000.0;
            }
            sum
        };
        let wanted = 2.0 * (1.0 - math::exp(-0.2));
        for millis in [500, 100, 20] {
            let change = change(millis);
            assert!((change / wanted - 1.0).abs() < 5.0 * math::sqrt(2.0 / 4000.0), "{millis}: {change}");
        }
    }

    #[test]
    fn constant_gyro_bias_does_not_change_in_a_dive() {
        let keys = "[effects.imu_bias]\ngyro_constant_degps = 0.1\nattitude_drift_deg_per_hour = 36\n";
        let (plain, leaning) =
            (Bench::turning("").run::<Inertia>("imu"), Bench::turning(keys).run::<Inertia>("imu"));
        let by = |k: usize| leaning[k].rate_radps + -plain[k].rate_radps;
        assert!(by(0).norm() > 1e-5);
        for (k, (plain, leaning)) in plain.iter().zip(&leaning).enumerate() {
            assert!((by(k) + -by(0)).norm() < 1e-12 && leaning.force_mps2 == plain.force_mps2);
            let yaw_deg = (leaning.attitude * plain.attitude.inverse()).roll_pitch_yaw().2.to_degrees();
            assert!((yaw_deg - 0.01 * plain.at.since(START).as_secs_f64()).abs() < 1e-9);
        }
    }

    /// The tilt is stationary, has the correlation given by its time constant, and acts only about level axes.
    #[test]
    fn tilt_varies_about_level_axes_without_changing_rates_or_forces() {
        let keys = "[effects.imu_bias]\ntilt_deg = 0.5\ntilt_tau_s = 2\n";
        let (plain, tilted) =
            (Bench::long("").run::<Inertia>("imu"), Bench::long(keys).run::<Inertia>("imu"));
        let off: Vec<[f64; 3]> = plain
            .iter()
            .zip(&tilted)
            .map(|(plain, tilted)| {
                assert_eq!((plain.rate_radps, plain.force_mps2), (tilted.rate_radps, tilted.force_mps2));
                let (roll, pitch, yaw) = (tilted.attitude * plain.attitude.inverse()).roll_pitch_yaw();
                [roll, pitch, yaw]
            })
            .collect();
        let lag = plain.iter().position(|inertia| inertia.at.since(plain[0].at).0 >= 2_000_000_000).unwrap();
        let wanted = f64::to_radians(0.5) * f64::to_radians(0.5);
        // For a process with correlation time tau, all samples within a time t carry as much information as t / (2 tau)
        // independent samples.
        let worth = plain.len() as f64 / lag as f64 / 2.0;
        for axis in 0..2 {
            let product = |lag: usize| {
                let pairs = off.iter().zip(off.iter().skip(lag));
                pairs.map(|(a, b)| a[axis] * b[axis]).sum::<f64>() / (off.len() - lag) as f64
            };
            let tolerance = 5.0 * math::sqrt(2.0 / worth);
            assert!((product(0) / wanted - 1.0).abs() < tolerance, "{axis}: {}", product(0) / wanted);
            assert!((product(lag) / wanted - math::exp(-1.0)).abs() < tolerance, "{axis}");
        }
        assert!(off.iter().all(|[.., yaw]| yaw.abs() < 1e-3));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning(
            "[effects.imu_bias]\ngyro_degps = 0.2\naccel_mps2 = 0.01\ntau_s = 5\n",
        ));
        assert!(refusal("[effects.imu_bias]\ntau_s = 100\n").contains("must not be zero"));
    }
}
