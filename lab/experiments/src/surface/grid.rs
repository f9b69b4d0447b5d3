//! A box of cubic cells with a quadratic B-spline field.

use headrace_geometry::math;

use super::{Xyz, band};

/// Cells of a box in the tunnel's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Grid {
    /// Corner of the box with the smallest coordinates, m.
    pub(super) origin: Xyz,
    /// Side of a cell, m.
    pub(super) cell_m: f64,
    /// Number of cells along each axis.
    pub(super) cells: [usize; 3],
}

/// The 27 B-splines that are non-zero at a position: index of the first one, and values along each axis.
pub(super) struct Local {
    first: usize,
    along: [[f64; 3]; 3],
}

impl Grid {
    /// Number of B-splines along each axis.
    pub(super) fn nodes(&self) -> [usize; 3] {
        self.cells.map(|n| n + 2)
    }

    /// Number of B-splines of the grid.
    pub(super) fn len(&self) -> usize {
        self.nodes().iter().product()
    }

    /// The same box with cells twice as large. Odd numbers of cells are rounded up.
    pub(super) fn coarser(&self) -> Self {
        Self { origin: self.origin, cell_m: self.cell_m * 2.0, cells: self.cells.map(|n| n.div_ceil(2)) }
    }

    /// The B-splines at a position. Outside the box, the B-splines of the nearest cell are extrapolated.
    pub(super) fn local(&self, place: Xyz) -> Local {
        let mut along = [[0.0; 3]; 3];
        let mut cell = [0_usize; 3];
        for axis in 0..3 {
            let at = (place[axis] - self.origin[axis]) / self.cell_m;
            let last = self.cells[axis] as i64 - 1;
            let index = math::floor_to_i64(at).clamp(0, last);
            cell[axis] = crate::index(index);
            along[axis] = band::values(at - index as f64);
        }
        let [_, ny, nz] = self.nodes();
        Local { first: (cell[0] * ny + cell[1]) * nz + cell[2], along }
    }

    /// Value of the field with these coefficients at a position.
    pub(super) fn value(&self, field: &[f64], place: Xyz) -> f64 {
        self.gather(&self.local(place), field)
    }

    /// Sum of the coefficients, weighted by the B-splines' values.
    pub(super) fn gather(&self, local: &Local, field: &[f64]) -> f64 {
        let [_, ny, nz] = self.nodes();
        let mut sum = 0.0;
        for (i, wx) in local.along[0].iter().enumerate() {
            for (j, wy) in local.along[1].iter().enumerate() {
                let at = local.first + (i * ny + j) * nz;
                let line = field[at..at + 3].iter().zip(&local.along[2]);
                sum += wx * wy * line.map(|(c, wz)| c * wz).sum::<f64>();
            }
        }
        sum
    }

    /// Adds `amount` times the B-splines' values to the coefficients: the transpose of [`Grid::gather`].
    pub(super) fn scatter(&self, local: &Local, amount: f64, field: &mut [f64]) {
        let [_, ny, nz] = self.nodes();
        for (i, wx) in local.along[0].iter().enumerate() {
            for (j, wy) in local.along[1].iter().enumerate() {
                let at = local.first + (i * ny + j) * nz;
                for (c, wz) in field[at..at + 3].iter_mut().zip(&local.along[2]) {
                    *c += amount * wx * wy * wz;
                }
            }
        }
    }

    /// Adds `amount` times the squares of the B-splines' values to the coefficients: the diagonal of `scatter` times
    /// `gather`.
    pub(super) fn scatter_squares(&self, local: &Local, amount: f64, field: &mut [f64]) {
        let squares = local.along.map(|line| line.map(|w| w * w));
        self.scatter(&Local { first: local.first, along: squares }, amount, field);
    }

    /// Converts a coarser grid's field exactly to coefficients on this grid.
    ///
    /// A quadratic B-spline is the sum of four B-splines of half its width, with the weights 1/4, 3/4, 3/4 and 1/4.
    pub(super) fn refined(&self, coarse: &Grid, field: &[f64]) -> Vec<f64> {
        let (from, to) = (coarse.nodes(), self.nodes());
        let x = refine_axis(field, 1, from[0], to[0], from[1] * from[2]);
        let y = refine_axis(&x, to[0], from[1], to[1], from[2]);
        refine_axis(&y, to[0] * to[1], from[2], to[2], 1)
    }
}

fn refine_axis(source: &[f64], outer: usize, from: usize, to: usize, inner: usize) -> Vec<f64> {
    let mut target = vec![0.0; outer * to * inner];
    for o in 0..outer {
        for i in 0..from {
            for (s, weight) in [0.25, 0.75, 0.75, 0.25].into_iter().enumerate() {
                let Some(j) = (2 * i + s).checked_sub(2).filter(|j| *j < to) else { continue };
                let (a, b) = ((o * from + i) * inner, (o * to + j) * inner);
                for k in 0..inner {
                    target[b + k] += weight * source[a + k];
                }
            }
        }
    }
    target
}

#[cfg(test)]
mod tests {
    use super::*;

    const FINE: Grid = Grid { origin: [1.0, -2.0, 0.5], cell_m: 0.5, cells: [8, 5, 6] };

    #[test]
    fn refining_the_grid_keeps_all_field_values() {
        let coarse = FINE.coarser();
        let field: Vec<f64> = (0..coarse.len()).map(|k| math::sin(k as f64 * 1.7)).collect();
        let refined = FINE.refined(&coarse, &field);
        for k in 0..500 {
            let t = f64::from(k) * 0.618;
            let place = [1.0 + (t * 1.3) % 4.0, -2.0 + (t * 2.1) % 2.5, 0.5 + (t * 0.7) % 3.0];
            let (a, b) = (coarse.value(&field, place), FINE.value(&refined, place));
            assert!((a - b).abs() < 1e-13, "{place:?}: {a} {b}");
        }
    }

    #[test]
    fn basis_functions_sum_to_one() {
        let ones = vec![1.0; FINE.len()];
        for place in [[1.0, -2.0, 0.5], [5.0, 0.5, 3.5], [2.2, -1.1, 1.7]] {
            assert!((FINE.value(&ones, place) - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn scatter_is_the_transpose_of_gather() {
        let field: Vec<f64> = (0..FINE.len()).map(|k| math::cos(k as f64)).collect();
        let local = FINE.local([3.3, -0.3, 2.2]);
        let mut spread = vec![0.0; FINE.len()];
        FINE.scatter(&local, 1.0, &mut spread);
        let product: f64 = spread.iter().zip(&field).map(|(a, b)| a * b).sum();
        assert!((product - FINE.gather(&local, &field)).abs() < 1e-14);
    }
}
