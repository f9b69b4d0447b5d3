//! Resolution step of a tether counter, recognised from its counts.
//!
//! A vehicle file may state a smaller step than the counter has, for instance the converter's step instead of the
//! wheel's. If a counter pauses between changes of its count, the smallest change is the step. If all changes are
//! multiples of one length, this length is the step.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;
use headrace_geometry::time::{DurNs, MonoNs};

/// Number of changes of the count per block. The larger of the steps found in the last two blocks is used, because a
/// garbled reading spoils only one block.
const BLOCK: u32 = 50;
/// Assumed step of a counter that has not moved yet, m; common steps are 0.5 mm to 1 cm.
const COMMON_STEP_M: f64 = 0.01;
/// Maximum number of readings that are assumed to share one rounding error.
const MOST_LOOKS: f64 = 50.0;

/// Detector of a tether counter's resolution step. Changes of the count are in units of the stated step.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CountStep {
    last_m: Option<f64>,
    /// Time of the last change of the count.
    changed: MonoNs,
    /// Smallest and largest change of the count in the present block, and the greatest common divisor of all its
    /// changes.
    smallest: u64,
    largest: u64,
    common: u64,
    /// `changes` counts the readings that differ from the reading before, and `unchanged` those that are equal to it.
    changes: u32,
    unchanged: u32,
    /// Steps found in the last two blocks that showed a step, in units of the stated step. 0 means none yet.
    blocks: [u64; 2],
}

impl CountStep {
    /// Processes a counter reading; `stated_m` is the step stated in the vehicle file, m.
    pub fn hear(&mut self, at: MonoNs, length_m: f64, stated_m: f64) {
        let Some(before_m) = self.last_m.replace(length_m) else {
            self.changed = at;
            return;
        };
        let change = math::round_to_i64((length_m - before_m) / stated_m).unsigned_abs();
        if change == 0 {
            self.unchanged = self.unchanged.saturating_add(1);
            return;
        }
        self.changed = at;
        self.smallest = if self.changes == 0 { change } else { self.smallest.min(change) };
        self.largest = self.largest.max(change);
        self.common = common_divisor(self.common, change);
        self.changes += 1;
        if self.changes == BLOCK {
            let [_, latest] = self.blocks;
            // Equal changes without pauses show a constant speed, but no step.
            if self.unchanged >= BLOCK / 5 {
                self.blocks = [latest, self.smallest];
            } else if self.smallest < self.largest {
                self.blocks = [latest, self.common];
            }
            *self =
                Self { last_m: self.last_m, changed: self.changed, blocks: self.blocks, ..Self::default() };
        }
    }

    /// Returns the counter's step, m: the stated step, or a larger one if the counts show it.
    pub fn step_m(&self, stated_m: f64) -> f64 {
        let [before, latest] = self.blocks;
        if before.max(latest) > 0 {
            return stated_m * before.max(latest) as f64;
        }
        // Until a block is full, the step is assumed to be the smallest change so far. Before the first change, it is
        // assumed to be a common step.
        match (self.changes, self.unchanged >= self.changes) {
            (0, _) => stated_m.max(COMMON_STEP_M),
            (_, true) => stated_m * self.smallest as f64,
            _ => stated_m,
        }
    }

    /// Returns how many readings share the rounding error of the present reading.
    ///
    /// All readings since the last change of the count share a rounding error. Readings also share it if the counter
    /// moves a whole number of steps between them. `period` is the time between two readings, and `way_m` the counter's
    /// movement in this time, m.
    pub fn looks_at_an_error(&self, at: MonoNs, period: DurNs, way_m: f64, step_m: f64) -> f64 {
        let stood = at.since(self.changed).as_secs_f64() / period.as_secs_f64();
        let steps = way_m / step_m;
        let phase = (steps - math::round_to_i64(steps) as f64).abs();
        (0.5 / phase.max(1e-6)).max(stood).clamp(1.0, MOST_LOOKS)
    }
}

/// Greatest common divisor by Euclid's algorithm; the divisor of 0 and a number is the number.
fn common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time of reading `k`, at 50 readings a second.
    fn at(k: u32) -> MonoNs {
        MonoNs(7_000_000_000 + 20_000_000 * u64::from(k))
    }

    /// Returns the counter step, m, that the detector recognises after 3000 readings of a wheel with the step
    /// `step_m`.
    ///
    /// `way_m` returns the distance that the cable has moved at a time, s. The wheel's counts are rounded to the
    /// stated step.
    fn recognised_m(step_m: f64, stated_m: f64, way_m: impl Fn(f64) -> f64) -> f64 {
        let mut step = CountStep::default();
        for k in 0..3000_u32 {
            let shown_m = math::floor_to_i64(way_m(f64::from(k) / 50.0) / step_m) as f64 * step_m;
            step.hear(at(k), math::round_to_i64(shown_m / stated_m) as f64 * stated_m, stated_m);
        }
        step.step_m(stated_m)
    }

    #[test]
    fn counter_step_larger_than_stated_is_recognised() {
        for step_m in [0.005, 0.01, 0.0123, 0.025, 0.05] {
            for speed_mps in [0.05, 0.1, 0.2] {
                let swaying = |t: f64| speed_mps * t + 0.1 * math::sin(0.3 * t);
                let found_m = recognised_m(step_m, 0.0005, swaying);
                assert!((found_m - step_m).abs() <= 0.000_51, "{step_m} at {speed_mps}: {found_m}");
            }
        }
        // Without pauses, a step is recognised if all changes are multiples of it.
        let found_m = recognised_m(0.01, 0.0005, |t| 2.0 * t + 1.7 * math::sin(0.7 * t));
        assert!((found_m - 0.01).abs() < 1e-9, "{found_m}");
    }

    #[test]
    fn recognised_counter_step_is_at_least_the_stated_step() {
        for speed_mps in [0.003, 0.2] {
            let found_m = recognised_m(0.0005, 0.0005, |t| speed_mps * t + 0.02 * math::sin(0.4 * t));
            assert!((found_m - 0.0005).abs() < 1e-12, "{speed_mps}: {found_m}");
        }
        assert!((recognised_m(0.0005, 0.02, |t| 0.2 * t) - 0.02).abs() < 1e-12, "the stated step is used");
        assert!(
            (recognised_m(0.01, 0.0005, |_| 3.0) - COMMON_STEP_M).abs() < 1e-12,
            "a stationary counter has the common step"
        );
    }

    #[test]
    fn one_garbled_reading_does_not_change_the_counter_step() {
        let mut step = CountStep::default();
        for k in 0..6000_u32 {
            let t = f64::from(k) / 50.0;
            let length_m = math::floor_to_i64(0.2 * t / 0.01) as f64 * 0.01;
            step.hear(at(k), if k == 3000 { length_m + 0.003 } else { length_m }, 0.0005);
        }
        assert!((step.step_m(0.0005) - 0.01).abs() < 1e-9, "{}", step.step_m(0.0005));
    }

    #[test]
    fn readings_at_equal_counts_or_whole_steps_apart_share_a_rounding_error() {
        let mut step = CountStep::default();
        let at = |t: f64| MonoNs(7_000_000_000) + DurNs::from_secs_f64(t);
        for k in 0..=20_u32 {
            let t = f64::from(k) / 10.0;
            step.hear(at(t), if t < 1.0 { 3.0 } else { 3.01 }, 0.01);
        }
        let period = DurNs(100_000_000);
        for (since_s, way_m, looks) in [
            (0.0, 0.005, 1.0),
            (0.0, 0.0025, 2.0),
            (0.0, 0.012, 2.5),
            (0.0, 0.01, 50.0),
            (0.0, 0.02, 50.0),
            (0.7, 0.005, 7.0),
            (0.7, 0.000_5, 10.0),
            (9.0, 0.005, 50.0),
        ] {
            let found = step.looks_at_an_error(at(1.0 + since_s), period, way_m, 0.01);
            assert!((found - looks).abs() < 1e-6, "{since_s} {way_m}: {found}");
        }
    }

    /// A common step is assumed before the first movement, and then the smallest change so far.
    #[test]
    fn counter_step_is_guessed_before_the_first_block_of_readings() {
        let mut step = CountStep::default();
        for k in 0..100 {
            step.hear(at(k), 3.0, 0.0005);
        }
        assert!((step.step_m(0.0005) - COMMON_STEP_M).abs() < 1e-12);
        assert!((step.step_m(0.05) - 0.05).abs() < 1e-12, "the stated step is used");
        step.hear(at(100), 3.048, 0.0005);
        assert!((step.step_m(0.0005) - 0.048).abs() < 1e-12);
        step.hear(at(101), 3.0485, 0.0005);
        assert!((step.step_m(0.0005) - 0.0005).abs() < 1e-12, "a finer step shows itself");
    }
}
