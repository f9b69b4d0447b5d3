//! Geometry of ray casting: vectors, rays, Cartesian frames, and the wall at the point where a ray meets it.

use headrace_geometry::math;
use headrace_geometry::tunnel::Yz;

use super::axis::Station;

/// A position or direction in the tunnel's frame, m.
pub(super) type V3 = [f64; 3];

/// A ray in the tunnel's frame. The parameter t is in metres if the direction has unit length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ray {
    /// Origin of the ray, m.
    pub(super) origin: V3,
    /// Direction of the ray.
    pub(super) direction: V3,
}

impl Ray {
    /// The point at distance `t_m` along the ray.
    pub(super) fn at(&self, t_m: f64) -> V3 {
        along(self.origin, t_m, self.direction)
    }
}

/// Point `from + t * direction` of a straight line.
pub(super) fn along(from: V3, t: f64, direction: V3) -> V3 {
    [from[0] + t * direction[0], from[1] + t * direction[1], from[2] + t * direction[2]]
}

/// Difference `a - b` of two vectors.
pub(super) fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Scalar product of two vectors.
pub(super) fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The unit vector of the same direction. A zero vector stays zero.
pub(super) fn unit(a: V3) -> V3 {
    let length = math::sqrt(dot(a, a));
    if length > 0.0 { a.map(|c| c / length) } else { a }
}

/// A Cartesian frame: an origin and three orthogonal unit vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Origin of the frame, in the tunnel's frame.
    pub(super) origin: V3,
    /// Axes of the frame, in the tunnel's frame.
    pub(super) axes: [V3; 3],
}

impl Frame {
    /// Frame of the axis at a chainage: along the tunnel, left, up. The origin is point (y, z) of the section.
    pub(super) fn across(station: Station, [y, z]: Yz) -> Self {
        let ([tx, ty], [ax, ay]) = (station.tangent, station.at);
        Self { origin: [ax - y * ty, ay + y * tx, z], axes: [[tx, ty, 0.0], [-ty, tx, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// Transforms a point from the tunnel's frame into this frame.
    pub(super) fn local(&self, point: V3) -> V3 {
        let from = sub(point, self.origin);
        self.axes.map(|axis| dot(from, axis))
    }

    /// Transforms a ray from the tunnel's frame into this frame.
    pub(super) fn local_ray(&self, ray: &Ray) -> Ray {
        Ray { origin: self.local(ray.origin), direction: self.axes.map(|axis| dot(ray.direction, axis)) }
    }

    /// Transforms a direction from this frame into the tunnel's.
    pub(super) fn outwards(&self, local: V3) -> V3 {
        let sum = along([0.0; 3], local[0], self.axes[0]);
        along(along(sum, local[1], self.axes[1]), local[2], self.axes[2])
    }
}

/// The face of the wall at one point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Unit normal of the wall, towards the water.
    pub(super) normal: V3,
    /// Number of the feature that displaced the wall at the point, or whose mesh is the wall there.
    pub(super) feature: Option<u16>,
}
