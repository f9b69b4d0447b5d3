//! Cartesian frames at a point of the tunnel.

use headrace_geometry::tunnel::Yz;

use super::axis::Station;
use super::vector::{Ray, V3, along, dot, sub};

/// An origin and three orthogonal unit vectors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    /// Origin, in the tunnel's frame.
    pub(super) origin: V3,
    /// Axes, in the tunnel's frame.
    pub(super) axes: [V3; 3],
}

impl Frame {
    /// Frame of the axis at a chainage: along the tunnel, left, up. The origin is point (y, z) of the section.
    pub(super) fn across(station: Station, [y, z]: Yz) -> Self {
        let ([tx, ty], [ax, ay]) = (station.tangent, station.at);
        Self { origin: [ax - y * ty, ay + y * tx, z], axes: [[tx, ty, 0.0], [-ty, tx, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// Transforms a point from the tunnel's frame into this one.
    pub(super) fn local(&self, point: V3) -> V3 {
        let from = sub(point, self.origin);
        self.axes.map(|axis| dot(from, axis))
    }

    /// Transforms a ray from the tunnel's frame into this one.
    pub(super) fn local_ray(&self, ray: &Ray) -> Ray {
        Ray { origin: self.local(ray.origin), direction: self.axes.map(|axis| dot(ray.direction, axis)) }
    }

    /// Transforms a direction from this frame into the tunnel's.
    pub(super) fn outwards(&self, local: V3) -> V3 {
        let sum = along([0.0; 3], local[0], self.axes[0]);
        along(along(sum, local[1], self.axes[1]), local[2], self.axes[2])
    }
}
