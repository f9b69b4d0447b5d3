//! Level of a source's white noise relative to the declared noise, learnt from innovations.
//!
//! The innovations of a correct filter are white. So their variance is half the mean square of the difference between
//! two successive innovations. Biases and slow errors of the estimate cancel in this difference. Derivation:
//! `docs/why/navigation.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_sensor::device::SensorKind;

/// Gain of the learning. Each normalised squared difference minus 1, times this gain, is added to the natural logarithm
/// of the noise level.
const GAIN: f64 = 0.01;
/// Squared normalised innovations are clipped at this limit, because one outlier does not show the noise.
const MOST: f64 = 9.0;
/// Smallest share of a head's declared range variance that may be learnt.
///
/// The declared sd of 3 cm suits a rough wall. On a smooth wall, a range step of 2 cm and sensor noise of 1 cm still
/// cause this share of the variance.
const LEAST_OF_HEAD: f64 = 0.15;
/// Multiple of the declared variance at which the square of a rejected innovation is clipped.
///
/// Rejected innovations come from rocks and stray echoes, so a single one shows nothing. But if the wall differs from
/// its design, many are rejected.
const MOST_UNUSED: f64 = 2.0;
/// Number of measurements in the running mean (`MEMORY`), and number after which the mean is used (`FEW`).
const MEMORY: u32 = 200;
const FEW: u32 = 30;
/// Number of used returns in a turn of a head, one every three degrees. After fewer returns, the head has not seen all
/// of the wall.
const TURN: u32 = 120;
/// Mean normalised square above which innovations are too large to be noise.
const UNUSUAL: f64 = 1.8;

/// Learnt noise level of a source.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct NoiseLevel {
    /// Last innovation of each scalar component of a reading.
    last: [Option<f64>; 3],
    /// Learnt factor by which the declared variance is multiplied.
    factor: f64,
    /// Running mean of all squared normalised innovations, and the number of innovations in this mean.
    nis: f64,
    seen: u32,
    /// Running mean of squared innovations minus the estimate's variance, as a share of the declared variance.
    share: f64,
    /// The same as `share`, but over the last few measurements, so that it shows changes of the wall.
    latest: f64,
}

impl Default for NoiseLevel {
    fn default() -> Self {
        Self { last: [None; 3], factor: 1.0, nis: 0.0, seen: 0, share: 1.0, latest: 1.0 }
    }
}

/// Returns the limits of the noise level, as factors of the declared variance; `None` if the level is not learnt.
///
/// The declared tilt noise of an inertial unit covers its slow errors, which differences between successive innovations
/// do not show. The declared range noise of a head also covers bumps and the shape of the wall. With less noise, the
/// filter could mistake bumps for yaw if beams lean. So differences of innovations can only raise a head's level. A
/// lower level comes only from the squares of the innovations themselves ([`NoiseLevel::smoothness`]).
fn limits(kind: SensorKind, scalar: usize) -> Option<[f64; 2]> {
    match kind {
        SensorKind::Head => Some([1.0, 9.0]),
        SensorKind::Echosounder { .. } => Some([0.02, 9.0]),
        SensorKind::Tether { .. } => Some([0.04, 4.0]),
        SensorKind::Depth => Some([0.02, 4.0]),
        SensorKind::Imu if scalar == 2 => Some([0.02, 4.0]),
        SensorKind::Imu | SensorKind::VelocityLog | SensorKind::Other => None,
    }
}

impl NoiseLevel {
    /// Processes an innovation of a fused measurement, and the innovation's variance. `scalar` is the measurement's
    /// index within the reading.
    pub fn note(&mut self, kind: SensorKind, scalar: usize, innovation: f64, variance: f64) {
        let Some(before) = self.last.get_mut(scalar).and_then(|last| last.replace(innovation)) else {
            return;
        };
        let Some([least, most]) = limits(kind, scalar).filter(|_| self.seen >= FEW) else { return };
        let difference = innovation - before;
        let white = (difference * difference / (2.0 * variance)).min(MOST);
        self.factor = (self.factor * math::exp(GAIN * (white - 1.0))).clamp(least, most);
    }

    /// Processes the squared normalised innovation of any measurement, whether fused or rejected.
    ///
    /// Returns the square divided by the mean of earlier squares. A mean below its expected value of 1 counts as 1.
    pub fn relative(&mut self, nis: f64) -> f64 {
        let usual = if self.seen >= FEW { self.nis.max(1.0) } else { 1.0 };
        self.seen = (self.seen + 1).min(MEMORY);
        self.nis += (nis - self.nis) / f64::from(self.seen);
        nis / usual
    }

    /// Processes a squared innovation minus the estimate's variance, as a share of the declared variance.
    pub fn note_share(&mut self, share: f64, is_used: bool) {
        let most = if is_used { MOST } else { MOST_UNUSED };
        let share = share.clamp(-most, most);
        self.share += (share - self.share) / f64::from(self.seen.clamp(1, MEMORY));
        self.latest += (share - self.latest) / f64::from(self.seen.clamp(1, FEW));
    }

    /// Returns the recently observed share of the declared variance, 0 to 1; 1 until there are enough measurements.
    pub fn share(&self) -> f64 {
        if self.seen >= FEW { self.share.clamp(0.0, 1.0) } else { 1.0 }
    }

    /// Whether innovations have about their expected size. Innovations of ranges are larger if the wall differs from
    /// its design.
    pub fn is_usual(&self) -> bool {
        self.nis < UNUSUAL
    }

    /// Records that a measurement of this scalar was not fused. Then the next innovation is not compared with the one
    /// before it.
    pub fn skip(&mut self, scalar: usize) {
        if let Some(last) = self.last.get_mut(scalar) {
            *last = None;
        }
    }

    /// Returns the factor by which to multiply the declared variance; 1 if the noise level is not learnt.
    pub fn factor(&self, kind: SensorKind, scalar: usize) -> f64 {
        limits(kind, scalar).map_or(1.0, |_| self.factor)
    }

    /// Returns the variance factor, at most 1, for a head's ranges whose beams meet the wall squarely.
    ///
    /// It is the learnt share of the declared variance: the larger of its mean over many measurements and its mean over
    /// the last few. It is large if the wall differs from its design in roughness or shape. It is 1 until a whole turn
    /// has been measured. `None` for a head without measurements.
    pub fn smoothness(&self) -> Option<f64> {
        let is_known = self.seen >= TURN;
        (self.seen > 0)
            .then(|| if is_known { self.share.max(self.latest).clamp(LEAST_OF_HEAD, 1.0) } else { 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: SensorKind = SensorKind::Head;

    /// Returns the noise level after `count` measurements; `off` gives the innovation of each, in declared standard
    /// deviations.
    fn level(count: u32, off: impl Fn(u32) -> f64, is_used: bool) -> NoiseLevel {
        let mut level = NoiseLevel::default();
        for k in 0..count {
            let (innovation, factor) = (off(k), level.factor(HEAD, 0) * level.smoothness().unwrap_or(1.0));
            level.note_share(innovation * innovation, is_used);
            _ = level.relative(innovation * innovation / factor);
            if is_used {
                level.note(HEAD, 0, innovation, factor);
            }
        }
        level
    }

    fn alternating(size: f64) -> impl Fn(u32) -> f64 {
        move |k| if k.is_multiple_of(2) { size } else { -size }
    }

    fn near(is: f64, should: f64) {
        assert!((is - should).abs() < 0.06 * should, "{is}, not {should}");
    }

    #[test]
    fn smooth_wall_lowers_the_noise_of_a_head_after_one_turn() {
        near(level(119, |k| 0.5 * math::sin(f64::from(k)), true).smoothness().unwrap(), 1.0);
        near(level(2000, alternating(0.5), true).share(), 0.25);
        near(
            level(2000, |k| 0.5 * math::sqrt(2.0) * math::sin(f64::from(k)), true).smoothness().unwrap(),
            0.25,
        );
        // The factor is never smaller than the share that range steps and sensor noise cause.
        near(level(2000, alternating(0.01), true).smoothness().unwrap(), 0.15);
    }

    /// If the wall differs from its design, neighbouring ranges have about equal errors. So their differences show
    /// nothing.
    #[test]
    fn wall_that_differs_from_its_design_is_not_smooth() {
        near(level(2000, |_| 1.0, true).smoothness().unwrap(), 1.0);
        near(level(2000, |_| 3.0, true).smoothness().unwrap(), 1.0);
        near(level(2000, |k| math::sin(f64::from(k) / 40.0), true).smoothness().unwrap(), 0.5);
    }

    /// Rejected innovations show that the wall differs from its design. One stray echo in twenty changes little.
    #[test]
    fn rejected_innovations_have_limited_weight_in_the_noise_level() {
        near(level(2000, |_| 9.0, false).share(), 1.0);
        let mut one = level(1000, alternating(0.5), true);
        for k in 0..200 {
            one.note_share(if k % 20 == 0 { 100.0 } else { 0.25 }, k % 20 != 0);
        }
        assert!((0.26..0.4).contains(&one.share()), "{}", one.share());
    }

    /// A head that has become noisy gets less weight than declared. A quiet source other than a head is not
    /// affected.
    #[test]
    fn noisy_head_loses_weight_but_quiet_other_sources_do_not() {
        let noisy = level(4000, alternating(2.0), true);
        assert!((3.0..9.1).contains(&noisy.factor(HEAD, 0)), "{}", noisy.factor(HEAD, 0));
        let quiet = level(2000, |k| 0.5 * math::sin(f64::from(k)), true);
        near(quiet.factor(SensorKind::Depth, 0), 1.0);
        near(quiet.factor(SensorKind::Imu, 0), 1.0);
    }
}
