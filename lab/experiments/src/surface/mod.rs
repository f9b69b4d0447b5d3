//! Surfaces through scattered samples of a tunnel's wall, and their distance from the wall.
//!
//! `poisson` closes a surface around the samples, as Jorge et al. 2021 did. `chart` interpolates deviations on the
//! unrolled wall. `wall` measures the distance of the wall from a surface.

mod band;
pub(crate) mod chart;
mod extract;
mod grid;
mod mesh;
pub(crate) mod normals;
pub(crate) mod poisson;
mod solver;
pub(crate) mod wall;

pub(crate) use mesh::{Mesh, MeshIndex};

/// A position in the tunnel frame: x chainage, y left, z up, metres.
pub(crate) type Xyz = [f64; 3];

/// A sample of the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sample {
    /// Position at which the beam hit the wall.
    pub place: Xyz,
    /// Unit normal of the wall at the hit, towards the water.
    pub normal: Xyz,
}

pub(crate) fn sub(a: Xyz, b: Xyz) -> Xyz {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn along(a: Xyz, direction: Xyz, length: f64) -> Xyz {
    [a[0] + length * direction[0], a[1] + length * direction[1], a[2] + length * direction[2]]
}

pub(crate) fn dot(a: Xyz, b: Xyz) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn norm(a: Xyz) -> f64 {
    headrace_geometry::math::sqrt(dot(a, a))
}
