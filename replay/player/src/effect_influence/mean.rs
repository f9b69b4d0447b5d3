//! Computes a mean and its confidence interval.

use headrace_geometry::math;

/// A mean and the half-width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean.
    pub mean: f64,
    /// Half-width of the interval; infinite for a single value.
    pub half: f64,
}

/// Quantiles (97.5 %) of Student's t, for 1 to 30 degrees of freedom.
const T: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];
/// Quantile for more than 30 degrees of freedom, taken from the normal distribution.
const T_OF_MANY: f64 = 1.96;

impl Mean {
    /// Computes the mean of independent values, and its interval.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        let half = match values.len().checked_sub(2) {
            None => f64::INFINITY,
            Some(freedom) => {
                T.get(freedom).copied().unwrap_or(T_OF_MANY) * math::sqrt(squares / (n - 1.0) / n)
            }
        };
        Self { mean, half }
    }

    /// Returns the absolute value of the interval's end that is farther from zero.
    pub(super) fn farthest(&self) -> f64 {
        self.mean.abs() + self.half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's own example: hours of sleep gained by ten patients with two drugs (Biometrika 6, 1908).
    /// The expected interval was computed with R's t.test.
    #[test]
    fn confidence_interval_matches_student_example() {
        let gains = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let Mean { mean, half } = Mean::of(&gains);
        assert!((mean - 1.58).abs() < 1e-12, "{mean}");
        assert!(
            (mean - half - 0.700_114_2).abs() < 2e-4 && (mean + half - 2.459_885_8).abs() < 2e-4,
            "{half}"
        );
        assert!(Mean::of(&[3.0]).half.is_infinite() && Mean::of(&[3.0, 3.0]).half == 0.0);
    }
}
