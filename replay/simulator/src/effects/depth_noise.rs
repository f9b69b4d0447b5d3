//! Noise, offset and drift of depth sensors.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Pressure;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Samples;
use crate::stages::Stage;

/// Step number that is reserved for drawing the offset. No sample has this number.
const OFFSET: u64 = u64::MAX;

/// A depth sensor's pressure has white noise, an offset, and a drift.
///
/// The keys are standard deviations: `noise_pa` of each sample's noise, `offset_sd_pa` of an offset drawn once per
/// dive, and `drift_pa` of a Gauss-Markov process. The correlation of that process falls to 1/e within `tau_s` (3,600).
/// The standard deviations are zero by default. Source: Brown and Hwang, Introduction to Random Signals and Applied
/// Kalman Filtering, 4th ed., §4.4 (exact steps).
pub(super) struct DepthNoiseKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    noise_pa: f64,
    offset_sd_pa: f64,
    drift_pa: f64,
    tau_s: f64,
}

#[derive(Component)]
struct DepthNoise {
    parameters: Parameters,
    stream: Stream,
    offset_pa: f64,
    /// Latest value of the drift, in standard deviations. The field after it has the time of this value.
    drift: f64,
    before: Option<MonoNs>,
}

impl EffectKind for DepthNoiseKind {
    fn name(&self) -> &'static str {
        "depth_noise"
    }

    fn summary(&self) -> &'static str {
        "depth readings have noise, an offset and drift"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Depth], |table| {
            let noise_pa = keys::or_zero(table, "noise_pa", 0.0..=1e5)?;
            let offset_sd_pa = keys::or_zero(table, "offset_sd_pa", 0.0..=1e6)?;
            let drift_pa = keys::or_zero(table, "drift_pa", 0.0..=1e6)?;
            let values = [("noise_pa", noise_pa), ("offset_sd_pa", offset_sd_pa), ("drift_pa", drift_pa)];
            keys::some_not_zero(table, &values)?;
            let tau_s = table.number("tau_s", 1.0..=1e6)?.unwrap_or(3600.0);
            Ok(Parameters { noise_pa, offset_sd_pa, drift_pa, tau_s })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let stream = sim.stream(*source);
            let [drawn, _] = stream.at(OFFSET).normal();
            let offset_pa = parameters.offset_sd_pa * drawn;
            let parameters = *parameters;
            sim.insert(*source, DepthNoise { parameters, stream, offset_pa, drift: 0.0, before: None });
        }
        sim.system(Stage::Feel, disturb);
        Ok(())
    }
}

fn disturb(mut sensors: Query<'_, '_, (&mut Samples<Pressure>, &mut DepthNoise)>) {
    for (mut samples, mut noise) in &mut sensors {
        for (step, pressure) in samples.steps() {
            pressure.pressure_pa += noise.error_pa(step, pressure.at);
        }
    }
}

impl DepthNoise {
    /// Error of one pressure sample, Pa. Must be called once for each `step`, in order.
    fn error_pa(&mut self, step: u64, at: MonoNs) -> f64 {
        let Parameters { noise_pa, drift_pa, tau_s, .. } = self.parameters;
        let [white, wander] = self.stream.at(step).normal();
        if drift_pa > 0.0 {
            let kept = self.before.map_or(0.0, |before| math::exp(-at.since(before).as_secs_f64() / tau_s));
            self.drift = self.drift * kept + wander * math::sqrt((1.0 - kept * kept).max(0.0));
            self.before = Some(at);
        }
        self.offset_pa + noise_pa * white + drift_pa * self.drift
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    fn errors_pa(effects: &str) -> Vec<f64> {
        let run = |effects: &str| Bench::long(effects).run::<Pressure>("depth");
        run("").iter().zip(run(effects)).map(|(plain, with)| with.pressure_pa - plain.pressure_pa).collect()
    }

    #[test]
    fn depth_noise_is_white_with_the_given_sd() {
        let errors = errors_pa("[effects.depth_noise]\nnoise_pa = 300\n");
        let n = errors.len() as f64;
        assert!(n > 3000.0);
        let variance = errors.iter().map(|e| e * e).sum::<f64>() / n;
        assert!((variance / 9e4 - 1.0).abs() < 5.0 * math::sqrt(2.0 / n), "{variance}");
        let lagged = errors.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n;
        assert!(lagged.abs() < 5.0 * 9e4 / math::sqrt(n), "{lagged}");
    }

    /// Within a time t, a Gauss-Markov process with correlation time tau changes, and the mean square of the change is
    /// 2 sd^2 (1 - exp(-t / tau)).
    #[test]
    fn depth_drift_changes_at_the_given_rate() {
        let parameters = Parameters { noise_pa: 0.0, offset_sd_pa: 0.0, drift_pa: 100.0, tau_s: 20.0 };
        let stream = Stream::new(3, "depth_noise", "depth");
        let mut noise = DepthNoise { parameters, stream, offset_pa: 0.0, drift: 0.0, before: None };
        let times = (0..400_000_u64).map(|step| (step, MonoNs(1_000_000_000 + step * 100_000_000)));
        let drift: Vec<f64> = times.map(|(step, at)| noise.error_pa(step, at)).collect();
        for lag in [1_usize, 50, 200, 1000] {
            let pairs = drift.iter().zip(drift.iter().skip(lag));
            let found = pairs.map(|(a, b)| (b - a) * (b - a)).sum::<f64>() / (drift.len() - lag) as f64;
            let wanted = 2e4 * (1.0 - math::exp(-(lag as f64) * 0.1 / 20.0));
            // Stretches of the series that are two correlation times long are nearly independent. The series has 1,000
            // such stretches.
            assert!((found / wanted - 1.0).abs() < 5.0 * math::sqrt(2.0 / 1000.0), "{lag}: {found} {wanted}");
        }
    }

    /// Checks that the changes of the drift are independent of the noise.
    #[test]
    fn depth_noise_and_drift_are_independent() {
        let stream = Stream::new(3, "depth_noise", "depth");
        let series = |noise_pa: f64, drift_pa: f64| -> Vec<f64> {
            let parameters = Parameters { noise_pa, offset_sd_pa: 0.0, drift_pa, tau_s: 1.0 };
            let mut noise = DepthNoise { parameters, stream, offset_pa: 0.0, drift: 0.0, before: None };
            (1..20_000).map(|step| noise.error_pa(step, MonoNs(step * 1_000_000_000))).collect()
        };
        let (white, drift) = (series(1.0, 0.0), series(0.0, 1.0));
        let kept = math::exp(-1.0);
        let taken_up = drift.windows(2).map(|w| (w[1] - kept * w[0]) / math::sqrt(1.0 - kept * kept));
        let n = drift.len() as f64 - 1.0;
        let correlation = white.iter().skip(1).zip(taken_up).map(|(a, b)| a * b).sum::<f64>() / n;
        assert!(correlation.abs() < 5.0 / math::sqrt(n), "{correlation}");
    }

    #[test]
    fn depth_offsets_of_many_dives_are_normally_distributed_with_the_given_sd() {
        let offset_pa = |seed: u64| {
            let keys = "[effects.depth_noise]\noffset_sd_pa = 1000\n";
            let [plain, with] =
                ["", keys].map(|keys| Bench::turning(keys).seeded(seed).run::<Pressure>("depth")[0]);
            with.pressure_pa - plain.pressure_pa
        };
        let offsets: Vec<f64> = (0..200).map(offset_pa).collect();
        let n = offsets.len() as f64;
        let squares = offsets.iter().map(|pa| pa * pa / 1e6);
        let (second, fourth) = (squares.clone().sum::<f64>() / n, squares.map(|of| of * of).sum::<f64>() / n);
        assert!((second - 1.0).abs() < 5.0 * math::sqrt(2.0 / n), "{second}");
        // Standard normal values have a fourth moment of 3. Its estimate from n values has a variance of 96 / n.
        assert!((fourth - 3.0).abs() < 5.0 * math::sqrt(96.0 / n) && fourth > 1.5, "{fourth}");
    }

    #[test]
    fn depth_offset_is_constant_in_a_dive() {
        let errors = errors_pa("[effects.depth_noise]\noffset_sd_pa = 1000\n");
        assert!(errors[0] != 0.0 && errors.iter().all(|error| (error - errors[0]).abs() < 1e-6));
        same_in_any_slices(&Bench::turning("[effects.depth_noise]\nnoise_pa = 300\ndrift_pa = 100\n"));
        assert!(refusal("[effects.depth_noise]\n").contains("offset_sd_pa, drift_pa must not be zero"));
    }
}
