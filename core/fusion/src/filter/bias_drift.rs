//! Drift of inertial biases that exceeds the declared drift. It is learnt from corrections of the biases.
//!
//! A measurement corrects a bias by its gain times the innovation. The expected square of this correction is the gain
//! squared times the innovation's variance. If the squared corrections are larger than expected, the bias drifts more
//! than the filter assumes. Derivation: `docs/why/navigation.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use super::settings::{GaussMarkov, Settings};
use headrace_geometry::math;

/// Averaging time of the ratio of squared corrections to expected squares, s.
const MEMORY_S: f64 = 10.0;
/// Mean ratio of squared corrections to expected squares above which the process noise is raised. Each second, the
/// noise is then multiplied by this ratio to the power `RAISES_PER_S`.
const TOO_LARGE: f64 = 1.1;
const RAISES_PER_S: f64 = 2.0;
/// Mean ratio below which a raised process noise decays. `FALLS_OVER_S` is the time constant of the decay, s.
const SMALL: f64 = 0.7;
const FALLS_OVER_S: f64 = 20.0;
/// Initial noise factor: biases of an inertial unit are assumed to drift fast until its readings show otherwise.
const AT_FIRST: f64 = 1e3;
/// Random walks of the gyro bias (`MOST_RATE`) and the accelerometer bias in the worst supported inertial unit, per
/// root of a second. In 300 s, they add up to 0.3 degrees/s and 50 mm/s^2.
const MOST_RATE: f64 = 4.3e-4;
const MOST_FORCE: f64 = 4.1e-3;

/// Learnt factors that multiply the process noise of gyro and accelerometer biases.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BiasDrift([Ratio; 2]);

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Ratio {
    /// Decaying sums: `corrected` of the squared corrections, `expected` of the squares that the filter expects.
    corrected: f64,
    expected: f64,
    factor: f64,
}

impl Default for BiasDrift {
    fn default() -> Self {
        Self([Ratio { corrected: 0.0, expected: 0.0, factor: AT_FIRST }; 2])
    }
}

/// Returns the largest noise factor of a bias. With this factor, the bias drifts as fast as in the worst supported
/// unit.
fn most(wander: GaussMarkov, worst: f64) -> f64 {
    let density = wander.density();
    (worst * worst / density).max(1.0)
}

impl BiasDrift {
    /// Records how a measurement has corrected the biases.
    ///
    /// `covariances` are those of gyro and accelerometer biases with the innovation. `variance` is the innovation's
    /// variance, and `nis` the normalised squared innovation.
    pub fn note(&mut self, covariances: [[f64; 3]; 2], variance: f64, nis: f64) {
        for (ratio, covariances) in self.0.iter_mut().zip(covariances) {
            // The expected square is (c / s)^2 s, summed over the axes. c is the covariance of a bias with the
            // innovation, and s is the innovation's variance.
            let expected = covariances.iter().map(|c| c * c).sum::<f64>() / variance;
            ratio.expected += expected;
            ratio.corrected += expected * nis;
        }
    }

    /// Adapts the noise factors after an epoch of length `dt_s`.
    pub fn pass(&mut self, dt_s: f64, settings: &Settings) {
        let limits = [most(settings.rate_bias, MOST_RATE), most(settings.force_bias, MOST_FORCE)];
        for (ratio, most) in self.0.iter_mut().zip(limits) {
            let mean = if ratio.expected > 0.0 { ratio.corrected / ratio.expected } else { 1.0 };
            if mean > TOO_LARGE {
                ratio.factor *= math::exp(RAISES_PER_S * dt_s * math::ln(mean));
            } else if mean < SMALL {
                ratio.factor *= math::exp(-dt_s / FALLS_OVER_S);
            }
            ratio.factor = ratio.factor.clamp(1.0, most);
            let left = math::exp(-dt_s / MEMORY_S);
            ratio.corrected *= left;
            ratio.expected *= left;
        }
    }

    /// Factors of the process noise of gyro and accelerometer biases, at least 1.
    pub fn factors(&self) -> [f64; 2] {
        self.0.map(|ratio| ratio.factor)
    }
}
