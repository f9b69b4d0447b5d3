//! Mean, standard deviation, least and largest of absolute lengths.

use headrace_geometry::math;
use serde::Serialize;

/// Statistics of absolute lengths, m; all zero if there are no lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(crate) struct Spread {
    /// Number of lengths.
    pub count: usize,
    /// Mean of the lengths, m.
    pub mean_m: f64,
    /// Population standard deviation of the lengths, m.
    pub sd_m: f64,
    /// The least length, m.
    pub min_m: f64,
    /// The largest length, m.
    pub max_m: f64,
}

impl Spread {
    /// Statistics of the absolute values of `lengths_m`, summed in the given order; non-finite values are ignored.
    pub(crate) fn of(lengths_m: impl IntoIterator<Item = f64>) -> Self {
        let (mut mean, mut squares) = (0.0, 0.0);
        let mut spread = Self { min_m: f64::INFINITY, ..Self::default() };
        // Welford's update is used, because a sum of squares loses the spread of nearly equal lengths.
        for length in lengths_m.into_iter().map(f64::abs).filter(|length| length.is_finite()) {
            spread.count += 1;
            let step = length - mean;
            mean += step / spread.count as f64;
            squares += step * (length - mean);
            (spread.min_m, spread.max_m) = (spread.min_m.min(length), spread.max_m.max(length));
        }
        if spread.count == 0 {
            return Self::default();
        }
        Self { mean_m: mean, sd_m: math::sqrt(squares / spread.count as f64), ..spread }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_non_finite_lengths_are_ignored() {
        let spread = Spread::of([1.0, -3.0, f64::NAN, f64::INFINITY]);
        assert_eq!(spread, Spread { count: 2, mean_m: 2.0, sd_m: 1.0, min_m: 1.0, max_m: 3.0 });
        assert_eq!(Spread::of([]), Spread::default());
    }

    #[test]
    fn nearly_equal_distances_keep_their_spread() {
        let spread = Spread::of((0..1000).map(|k| 1e6 + f64::from(k % 2) * 1e-3));
        assert!((spread.sd_m - 5e-4).abs() < 1e-8, "{spread:?}");
    }
}
