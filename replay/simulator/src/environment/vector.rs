//! Rays, and vector operations for casting rays.

use headrace_geometry::math;

/// A position or direction in the tunnel's frame, m.
pub(super) type V3 = [f64; 3];

/// A ray in the tunnel's frame. The parameter t is in metres if the direction has unit length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    /// Origin.
    pub(super) origin: V3,
    /// Direction.
    pub(super) direction: V3,
}

impl Ray {
    /// The point `t_m` along the ray.
    pub(super) fn at(&self, t_m: f64) -> V3 {
        along(self.origin, t_m, self.direction)
    }
}

/// `from + t * direction`.
pub(super) fn along(from: V3, t: f64, direction: V3) -> V3 {
    [from[0] + t * direction[0], from[1] + t * direction[1], from[2] + t * direction[2]]
}

/// `a - b`.
pub(super) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Scalar product.
pub(super) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit vector of the same direction. A zero vector stays zero.
pub(super) fn unit(a: V3) -> V3 {
    let length = math::sqrt(dot(a, a));
    if length > 0.0 { a.map(|c| c / length) } else { a }
}
