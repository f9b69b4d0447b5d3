//! Level of a source's white noise relative to what is declared, learnt from its innovations.
//!
//! The innovations of a filter that is right are white: half the mean square of the difference of two is their variance. What
//! drifts more slowly, an error of the estimate or a bias, cancels in it. Derivation: `docs/why/navigation.md`, "Noise that is learnt".

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_sensor::device::SensorKind;

/// Change of the level's logarithm by a measurement whose normalised square is off by one.
const GAIN: f64 = 0.01;
/// Largest normalised square that counts: one outlier is no noise.
const MOST: f64 = 9.0;
/// Least share of a head's declared variance: counts of 2 cm and noise of 1 cm of the 3 cm that are declared for a rough wall.
const LEAST_OF_HEAD: f64 = 0.15;
/// Largest square of an innovation that isn't used, as a share of the declared variance: rocks and strays aren't the wall, and a wall that is built
/// otherwise has many of them.
const MOST_UNUSED: f64 = 2.0;
/// Measurements of which the mean is taken, and the fewest that say anything.
const MEMORY: u32 = 200;
const FEW: u32 = 30;
/// Returns of a head's turn that are used, one every three degrees: fewer haven't seen all of the wall.
const TURN: u32 = 120;
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
    /// Running mean of their squares beyond what the estimate explains, as a share of the declared variance.
    share: f64,
    /// The same of the last few: where the wall begins to be otherwise.
    latest: f64,
}

impl Default for NoiseLevel {
    fn default() -> Self {
        Self { last: [None; 3], factor: 1.0, nis: 0.0, seen: 0, share: 1.0, latest: 1.0 }
    }
}

/// Limits of the level, as factors of the declared variance; `None` where it isn't learnt.
///
/// An inertial unit's tilt is declared for its slow errors, which no difference shows; a head's range for the wall's bumps and shape as well, which a
/// beam that leans would take for a yaw: differences only raise it, and what lowers it is the square of all that it is off ([`NoiseLevel::smoothness`]).
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

    /// Notes the square of an innovation beyond what the estimate explains, as a share of the declared variance.
    pub fn note_share(&mut self, share: f64, is_used: bool) {
        let most = if is_used { MOST } else { MOST_UNUSED };
        let share = share.clamp(-most, most);
        self.share += (share - self.share) / f64::from(self.seen.clamp(1, MEMORY));
        self.latest += (share - self.latest) / f64::from(self.seen.clamp(1, FEW));
    }

    /// Share of its declared noise that a source has had lately: 0 to 1, the most until some measurements have been seen.
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

    /// Factor, 1 at most, of the variance of a head's range that meets the wall squarely: the share that such innovations show, once a turn of
    /// them is known, of the last few if that is more. Where the wall isn't as designed, they are large whether it is rough or bent. `None` of
    /// a head that hasn't measured anything.
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

    /// The level after so many measurements of a head, each by so much of its declared deviation off.
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
    fn a_head_before_a_smooth_wall_is_believed_as_it_shows_itself_after_a_turn() {
        near(level(119, |k| 0.5 * math::sin(f64::from(k)), true).smoothness().unwrap(), 1.0);
        near(level(2000, alternating(0.5), true).share(), 0.25);
        near(
            level(2000, |k| 0.5 * math::sqrt(2.0) * math::sin(f64::from(k)), true).smoothness().unwrap(),
            0.25,
        );
        // Never below what its counts and its noise leave.
        near(level(2000, alternating(0.01), true).smoothness().unwrap(), 0.15);
    }

    /// Of a wall that is built otherwise neighbouring ranges are off alike, so that differences show nothing.
    #[test]
    fn a_wall_of_another_shape_is_no_smooth_one() {
        near(level(2000, |_| 1.0, true).smoothness().unwrap(), 1.0);
        near(level(2000, |_| 3.0, true).smoothness().unwrap(), 1.0);
        near(level(2000, |k| math::sin(f64::from(k) / 40.0), true).smoothness().unwrap(), 0.5);
    }

    /// What isn't used says that the wall is otherwise, and one stray in twenty hardly does.
    #[test]
    fn what_is_not_used_counts_a_little() {
        near(level(2000, |_| 9.0, false).share(), 1.0);
        let mut one = level(1000, alternating(0.5), true);
        for k in 0..200 {
            one.note_share(if k % 20 == 0 { 100.0 } else { 0.25 }, k % 20 != 0);
        }
        assert!((0.26..0.4).contains(&one.share()), "{}", one.share());
    }

    /// A head that has become noisy is believed less than declared, and no other source is taken for a head.
    #[test]
    fn a_noisy_head_is_believed_less_and_others_by_their_differences_alone() {
        let noisy = level(4000, alternating(2.0), true);
        assert!((3.0..9.1).contains(&noisy.factor(HEAD, 0)), "{}", noisy.factor(HEAD, 0));
        let quiet = level(2000, |k| 0.5 * math::sin(f64::from(k)), true);
        near(quiet.factor(SensorKind::Depth, 0), 1.0);
        near(quiet.factor(SensorKind::Imu, 0), 1.0);
    }
}
