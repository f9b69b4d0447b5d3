//! Points and vectors in the cross-section.

use crate::math;

/// A point in the cross-section: y left, z up, metres.
pub type Yz = [f64; 2];

pub(super) fn sub(a: Yz, b: Yz) -> Yz {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Yz, b: Yz) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Yz, b: Yz) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn norm(a: Yz) -> f64 {
    math::sqrt(dot(a, a))
}
