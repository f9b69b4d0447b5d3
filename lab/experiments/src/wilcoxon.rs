//! The paired Wilcoxon signed-rank test.
//!
//! Differences are ranked by size, and ties share their mean rank. W+ is the sum of the ranks of positive differences.
//! Zero differences are dropped before ranking (Wilcoxon), or ranked and then dropped (Pratt). Pratt's method preserves
//! the effect of zeros on the other ranks. Without ties and zeros, and for up to 50 pairs, p is exact. Otherwise p
//! comes from a normal distribution that has W+'s mean and variance for the given ranks.
//!
//! Source: Wilcoxon 1945; Pratt 1959. The paper's §8.1 doesn't state its treatment of zeros.

use headrace_geometry::math;

/// Maximum number of pairs for which the exact distribution is used.
pub(crate) const EXACT_MAX: usize = 50;

/// Treatment of zero differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Zeros {
    /// Zeros are dropped before ranking.
    #[default]
    Wilcoxon,
    /// Zeros are ranked, then dropped.
    Pratt,
}

/// Options of the signed-rank test.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Options {
    /// Treatment of zeros.
    pub zeros: Zeros,
    /// Continuity correction: whether the normal approximation moves the rank sum W+ by a half towards its mean.
    pub continuity: bool,
}

/// Distribution from which p is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Method {
    /// The exact distribution of the rank sum W+ over all choices of signs.
    Exact,
    /// A normal distribution.
    Normal,
}

/// Result of the test. The p values assume that the differences are symmetric about zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SignedRank {
    /// Sum of the ranks of positive differences.
    pub w_plus: f64,
    /// Sum of the ranks of negative differences.
    pub w_minus: f64,
    /// Number of non-zero differences.
    pub used: usize,
    /// Number of zero differences.
    pub zeros: usize,
    /// Probability of a rank sum W+ at least as far from its mean as the measured one, on either side.
    pub p_two_sided: f64,
    /// Probability of a rank sum W+ at least as large as the measured one; small if differences tend to be positive.
    pub p_greater: f64,
    /// Probability of a rank sum W+ at most as large as the measured one; small if differences tend to be negative.
    pub p_less: f64,
    /// Distribution from which p was computed.
    pub method: Method,
}

/// A reason why the signed-rank test can't be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub(crate) enum WilcoxonError {
    /// Two lists differ in length.
    #[error("pairs need lists of equal length; these have {left} and {right}")]
    Lengths {
        /// Length of the first list.
        left: usize,
        /// Length of the second list.
        right: usize,
    },
    /// A difference isn't a finite number.
    #[error("difference {index} isn't a number")]
    NotFinite {
        /// Index of the difference, from zero.
        index: usize,
    },
    /// All differences are zero, or there are none.
    #[error("every difference is zero: there is nothing to rank")]
    NoDifference,
}

/// Tests the pairwise differences `left` minus `right`.
///
/// Errors: see [`WilcoxonError`].
pub(crate) fn of_pairs(left: &[f64], right: &[f64], options: Options) -> Result<SignedRank, WilcoxonError> {
    if left.len() != right.len() {
        return Err(WilcoxonError::Lengths { left: left.len(), right: right.len() });
    }
    let differences: Vec<f64> = left.iter().zip(right).map(|(l, r)| l - r).collect();
    of_differences(&differences, options)
}

/// Tests differences.
///
/// Differences whose sizes are equal except for rounding errors aren't ties. Callers that need ties must round the
/// differences first.
///
/// Errors: see [`WilcoxonError`].
pub(crate) fn of_differences(differences: &[f64], options: Options) -> Result<SignedRank, WilcoxonError> {
    if let Some(index) = differences.iter().position(|d| !d.is_finite()) {
        return Err(WilcoxonError::NotFinite { index });
    }
    let is_zero = |d: &f64| d.abs() <= 0.0;
    let zeros = differences.iter().filter(|d| is_zero(d)).count();
    let used = differences.len() - zeros;
    if used == 0 {
        return Err(WilcoxonError::NoDifference);
    }
    let mut sorted: Vec<f64> =
        differences.iter().copied().filter(|d| options.zeros == Zeros::Pratt || !is_zero(d)).collect();
    sorted.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    let ranks = ranks_of(&sorted);
    let sum = |above: bool| -> f64 {
        let signed = sorted.iter().zip(&ranks).filter(|(d, _)| !is_zero(d) && (**d > 0.0) == above);
        signed.map(|(_, rank)| rank).sum()
    };
    let (w_plus, w_minus) = (sum(true), sum(false));
    let tied = ranks.windows(2).any(|pair| pair[1] <= pair[0]);
    let (p, method) = if zeros == 0 && !tied && used <= EXACT_MAX {
        (exact(used, w_plus), Method::Exact)
    } else {
        let others = sorted.iter().zip(&ranks).filter(|(d, _)| !is_zero(d)).map(|(_, rank)| *rank);
        (normal(others, w_plus, options.continuity), Method::Normal)
    };
    let [p_two_sided, p_greater, p_less] = p;
    Ok(SignedRank { w_plus, w_minus, used, zeros, p_two_sided, p_greater, p_less, method })
}

/// Ranks, from one, of values sorted by size; equal sizes share their mean rank.
fn ranks_of(sorted: &[f64]) -> Vec<f64> {
    let mut ranks = Vec::with_capacity(sorted.len());
    for tie in sorted.chunk_by(|a, b| a.abs() >= b.abs()) {
        let before = ranks.len();
        // The shared rank is the mean of the ranks from `before` + 1 to `before` + the length of the tie.
        let rank = before as f64 + f64::midpoint(tie.len() as f64, 1.0);
        ranks.extend(tie.iter().map(|_| rank));
    }
    ranks
}

/// Two-sided, upper and lower p of the rank sum W+, among all 2^n choices of signs.
fn exact(n: usize, w_plus: f64) -> [f64; 3] {
    let counts = sign_choices(n);
    let total: f64 = counts.iter().sum();
    // Without ties the rank sum W+ is a whole number.
    let w = crate::index(math::round_to_i64(w_plus));
    let less = counts.iter().take(w + 1).sum::<f64>() / total;
    let greater = counts.iter().skip(w).sum::<f64>() / total;
    [(2.0 * less.min(greater)).min(1.0), greater, less]
}

/// Number of sign choices for each rank sum W+ from 0 to n (n + 1) / 2. The numbers are exact in an f64: 2^50 is below
/// 2^53.
fn sign_choices(n: usize) -> Vec<f64> {
    let mut counts = vec![0.0; n * (n + 1) / 2 + 1];
    counts[0] = 1.0;
    for rank in 1..=n {
        for sum in (rank..counts.len()).rev() {
            counts[sum] += counts[sum - rank];
        }
    }
    counts
}

/// The p values of a normal distribution. The rank sum W+ has each rank included with probability one half.
fn normal(ranks: impl Iterator<Item = f64>, w_plus: f64, continuity: bool) -> [f64; 3] {
    let (sum, squares) = ranks.fold((0.0, 0.0), |(sum, squares), rank| (sum + rank, squares + rank * rank));
    let (off, sd) = (w_plus - sum / 2.0, math::sqrt(squares / 4.0));
    let half = if continuity { 0.5 } else { 0.0 };
    let upper = |z: f64| 0.5 * math::erfc(z / core::f64::consts::SQRT_2);
    let both = (2.0 * upper((off.abs() - half).max(0.0) / sd)).min(1.0);
    [both, upper((off - half) / sd), upper((-off - half) / sd)]
}

#[cfg(test)]
mod tests;
