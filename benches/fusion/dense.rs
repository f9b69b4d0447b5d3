//! Reference filters with the covariance as a dense matrix.

use std::hint::black_box;

use headrace_fusion::filter::factors::Factors;
use headrace_fusion::filter::settings::Settings;
use headrace_fusion::filter::state::ERRORS;
use kfilter::kalman::{Kalman, KalmanLinearNoInput, KalmanPredict as _, KalmanUpdate as _};
use kfilter::measurement::LinearMeasurement;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use nalgebra_of_peers as peers;

use crate::dive::Dive;

/// Indices of the states that a reading measures: the three attitude errors.
const MEASURED: [usize; 3] = [6, 7, 8];
const NOISE: f64 = 1e-3;
const INNOVATION: f64 = 1e-3;

/// Factors of a covariance in which no element is zero.
pub(crate) fn factors<const N: usize>() -> Factors<N> {
    let mut factors = Factors::independent([0.01; N]);
    for k in 0..N {
        // The columns have distinct directions: no two are parallel.
        let a = core::array::from_fn(|i| ((3 * i + 5 * k + i * k) % 11) as f64 / 11.0 - 0.4);
        factors.add(0.001, a, N);
    }
    factors
}

/// Transition matrix of an epoch. Filters with fewer states use its upper left part.
fn transition() -> [[f64; ERRORS]; ERRORS] {
    let transition = Dive::under_way().leg().transition(&Settings::default());
    let columns: [[f64; ERRORS]; ERRORS] = core::array::from_fn(|j| {
        let mut errors = core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 });
        transition.apply(&mut errors);
        errors
    });
    core::array::from_fn(|i| core::array::from_fn(|j| columns[j][i]))
}

/// Hand-written filter on nalgebra's matrices of fixed size. Its update uses Joseph's form.
#[derive(Clone)]
pub(crate) struct Dense<const N: usize> {
    x: SVector<f64, N>,
    p: SMatrix<f64, N, N>,
    f: SMatrix<f64, N, N>,
    q: SMatrix<f64, N, N>,
    h: SMatrix<f64, 3, N>,
    r: Matrix3<f64>,
}

impl<const N: usize> Dense<N> {
    pub(crate) fn new() -> Self {
        let (transition, factors) = (transition(), factors::<N>());
        Self {
            x: SVector::zeros(),
            p: SMatrix::from_fn(|i, j| factors.covariance(i, j)),
            f: SMatrix::from_fn(|i, j| transition[i][j]),
            q: SMatrix::from_diagonal_element(1e-6),
            h: SMatrix::from_fn(|k, j| f64::from(u8::from(MEASURED[k] == j))),
            r: Matrix3::from_diagonal_element(NOISE),
        }
    }

    pub(crate) fn predict(&mut self) {
        self.p = self.f * self.p * self.f.transpose() + self.q;
    }

    pub(crate) fn update(&mut self) {
        let ph = self.p * self.h.transpose();
        let s = self.h * ph + self.r;
        let k = ph * s.try_inverse().unwrap();
        let y = black_box(Vector3::from_element(INNOVATION)) - self.h * self.x;
        self.x += k * y;
        let left = SMatrix::identity() - k * self.h;
        self.p = left * self.p * left.transpose() + k * self.r * k.transpose();
    }
}

/// Filter of the crate `kfilter`.
#[derive(Clone)]
pub(crate) struct Published<const N: usize> {
    filter: KalmanLinearNoInput<f64, N>,
    measurement: LinearMeasurement<f64, N, 3>,
}

impl<const N: usize> Published<N> {
    pub(crate) fn new() -> Self {
        let (transition, factors) = (transition(), factors::<N>());
        let filter = Kalman::new(
            peers::SMatrix::from_fn(|i, j| transition[i][j]),
            peers::SMatrix::from_diagonal_element(1e-6),
            peers::SVector::zeros(),
            peers::SMatrix::from_fn(|i, j| factors.covariance(i, j)),
        );
        let measurement = LinearMeasurement::new(
            peers::SMatrix::from_fn(|k, j| f64::from(u8::from(MEASURED[k] == j))),
            peers::Matrix3::from_diagonal_element(NOISE),
            peers::Vector3::from_element(INNOVATION),
        );
        Self { filter, measurement }
    }

    pub(crate) fn predict(&mut self) {
        self.filter.predict().unwrap();
    }

    pub(crate) fn update(&mut self) {
        self.filter.update(black_box(&self.measurement)).unwrap();
    }
}
