//! A covariance kept as its factors: P = U D U^T, with U unit upper triangular and D diagonal.
//!
//! Updates change D only by products and quotients of positive numbers. P therefore stays symmetric and non-negative,
//! however badly it is scaled. Updates of the full P, even in Joseph's form, fail when a precise measurement follows a
//! long drift (see the tests).
//!
//! Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977: V.3 (measurement), III.4 (addition
//! of a dyad, after Agee and Turner).

use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError, Stateful};

/// Factors of the covariance of `N` errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factors<const N: usize> {
    /// Columns of U: `u[j][i]` is element (i, j). Elements below the diagonal are never read, and the diagonal is
    /// 1.
    u: [[f64; N]; N],
    d: [f64; N],
}

/// Gain of a scalar measurement, and the variance of its innovation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain<const N: usize> {
    /// Kalman gain: change of each error per unit of innovation.
    pub k: [f64; N],
    /// Variance of the innovation.
    pub variance: f64,
}

/// Process noise that drives one error, or two errors together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    variance: f64,
    /// Indices and weights of the errors that the noise drives. The first error has the higher index.
    weights: [(usize, f64); 2],
}

impl<const N: usize> Stateful for Factors<N> {
    fn save(&self, to: &mut Saver) {
        to.list(self.u.as_flattened());
        to.list(&self.d);
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        from.slots(self.u.as_flattened_mut())?;
        from.slots(&mut self.d)
    }
}

impl<const N: usize> Factors<N> {
    /// Creates factors of independent errors with these variances, which must not be negative.
    pub fn independent(variances: [f64; N]) -> Self {
        debug_assert!(variances.iter().all(is_variance), "variances aren't negative: {variances:?}");
        let mut u = [[0.0; N]; N];
        for (j, column) in u.iter_mut().enumerate() {
            if let Some(diagonal) = column.get_mut(j) {
                *diagonal = 1.0;
            }
        }
        Self { u, d: variances }
    }

    /// Covariance of the errors `i` and `j`.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        let columns = self.u.iter().zip(&self.d).skip(i.max(j));
        columns.map(|(column, d)| at(column, i) * d * at(column, j)).sum()
    }

    /// Variance of the error `i`.
    pub fn variance(&self, i: usize) -> f64 {
        self.covariance(i, i)
    }

    /// The rows of the covariance whose indices are in `rows`.
    pub fn rows<const M: usize>(&self, rows: [usize; M]) -> [[f64; N]; M] {
        rows.map(|i| core::array::from_fn(|j| self.covariance(i, j)))
    }

    /// Variance of the sum of all errors, weighted by `h`.
    pub fn variance_along(&self, h: &[f64; N]) -> f64 {
        let columns = self.u.iter().zip(&self.d).enumerate();
        let terms = columns.map(|(j, (column, d))| {
            let f = dot(column, h, j + 1);
            f * f * d
        });
        terms.sum()
    }

    /// Covariances of all errors with the sum weighted by `h`: P h.
    pub fn along(&self, h: &[f64; N]) -> [f64; N] {
        let mut along = [0.0; N];
        for (j, (column, d)) in self.u.iter().zip(&self.d).enumerate() {
            let f = d * dot(column, h, j + 1);
            for (along, u) in along.iter_mut().zip(column).take(j + 1) {
                *along += f * u;
            }
        }
        along
    }

    /// Squared Mahalanobis distance e^T P^-1 e, which is chi-square distributed with `N` degrees of freedom.
    ///
    /// Infinite if an error with zero variance is not zero.
    pub fn distance(&self, errors: &[f64; N]) -> f64 {
        let mut rest = *errors;
        let mut sum = 0.0;
        for (j, (column, d)) in self.u.iter().zip(&self.d).enumerate().rev() {
            let y = at(&rest, j);
            for (rest, u) in rest.iter_mut().zip(column).take(j) {
                *rest -= u * y;
            }
            if y != 0.0 {
                sum += y * y / d;
            }
        }
        sum
    }

    /// Computes P^-1 e by back substitution. Components with zero variance are ignored.
    pub fn solve(&self, errors: &[f64; N]) -> [f64; N] {
        let mut rest = *errors;
        for (j, column) in self.u.iter().enumerate().rev() {
            let y = at(&rest, j);
            for (rest, u) in rest.iter_mut().zip(column).take(j) {
                *rest -= u * y;
            }
        }
        for (rest, d) in rest.iter_mut().zip(&self.d) {
            *rest = if *d > 0.0 { *rest / d } else { 0.0 };
        }
        for (j, column) in self.u.iter().enumerate() {
            let before = dot(column, &rest, j);
            if let Some(rest) = rest.get_mut(j) {
                *rest -= before;
            }
        }
        rest
    }

    /// Returns the factors of the covariance of a sum of independent errors, each transformed by a matrix.
    ///
    /// `parts` gives the factors of each error vector and the rows of its matrix.
    ///
    /// Source: Thornton's modified weighted Gram-Schmidt, in Bierman 1977, VI.4.
    pub fn of_sum<const M: usize>(parts: [(&Self, &[[f64; N]; N]); M]) -> Self {
        let mut w: [[[f64; N]; M]; N] = core::array::from_fn(|i| {
            parts.map(|(factors, rows)| rows.get(i).map_or([0.0; N], |row| factors.through(row)))
        });
        let mut sum = Self::independent([0.0; N]);
        for (j, (column, d)) in sum.u.iter_mut().zip(&mut sum.d).enumerate().rev() {
            let (above, from) = w.split_at_mut(j);
            let Some(own) = from.first() else {
                debug_assert!(false, "row {j} is one of {N}");
                continue;
            };
            let weighted: [[f64; N]; M] = core::array::from_fn(|m| {
                let weights = parts.get(m).map_or([0.0; N], |(factors, _)| factors.d);
                let own = own.get(m).copied().unwrap_or([0.0; N]);
                core::array::from_fn(|k| at(&own, k) * at(&weights, k))
            });
            let with =
                |row: &[[f64; N]; M]| row.iter().zip(&weighted).map(|(a, b)| dot(a, b, N)).sum::<f64>();
            *d = with(own);
            if *d > 0.0 {
                for (row, u) in above.iter_mut().zip(column) {
                    *u = with(row) / *d;
                    for (w, own) in row.as_flattened_mut().iter_mut().zip(own.as_flattened()) {
                        *w -= *u * own;
                    }
                }
            }
        }
        sum
    }

    /// Multiplies a row vector by the factor U.
    fn through(&self, row: &[f64; N]) -> [f64; N] {
        core::array::from_fn(|j| self.u.get(j).map_or(0.0, |column| dot(column, row, j + 1)))
    }

    /// Returns the elements of U above the diagonal and the elements of D, column by column.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + '_ {
        let columns = self.u.iter().zip(&self.d).enumerate();
        columns.flat_map(|(j, (column, d))| column.iter().take(j).copied().chain([*d]))
    }

    /// Creates factors from the numbers that [`Self::numbers`] returns; `None` if there are too few.
    pub fn of_numbers(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let mut factors = Self::independent([0.0; N]);
        for (j, (column, d)) in factors.u.iter_mut().zip(&mut factors.d).enumerate() {
            for slot in column.iter_mut().take(j).chain([d]) {
                *slot = numbers.next()?;
            }
        }
        Some(factors)
    }

    /// Fuses a measurement of the sum of errors weighted by `h`. The variance of its noise must be positive.
    ///
    /// Source: Bierman 1977, V.3.
    pub fn measure(&mut self, h: &[f64; N], noise: f64) -> Gain<N> {
        debug_assert!(noise > 0.0, "a measurement has noise: its variance is {noise}");
        let mut k = [0.0; N];
        let mut variance = noise;
        for (j, (column, d)) in self.u.iter_mut().zip(&mut self.d).enumerate() {
            let f = dot(column, h, j + 1);
            let g = *d * f;
            let before = variance;
            variance += f * g;
            let lambda = -f / before;
            *d *= before / variance;
            for (u, k) in column.iter_mut().zip(&mut k).take(j) {
                let was = *u;
                *u = was + *k * lambda;
                *k += g * was;
            }
            if let Some(k) = k.get_mut(j) {
                *k = g;
            }
        }
        debug_assert!(
            is_variance(&(variance - noise)),
            "the variance of an innovation includes the noise of {noise}: {variance}"
        );
        Gain { k: k.map(|k| k / variance), variance }
    }

    /// Adds noise with this variance and the weights `a` to all errors. Weights from index `len` on are zero.
    pub fn add(&mut self, mut variance: f64, mut a: [f64; N], len: usize) {
        debug_assert!(is_variance(&variance), "added noise has a variance: {variance}");
        for (j, (column, d)) in self.u.iter_mut().zip(&mut self.d).enumerate().take(len).rev() {
            enter(j, column, d, &mut variance, &mut a);
        }
    }

    /// Adds noise with this variance to the error `i`.
    pub fn add_to(&mut self, i: usize, variance: f64) {
        self.add_all([Noise::of_one(i, variance)]);
    }

    /// Increases the variances of the errors. Increases that are not positive are ignored.
    pub fn widen(&mut self, variances: &[f64; N]) {
        for (i, variance) in variances.iter().enumerate().filter(|(_, variance)| **variance > 0.0) {
            self.add_to(i, *variance);
        }
    }

    /// Adds several noises in order, interleaved column by column.
    ///
    /// Earlier noises affect a later noise only through the current column. So the result is bit-identical to adding
    /// one noise after the other. Interleaving is faster, because the processor works on other noises while one noise
    /// waits for the quotient for its next column.
    pub fn add_all<const M: usize>(&mut self, noises: [Noise; M]) {
        let mut variances = noises.map(|noise| noise.variance);
        debug_assert!(variances.iter().all(is_variance), "added noises have variances: {variances:?}");
        let lens = noises.map(|noise| noise.weights[0].0 + 1);
        let mut a = [[0.0; N]; M];
        for (a, noise) in a.iter_mut().zip(&noises) {
            noise.put(a);
        }
        for (j, (column, d)) in self.u.iter_mut().zip(&mut self.d).enumerate().rev() {
            for ((a, variance), len) in a.iter_mut().zip(&mut variances).zip(&lens) {
                if *len > j {
                    enter(j, column, d, variance, a);
                }
            }
        }
    }

    /// Replaces the errors e by F e, where F is unit upper triangular.
    ///
    /// `transform` applies F to one vector of errors in place. The vector's entries from the given index on are zero.
    pub fn shear(&mut self, transform: impl Fn(&mut [f64; N], usize)) {
        for (j, column) in self.u.iter_mut().enumerate() {
            transform(column, j + 1);
        }
    }

    /// Multiplies one error by a non-zero factor.
    pub fn scale(&mut self, i: usize, factor: f64) {
        debug_assert!(factor.abs() > 0.0, "the factor of error {i} isn't zero: {factor}");
        if let Some(column) = self.u.get_mut(i) {
            for u in column.iter_mut().take(i) {
                *u /= factor;
            }
        }
        for column in self.u.iter_mut().skip(i + 1) {
            if let Some(u) = column.get_mut(i) {
                *u *= factor;
            }
        }
        if let Some(d) = self.d.get_mut(i) {
            *d *= factor * factor;
        }
    }

    /// Whether no variance is negative, which is true after any sequence of changes.
    ///
    /// Numbers that are not finite are accepted here; [`Self::is_sound`] detects them.
    pub fn has_variances(&self) -> bool {
        self.d.iter().all(is_variance)
    }

    /// Whether all numbers are finite and no variance is negative.
    pub fn is_sound(&self) -> bool {
        self.d.iter().all(|d| d.is_finite() && *d >= 0.0)
            && self.u.as_flattened().iter().all(|u| u.is_finite())
    }
}

impl Noise {
    /// Returns this process noise with its variance multiplied by a factor.
    #[must_use]
    pub fn scaled(self, factor: f64) -> Self {
        Self { variance: self.variance * factor, ..self }
    }

    /// Creates process noise of one error, with this variance.
    pub fn of_one(i: usize, variance: f64) -> Self {
        Self { variance, weights: [(i, 1.0); 2] }
    }

    /// Creates process noise of the error `i` that also acts, with the weight `share`, on an error with a lower index.
    pub fn of_two(i: usize, (before, share): (usize, f64), variance: f64) -> Self {
        Self { variance, weights: [(i, 1.0), (before, share)] }
    }

    fn put<const N: usize>(&self, a: &mut [f64; N]) {
        for (i, weight) in self.weights {
            if let Some(slot) = a.get_mut(i) {
                *slot = weight;
            }
        }
    }
}

/// Adds noise to column `j` of the factors. The caller goes from the highest column to the lowest.
///
/// Changes `variance` and `a` to the noise that remains for the columns with a lower index.
///
/// Source: Agee and Turner 1972, in Bierman 1977, III.4.
fn enter<const N: usize>(j: usize, column: &mut [f64; N], d: &mut f64, variance: &mut f64, a: &mut [f64; N]) {
    let s = at(a, j);
    let sum = *d + *variance * s * s;
    if sum > 0.0 {
        let b = *variance / sum;
        *variance = b * *d;
        for (a, u) in a.iter_mut().zip(column).take(j) {
            *a -= s * *u;
            *u += s * b * *a;
        }
    }
    *d = sum;
}

/// Whether a number is a valid variance: not negative, or NaN.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "iterators pass references")]
fn is_variance(number: &f64) -> bool {
    *number >= 0.0 || number.is_nan()
}

fn at<const N: usize>(column: &[f64; N], i: usize) -> f64 {
    column.get(i).copied().unwrap_or(0.0)
}

/// Dot product of the first `len` elements. It uses four partial sums in a fixed order.
fn dot<const N: usize>(a: &[f64; N], b: &[f64; N], len: usize) -> f64 {
    let (a, b) = (a.get(..len).unwrap_or_default(), b.get(..len).unwrap_or_default());
    let mut sums = [0.0; 4];
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    for (a, b) in a4.iter().zip(b4) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    (sums[0] + sums[2]) + (sums[1] + sums[3]) + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds a single noise term in the textbook form.
    fn add_alone(factors: &mut Factors<7>, noise: &Noise) {
        let (mut c, mut a) = (noise.variance, [0.0; 7]);
        noise.put(&mut a);
        for j in (0..=noise.weights[0].0).rev() {
            let (s, d) = (a[j], factors.d[j]);
            factors.d[j] = d + c * s * s;
            if factors.d[j] > 0.0 {
                let b = c / factors.d[j];
                c = b * d;
                for (a, u) in a[..j].iter_mut().zip(&mut factors.u[j]) {
                    *a -= s * *u;
                    *u += s * b * *a;
                }
            }
        }
    }

    #[test]
    fn adding_noise_terms_together_is_bit_identical_to_adding_them_singly() {
        let noises: [Noise; 9] = core::array::from_fn(|i| match i {
            7 => Noise::of_two(5, (2, -1.3), 0.11),
            8 => Noise::of_two(6, (5, 0.7), 0.2),
            _ => Noise::of_one((3 * i) % 7, 0.3 / (i + 1) as f64),
        });
        for start in [[0.0; 7], [1.0, 0.1, 0.0, 3.0, 1e-9, 0.0, 7.0]] {
            let (mut alone, mut together) = (Factors::independent(start), Factors::independent(start));
            for _ in 0..3 {
                for noise in &noises {
                    add_alone(&mut alone, noise);
                }
                together.add_all(noises);
            }
            assert_eq!(alone.d.map(f64::to_bits), together.d.map(f64::to_bits));
            assert_eq!(alone.u.map(|c| c.map(f64::to_bits)), together.u.map(|c| c.map(f64::to_bits)));
            assert!(together.is_sound());
        }
    }
}
