//! Detection of a sonar that reports the same range in every direction. It may repeat the range of its last echo, or
//! report the range to its own frame.

use serde::{Deserialize, Serialize};

/// Ranges that differ by less than this count as equal, m.
///
/// The limit is finer than a profiling sonar's resolution, so the noise of ranges to a real wall exceeds it.
const SAME_M: f64 = 0.002;

/// Successive returns with the same range, and how much the range expected from the design has varied meanwhile.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ConstantRange {
    returns: u32,
    range_m: f64,
    /// Smallest and largest difference between a return's range and its design range since the range became constant,
    /// m.
    off_m: [f64; 2],
}

impl ConstantRange {
    /// Adds a return, given by its range and by its range minus the design range, m.
    pub fn note(&mut self, range_m: f64, off_m: f64) {
        if self.returns == 0 || (range_m - self.range_m).abs() > SAME_M {
            *self = Self { returns: 1, range_m, off_m: [off_m; 2] };
        } else {
            let [least_m, most_m] = self.off_m;
            self.returns = self.returns.saturating_add(1);
            self.off_m = [least_m.min(off_m), most_m.max(off_m)];
        }
    }

    /// Whether at least `fewest` successive returns have had the same range, while the design range has varied by more
    /// than `varies_m`.
    ///
    /// Ranges to a real wall vary with the design range, so equal ranges show a stuck sensor.
    pub fn is_stuck(&self, fewest: u32, varies_m: f64) -> bool {
        self.returns >= fewest && self.off_m[1] - self.off_m[0] > varies_m
    }

    /// Whether any return has been recorded.
    pub fn is_heard(&self) -> bool {
        self.returns > 0
    }

    /// Whether the range of the last return differs from the range before it, so a new series of equal ranges begins.
    pub fn is_new(&self) -> bool {
        self.returns == 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(ranges: impl IntoIterator<Item = (f64, f64)>) -> ConstantRange {
        let mut one = ConstantRange::default();
        ranges.into_iter().for_each(|(range_m, design_m)| one.note(range_m, range_m - design_m));
        one
    }

    #[test]
    fn constant_range_at_a_receding_wall_counts_as_stuck() {
        let wall_m = |k: u32| 5.0 + 0.02 * f64::from(k);
        let mut stuck = after((0..8).map(|k| (5.0, wall_m(k))));
        assert!(stuck.is_stuck(8, 0.1) && !stuck.is_stuck(9, 0.1) && !stuck.is_stuck(8, 0.2));
        stuck.note(5.16, 0.0);
        assert!(!stuck.is_stuck(1, 0.0) && stuck.is_new());
    }

    #[test]
    fn range_that_varies_or_is_constant_by_design_is_not_stuck() {
        assert!(!after((0..1000).map(|_| (1.0, 1.0))).is_stuck(8, 0.05));
        assert!(!after((0..1000).map(|k| (1.0 + 0.003 * f64::from(k), 1.0))).is_stuck(2, 0.05));
    }
}
