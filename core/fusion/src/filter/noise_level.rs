//! Level of a source's white noise relative to what is declared, learnt from its innovations.
//!
//! The innovations of a filter that is right are white: half the mean square of the difference of two is their variance. What
//! drifts more slowly, an error of the estimate or a bias, cancels in it. Derivation: `docs/fusion.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_sensor::device::SensorKind;

/// Change of the level's logarithm by a measurement whose normalised square is off by one.
const GAIN: f64 = 0.01;
/// Largest normalised square that counts: one outlier is no noise.
const MOST: f64 = 9.0;
/// Measurements of which the mean is taken, and the fewest that say anything.
const MEMORY: u32 = 200;
const FEW: u32 = 30;
/// Mean normalised square from which innovations are larger than noise explains.
const UNUSUAL: f64 = 1.8;

/// See the module's description.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoiseLevel {
    /// The last innovation of each scalar of a reading.
    last: [Option<f64>; 3],
    /// Factor of the declared variance.
    factor: f64,
    /// Running mean of the normalised squares of all innovations, and how many it has seen.
    nis: f64,
    seen: u32,
    /// Running mean of the squares of those used beyond what the estimate explains, as a share of the noise.
    share: f64,
}

impl Default for NoiseLevel {
    fn default() -> Self {
        Self { last: [None; 3], factor: 1.0, nis: 0.0, seen: 0, share: 1.0 }
    }
}

/// Limits of the level, as factors of the declared variance; `None` where it isn't learnt.
///
/// An inertial unit's tilt is declared for its slow errors, which no difference shows; a head's range for those of the wall's
/// shape, which a beam that leans would take for a yaw.
fn limits(kind: SensorKind, scalar: usize) -> Option<[f64; 2]> {
    match kind {
        SensorKind::Head => Some([1.0, 9.0]),
        SensorKind::Echosounder { .. } => Some([0.02, 9.0]),
        SensorKind::Tether { .. } => Some([0.04, 4.0]),
        SensorKind::Depth | SensorKind::VelocityLog => Some([0.02, 4.0]),
        SensorKind::Imu if scalar == 2 => Some([0.02, 4.0]),
        SensorKind::Imu | SensorKind::Other => None,
    }
}

impl NoiseLevel {
    /// Notes an innovation of the reading's scalar of this number, and its variance.
    pub fn note(&mut self, kind: SensorKind, scalar: usize, innovation: f64, variance: f64) {
        let Some(before) = self.last.get_mut(scalar).and_then(|last| last.replace(innovation)) else {
            return;
        };
        let Some([least, most]) = limits(kind, scalar).filter(|_| self.seen >= FEW) else { return };
        let difference = innovation - before;
        let white = (difference * difference / (2.0 * variance)).min(MOST);
        self.factor = (self.factor * math::exp(GAIN * (white - 1.0))).clamp(least, most);
    }

    /// Notes the normalised square of any innovation, used or not; returns it relative to the mean of those before, where that is
    /// above what it should be.
    pub fn relative(&mut self, nis: f64) -> f64 {
        let usual = if self.seen >= FEW { self.nis.max(1.0) } else { 1.0 };
        self.seen = (self.seen + 1).min(MEMORY);
        self.nis += (nis - self.nis) / f64::from(self.seen);
        nis / usual
    }

    /// Notes the square of an innovation that is used beyond what the estimate explains, as a share of the noise.
    pub fn note_share(&mut self, share: f64) {
        self.share += (share.clamp(-MOST, MOST) - self.share) / f64::from(self.seen.clamp(1, MEMORY));
    }

    /// Share of its noise that a source has had lately: 0 to 1, the most until some measurements have been seen.
    pub fn share(&self) -> f64 {
        if self.seen >= FEW { self.share.clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Whether innovations are about as large as they should be. Of ranges they are larger where the wall isn't as designed.
    pub fn is_usual(&self) -> bool {
        self.nis < UNUSUAL
    }

    /// Notes that a measurement of this scalar wasn't used: the next difference would span it.
    pub fn skip(&mut self, scalar: usize) {
        if let Some(last) = self.last.get_mut(scalar) {
            *last = None;
        }
    }

    /// Factor of the declared variance, 1 where it isn't learnt.
    pub fn factor(&self, kind: SensorKind, scalar: usize) -> f64 {
        limits(kind, scalar).map_or(1.0, |_| self.factor)
    }
}
