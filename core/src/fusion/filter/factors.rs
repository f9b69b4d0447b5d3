//! A covariance kept as its factors: P = U D U^T, U unit upper triangular, D diagonal.
//!
//! Updates touch D by products and quotients of what is positive alone, so that P can't lose its symmetry or its
//! sign however ill the scales are; an update by the covariance itself does, Joseph's form included, when a precise
//! measurement follows a long drift (see the tests).
//!
//! Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977: V.3 (measurement), III.4
//! (addition of a dyad, after Agee and Turner).

/// Factors of the covariance of `N` errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Factors<const N: usize> {
    /// Columns of U: `u[j][i]` is its element (i, j). Below the diagonal nothing is read; on it is 1.
    u: [[f64; N]; N],
    d: [f64; N],
}

/// What a measurement of one row does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain<const N: usize> {
    /// Change of each error for a unit of innovation.
    pub k: [f64; N],
    /// Variance of the innovation.
    pub variance: f64,
}

impl<const N: usize> Factors<N> {
    /// Independent errors of these variances, none negative.
    pub fn independent(variances: [f64; N]) -> Self {
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

    /// Variance of one error.
    pub fn variance(&self, i: usize) -> f64 {
        self.covariance(i, i)
    }

    /// Rows of the covariance.
    pub fn rows<const M: usize>(&self, rows: [usize; M]) -> [[f64; N]; M] {
        rows.map(|i| core::array::from_fn(|j| self.covariance(i, j)))
    }

    /// Variance of the sum of the errors, weighted by `h`.
    pub fn variance_along(&self, h: &[f64; N]) -> f64 {
        let columns = self.u.iter().zip(&self.d).enumerate();
        let terms = columns.map(|(j, (column, d))| {
            let f = dot(column, h, j + 1);
            f * f * d
        });
        terms.sum()
    }

    /// Covariances of all errors with their sum, weighted by `h`: P h.
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

    /// e^T P^-1 e: how unlikely these errors are, chi-square with `N` degrees of freedom. Infinite where P says that an
    /// error is known exactly, and it isn't zero.
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

    /// Takes a measurement of the errors weighted by `h`, with noise of a variance that is positive.
    ///
    /// Source: Bierman 1977, V.3.
    pub fn measure(&mut self, h: &[f64; N], noise: f64) -> Gain<N> {
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
        Gain { k: k.map(|k| k / variance), variance }
    }

    /// Adds noise of a variance to the errors, weighted by `a`, of which those from `len` on are zero.
    ///
    /// Source: Agee and Turner 1972, in Bierman 1977, III.4.
    pub fn add(&mut self, variance: f64, mut a: [f64; N], len: usize) {
        let mut c = variance;
        for (j, (column, d)) in self.u.iter_mut().zip(&mut self.d).enumerate().take(len).rev() {
            let s = at(&a, j);
            let sum = *d + c * s * s;
            if sum > 0.0 {
                let b = c / sum;
                c = b * *d;
                for (a, u) in a.iter_mut().zip(column).take(j) {
                    *a -= s * *u;
                    *u += s * b * *a;
                }
            }
            *d = sum;
        }
    }

    /// Adds noise of a variance to one error.
    pub fn add_to(&mut self, i: usize, variance: f64) {
        let mut a = [0.0; N];
        if let Some(slot) = a.get_mut(i) {
            *slot = 1.0;
        }
        self.add(variance, a, i + 1);
    }

    /// Replaces the errors e by F e, where F is unit upper triangular: `transform` works on one vector of errors, of which
    /// those from a number on are zero.
    pub fn shear(&mut self, transform: impl Fn(&mut [f64; N], usize)) {
        for (j, column) in self.u.iter_mut().enumerate() {
            transform(column, j + 1);
        }
    }

    /// Multiplies one error by a factor, which isn't zero.
    pub fn scale(&mut self, i: usize, factor: f64) {
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

    /// Whether all are finite numbers and no variance is negative.
    pub fn is_sound(&self) -> bool {
        self.d.iter().all(|d| d.is_finite() && *d >= 0.0)
            && self.u.as_flattened().iter().all(|u| u.is_finite())
    }
}

fn at<const N: usize>(column: &[f64; N], i: usize) -> f64 {
    column.get(i).copied().unwrap_or(0.0)
}

/// Product of the first `len` elements, in four sums of fixed order.
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
