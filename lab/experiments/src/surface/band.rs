//! Quadratic B-splines on a row of cells: values of the splines, and banded matrices of their integrals.
//!
//! On n cells there are n + 2 splines; spline i is zero outside cells i - 2 to i. Lengths are in cells. Integrals cover
//! only the existing cells, so the boundary condition is the natural one (no flux).

/// Integrals over a cell of the product of two B-splines N_a and N_b.
const MASS: [[f64; 3]; 3] = [
    [6.0 / 120.0, 13.0 / 120.0, 1.0 / 120.0],
    [13.0 / 120.0, 54.0 / 120.0, 13.0 / 120.0],
    [1.0 / 120.0, 13.0 / 120.0, 6.0 / 120.0],
];
/// Integrals over a cell of the product of two B-splines' derivatives, N_a' N_b'.
const STIFFNESS: [[f64; 3]; 3] = [
    [1.0 / 3.0, -1.0 / 6.0, -1.0 / 6.0],
    [-1.0 / 6.0, 1.0 / 3.0, -1.0 / 6.0],
    [-1.0 / 6.0, -1.0 / 6.0, 1.0 / 3.0],
];
/// Integrals over a cell of the product of a B-spline's derivative and a B-spline, N_a' N_b.
const SLOPE: [[f64; 3]; 3] = [
    [-1.0 / 8.0, -1.0 / 3.0, -1.0 / 24.0],
    [1.0 / 12.0, 0.0, -1.0 / 12.0],
    [1.0 / 24.0, 1.0 / 3.0, 1.0 / 8.0],
];

/// Values of a cell's three B-splines at the relative position `t` in the cell, from 0 to 1.
pub(super) fn values(t: f64) -> [f64; 3] {
    [(1.0 - t) * (1.0 - t) / 2.0, 0.5 + t - t * t, t * t / 2.0]
}

/// A matrix with two diagonals on either side of the main one; row i holds the columns i - 2 to i + 2.
pub(super) struct Band {
    rows: Vec<[f64; 5]>,
}

impl Band {
    fn assemble(cells: usize, element: &[[f64; 3]; 3]) -> Self {
        let mut rows = vec![[0.0; 5]; cells + 2];
        for cell in 0..cells {
            for (a, line) in element.iter().enumerate() {
                for (b, value) in line.iter().enumerate() {
                    rows[cell + a][2 + b - a] += value;
                }
            }
        }
        Self { rows }
    }

    /// Matrix of the integrals of B-spline products, N_row N_column.
    pub(super) fn mass(cells: usize) -> Self {
        Self::assemble(cells, &MASS)
    }

    /// Matrix of the integrals of products of B-spline derivatives, N_row' N_column'.
    pub(super) fn stiffness(cells: usize) -> Self {
        Self::assemble(cells, &STIFFNESS)
    }

    /// Matrix of the integrals of a B-spline derivative times a B-spline, N_row' N_column.
    pub(super) fn slope(cells: usize) -> Self {
        Self::assemble(cells, &SLOPE)
    }

    /// Entry of the matrix on its main diagonal.
    pub(super) fn diagonal(&self, row: usize) -> f64 {
        self.rows.get(row).map_or(0.0, |r| r[2])
    }

    /// Adds this matrix times `source` to `target`, along the middle axis of an array `outer x n x inner`.
    pub(super) fn add_product(&self, inner: usize, source: &[f64], target: &mut [f64]) {
        let n = self.rows.len();
        let slabs = source.chunks_exact(n * inner).zip(target.chunks_exact_mut(n * inner));
        for (source, target) in slabs {
            for (i, (row, line)) in self.rows.iter().zip(target.chunks_exact_mut(inner)).enumerate() {
                for (k, coefficient) in row.iter().enumerate() {
                    let Some(j) = (i + k).checked_sub(2).filter(|j| *j < n) else { continue };
                    for (t, s) in line.iter_mut().zip(&source[j * inner..(j + 1) * inner]) {
                        *t += coefficient * s;
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slopes(t: f64) -> [f64; 3] {
        [t - 1.0, 1.0 - 2.0 * t, t]
    }

    #[test]
    fn cell_integrals_match_gauss_quadrature() {
        let root = (0.6_f64).sqrt() / 2.0;
        let gauss = [(0.5 - root, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + root, 5.0 / 18.0)];
        let integral = |f: &dyn Fn(f64) -> f64| gauss.iter().map(|(t, w)| w * f(*t)).sum::<f64>();
        for a in 0..3 {
            for b in 0..3 {
                let close = |x: f64, y: f64| assert!((x - y).abs() < 1e-15, "{a} {b}: {x} {y}");
                close(MASS[a][b], integral(&|t| values(t)[a] * values(t)[b]));
                close(STIFFNESS[a][b], integral(&|t| slopes(t)[a] * slopes(t)[b]));
                close(SLOPE[a][b], integral(&|t| slopes(t)[a] * values(t)[b]));
            }
        }
    }

    #[test]
    fn constant_field_has_zero_stiffness() {
        let mut product = vec![0.0; 8];
        Band::stiffness(6).add_product(1, &[1.0; 8], &mut product);
        assert!(product.iter().all(|p| p.abs() < 1e-15), "{product:?}");
    }

    #[test]
    fn band_matrix_times_an_array_equals_the_products_with_its_single_lines() {
        let band = Band::mass(3);
        let source: Vec<f64> = (0..2 * 5 * 3).map(f64::from).collect();
        let mut target = vec![0.0; 30];
        band.add_product(3, &source, &mut target);
        for outer in 0..2 {
            for inner in 0..3 {
                let line: Vec<f64> = (0..5).map(|i| source[(outer * 5 + i) * 3 + inner]).collect();
                let mut alone = vec![0.0; 5];
                band.add_product(1, &line, &mut alone);
                for i in 0..5 {
                    assert_eq!(target[(outer * 5 + i) * 3 + inner].to_bits(), alone[i].to_bits());
                }
            }
        }
    }
}
