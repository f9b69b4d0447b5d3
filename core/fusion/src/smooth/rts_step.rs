//! One step of the Rauch-Tung-Striebel smoother, with factored covariances.
//!
//! Factors keep the covariance symmetric and non-negative.
//!
//! Source: H. E. Rauch, F. Tung, C. T. Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3,
//! 1965.

use crate::filter::factors::Factors;

/// Smoother gain: maps corrections at the end of a step to corrections at its beginning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain<const N: usize> {
    /// Rows of C = P F^T (F P F^T + Q)^-1.
    rows: [[f64; N]; N],
    /// Rows of I - C F. They map the part of the error that the end of the step does not determine.
    rest: [[f64; N]; N],
}

impl<const N: usize> Gain<N> {
    /// Creates the gain of a step.
    ///
    /// `before` is the covariance at the beginning of the step, `carry` its error transition, and `predicted` the
    /// covariance predicted for its end.
    pub fn new(before: &Factors<N>, carry: impl Fn(&mut [f64; N]), predicted: &Factors<N>) -> Self {
        let unit: [[f64; N]; N] =
            core::array::from_fn(|j| core::array::from_fn(|i| if i == j { 1.0 } else { 0.0 }));
        let rows = unit.map(|unit| {
            let mut column = before.along(&unit);
            carry(&mut column);
            predicted.solve(&column)
        });
        let carried = unit.map(|mut unit| {
            carry(&mut unit);
            unit
        });
        let mut rest = unit;
        for (rest, row) in rest.iter_mut().zip(&rows) {
            for (slot, column) in rest.iter_mut().zip(&carried) {
                *slot -= sum(row, column);
            }
        }
        Self { rows, rest }
    }

    /// Maps errors at the end of the step to errors at its beginning.
    pub fn back(&self, errors: &[f64; N]) -> [f64; N] {
        self.rows.map(|row| sum(&row, errors))
    }

    /// Returns the smoothed covariance at the beginning of the step.
    ///
    /// `before` is the filter's covariance P at the beginning. `end_and_noise` is S + Q, the smoothed covariance at the
    /// end plus the noise of the step. The result is `(I - C F) P (I - C F)^T + C (S + Q) C^T`, which equals P + C (S -
    /// F P F^T - Q) C^T.
    pub fn smoothed(&self, before: &Factors<N>, end_and_noise: &Factors<N>) -> Factors<N> {
        Factors::of_sum([(before, &self.rest), (end_and_noise, &self.rows)])
    }
}

fn sum<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
