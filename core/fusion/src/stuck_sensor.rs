//! Detection of a stuck inertial unit, which repeats its last reading.
//!
//! A noisy reading hardly ever equals the one before to the last bit. But readings without noise, as in ideal simulated
//! dives, repeat whenever the motion is steady. For them, repetition is no evidence.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Sensor, Vec3};
use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};

/// Minimum duration of identical readings before the inertial unit counts as stuck.
const HANGS_AFTER: DurNs = DurNs(500_000_000);
/// Natural logarithm of the largest probability that the readings repeat by chance: one in a billion.
const BY_CHANCE_LN: f64 = -20.7;
/// Weight of the newest value in the running means of sign reversals and of the lengths of series.
const LATEST: f64 = 1.0 / 64.0;
/// Share of successive differences that reverse their sign above which readings count as noisy.
///
/// White noise reverses the sign of two thirds of the differences. A motion reverses hardly any.
const NOISY: f64 = 0.3;

/// Statistics of repeated readings of one sensor; part of the loop's saved state.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct StuckSensor {
    last: Option<[f64; 3]>,
    /// Last non-zero difference between successive readings, by axis.
    steps: [f64; 3],
    /// Share of differences whose sign is opposite to that of the previous difference, from 0 to 1.
    to_and_fro: f64,
    /// Mean length of a series of identical readings (`usual_run`), and length of the present series (`run`), in
    /// readings.
    usual_run: f64,
    run: u32,
    /// Start time of the present series of identical readings.
    since: MonoNs,
}

impl StuckSensor {
    /// Processes a turn rate; returns whether the inertial unit counts as stuck now.
    ///
    /// Allocates: never.
    pub fn hangs(&mut self, at: MonoNs, rate_radps: Vec3<Sensor>) -> bool {
        let now = [rate_radps.x(), rate_radps.y(), rate_radps.z()];
        let Some(before) = self.last.replace(now) else {
            (self.since, self.run) = (at, 1);
            return false;
        };
        // Readings are compared bit by bit, because a stuck unit repeats its bytes.
        if now.map(f64::to_bits) == before.map(f64::to_bits) {
            self.run = self.run.saturating_add(1);
            return self.has_hung(at);
        }
        self.usual_run += LATEST * (f64::from(self.run) - self.usual_run);
        (self.since, self.run) = (at, 1);
        for ((now, before), step) in now.into_iter().zip(before).zip(&mut self.steps) {
            let next = now - before;
            if next.to_bits() << 1 == 0 {
                continue;
            }
            let against = f64::from(u8::from(next * *step < 0.0));
            self.to_and_fro += LATEST / 3.0 * (against - self.to_and_fro);
            *step = next;
        }
        false
    }

    fn has_hung(&self, at: MonoNs) -> bool {
        let is_long = at.since(self.since).0 >= HANGS_AFTER.0;
        // If a reading equals the one before with the probability p, a series has a mean length of 1 / (1 - p).
        let repeats = 1.0 - 1.0 / self.usual_run.max(1.01);
        is_long && self.to_and_fro > NOISY && f64::from(self.run) * math::ln(repeats) < BY_CHANCE_LN
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Processes readings at 400 Hz; returns for each reading whether the inertial unit counts as stuck.
    fn hangs(readings: impl IntoIterator<Item = [f64; 3]>) -> Vec<bool> {
        let mut repeats = StuckSensor::default();
        let mut of =
            |(k, [x, y, z]): (u64, [f64; 3])| repeats.hangs(MonoNs(k * 2_500_000), Vec3::new(x, y, z));
        (0..).zip(readings).map(&mut of).collect()
    }

    /// Returns a pseudorandom number from -1 to 1 (splitmix64).
    fn noise(k: u64) -> f64 {
        let mut z = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn noisy(k: u64) -> [f64; 3] {
        [0, 1, 2].map(|axis| 1e-3 * noise(3 * k + axis))
    }

    #[test]
    fn noisy_inertial_unit_with_constant_reading_counts_as_stuck_after_0_5_s() {
        let frozen = noisy(999);
        let all = hangs(
            (0..1000).map(noisy).chain(std::iter::repeat_n(frozen, 1000)).chain((2000..2100).map(noisy)),
        );
        let first = all.iter().position(|hangs| *hangs).unwrap();
        assert_eq!(first, 999 + 200);
        assert!(all[first..2000].iter().all(|hangs| *hangs) && all[2000..].iter().all(|hangs| !hangs));
    }

    /// The simulator's ideal units repeat a reading while the motion is steady, and send another one as soon as the
    /// motion changes.
    #[test]
    fn noise_free_inertial_unit_never_counts_as_stuck() {
        let swaying = |k: u64| [1e-2 * math::sin(k as f64 / 800.0), 0.0, 2e-2 * math::cos(k as f64 / 1700.0)];
        let still = [0.0; 3];
        let all = (0..4000)
            .map(swaying)
            .chain(std::iter::repeat_n(still, 8000))
            .chain((0..4000).map(swaying))
            .chain(std::iter::repeat_n(still, 8000));
        assert!(hangs(all).iter().all(|hangs| !hangs));
    }

    /// A coarsely quantised unit at rest repeats each reading for a while. The coarser the unit, the longer it takes to
    /// detect that it is stuck.
    #[test]
    fn coarsely_quantised_inertial_unit_at_rest_does_not_count_as_stuck() {
        // About one reading in 200 differs, and all others are equal. So series of three to 2000 equal readings are
        // normal, and do not show a stuck unit.
        let coarse = |k: u64| {
            let step = if noise(k) > 0.99 { 1e-3 * noise(7 * k).signum() } else { 0.0 };
            [step, 0.0, 0.0]
        };
        assert!(hangs((0..200_000).map(coarse)).iter().all(|hangs| !hangs));
    }
}
