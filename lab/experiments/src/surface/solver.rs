//! The screened Poisson equation on a grid, by conjugate gradients.

use headrace_geometry::math;

use super::band::Band;
use super::grid::{Grid, Local};

/// Left-hand side of the equation: integrals of products of gradients, plus `weight` times the products of values at
/// the samples.
pub(super) struct Screened<'a> {
    grid: &'a Grid,
    mass: [Band; 3],
    stiffness: [Band; 3],
    samples: Vec<Local>,
    weight: f64,
    diagonal: Vec<f64>,
}

/// Buffers for applying the left-hand side.
struct Scratch {
    mass_z: Vec<f64>,
    stiffness_z: Vec<f64>,
    mass_yz: Vec<f64>,
    stiffness_yz: Vec<f64>,
}

/// Outcome of a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solved {
    /// Number of iterations.
    pub(super) steps: usize,
    /// Relative residual that was reached.
    pub(super) residual: f64,
}

impl<'a> Screened<'a> {
    /// Creates the left-hand side of the equation; `weight` is the weight of one sample, in units of cells.
    pub(super) fn new(grid: &'a Grid, samples: Vec<Local>, weight: f64) -> Self {
        let mut system = Self {
            grid,
            mass: grid.cells.map(Band::mass),
            stiffness: grid.cells.map(Band::stiffness),
            samples,
            weight,
            diagonal: Vec::new(),
        };
        system.diagonal = system.diagonal();
        system
    }

    fn diagonal(&self) -> Vec<f64> {
        let [nx, ny, nz] = self.grid.nodes();
        let mut diagonal = Vec::with_capacity(self.grid.len());
        let at = |band: &[Band; 3], axis: usize, k: usize| band[axis].diagonal(k);
        for i in 0..nx {
            for j in 0..ny {
                for k in 0..nz {
                    let m = [at(&self.mass, 0, i), at(&self.mass, 1, j), at(&self.mass, 2, k)];
                    let s = [at(&self.stiffness, 0, i), at(&self.stiffness, 1, j), at(&self.stiffness, 2, k)];
                    diagonal.push(s[0] * m[1] * m[2] + m[0] * s[1] * m[2] + m[0] * m[1] * s[2]);
                }
            }
        }
        for local in &self.samples {
            self.grid.scatter_squares(local, self.weight, &mut diagonal);
        }
        diagonal
    }

    fn scratch(&self) -> Scratch {
        let zeros = || vec![0.0; self.grid.len()];
        Scratch { mass_z: zeros(), stiffness_z: zeros(), mass_yz: zeros(), stiffness_yz: zeros() }
    }

    /// Sets `target` to the left-hand side times `field`. The Laplacian is Kx My Mz + Mx Ky Mz + Mx My Kz with
    /// stiffness matrices K and mass matrices M, computed axis by axis.
    fn apply(&self, field: &[f64], target: &mut [f64], scratch: &mut Scratch) {
        let [_, ny, nz] = self.grid.nodes();
        let Scratch { mass_z, stiffness_z, mass_yz, stiffness_yz } = scratch;
        for list in [&mut *mass_z, stiffness_z, mass_yz, stiffness_yz, &mut *target] {
            list.fill(0.0);
        }
        self.mass[2].add_product(1, field, mass_z);
        self.stiffness[2].add_product(1, field, stiffness_z);
        self.mass[1].add_product(nz, mass_z, mass_yz);
        self.stiffness[1].add_product(nz, mass_z, stiffness_yz);
        self.mass[1].add_product(nz, stiffness_z, stiffness_yz);
        self.stiffness[0].add_product(ny * nz, mass_yz, target);
        self.mass[0].add_product(ny * nz, stiffness_yz, target);
        for local in &self.samples {
            let value = self.grid.gather(local, field);
            self.grid.scatter(local, self.weight * value, target);
        }
    }

    /// Improves `field` until the residual is at most `tolerance` times the right-hand side, or for `steps_max` steps.
    pub(super) fn solve(&self, rhs: &[f64], field: &mut [f64], tolerance: f64, steps_max: usize) -> Solved {
        let mut scratch = self.scratch();
        let mut image = vec![0.0; field.len()];
        self.apply(field, &mut image, &mut scratch);
        let mut residual: Vec<f64> = rhs.iter().zip(&image).map(|(b, a)| b - a).collect();
        let mut scaled: Vec<f64> = residual.iter().zip(&self.diagonal).map(|(r, d)| r / d).collect();
        let mut direction = scaled.clone();
        let mut rho = product(&residual, &scaled);
        let aim = tolerance * tolerance * product(rhs, rhs);
        let mut steps = 0;
        while steps < steps_max && product(&residual, &residual) > aim {
            self.apply(&direction, &mut image, &mut scratch);
            let alpha = rho / product(&direction, &image);
            add_scaled(field, alpha, &direction);
            add_scaled(&mut residual, -alpha, &image);
            for ((s, r), d) in scaled.iter_mut().zip(&residual).zip(&self.diagonal) {
                *s = r / d;
            }
            let before = rho;
            rho = product(&residual, &scaled);
            for (d, s) in direction.iter_mut().zip(&scaled) {
                *d = s + rho / before * *d;
            }
            steps += 1;
        }
        let size = product(rhs, rhs).max(f64::MIN_POSITIVE);
        Solved { steps, residual: math::sqrt(product(&residual, &residual) / size) }
    }
}

/// Right-hand side of the equation: integrals of a vector field times the B-splines' gradients. `field` has the vector
/// field's coefficients.
pub(super) fn divergence(grid: &Grid, field: &[Vec<f64>; 3]) -> Vec<f64> {
    let [_, ny, nz] = grid.nodes();
    let inner = [ny * nz, nz, 1];
    let mut sum = vec![0.0; grid.len()];
    for (component, values) in field.iter().enumerate() {
        let mut before = values.clone();
        for (axis, (inner, cells)) in inner.into_iter().zip(grid.cells).enumerate() {
            let band = if axis == component { Band::slope(cells) } else { Band::mass(cells) };
            let mut after = vec![0.0; before.len()];
            band.add_product(inner, &before, &mut after);
            before = after;
        }
        add_scaled(&mut sum, 1.0, &before);
    }
    sum
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn add_scaled(target: &mut [f64], factor: f64, source: &[f64]) {
    for (t, s) in target.iter_mut().zip(source) {
        *t += factor * s;
    }
}
