//! Mean, standard deviation and maximum of unsigned distances.

use headrace_core::math;

/// How unsigned distances are spread, m.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Spread {
    /// How many.
    pub count: usize,
    /// Mean, m; 0 without any.
    pub mean_m: f64,
    /// Standard deviation of the population, m.
    pub sd_m: f64,
    /// The largest, m.
    pub max_m: f64,
}

impl Spread {
    /// Of the absolute values of `distances_m`, summed in the order given; those that are no number are left out.
    pub fn of(distances_m: impl IntoIterator<Item = f64>) -> Self {
        let (mut count, mut mean, mut squares, mut max) = (0_usize, 0.0, 0.0, 0.0_f64);
        // Welford's updates: a sum of squares would lose the spread of distances that are nearly equal.
        for distance in distances_m.into_iter().map(f64::abs).filter(|d| d.is_finite()) {
            count += 1;
            let step = distance - mean;
            mean += step / count as f64;
            squares += step * (distance - mean);
            max = max.max(distance);
        }
        let variance = if count == 0 { 0.0 } else { squares / count as f64 };
        Self { count, mean_m: mean, sd_m: math::sqrt(variance), max_m: max }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_are_dropped_and_numbers_kept() {
        let spread = Spread::of([1.0, -3.0, f64::NAN, f64::INFINITY]);
        assert_eq!(spread, Spread { count: 2, mean_m: 2.0, sd_m: 1.0, max_m: 3.0 });
        assert_eq!(Spread::of([]), Spread::default());
    }

    #[test]
    fn nearly_equal_distances_keep_their_spread() {
        let spread = Spread::of((0..1000).map(|k| 1e6 + f64::from(k % 2) * 1e-3));
        assert!((spread.sd_m - 5e-4).abs() < 1e-8, "{spread:?}");
    }
}
