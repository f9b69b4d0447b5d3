//! Meshes as parts of the environment: bodies in the water, and walls in place of the tube's wall.

use std::sync::Arc;

use super::vector::{Face, Frame, Ray, V3};
use crate::mesh::Mesh;

/// Least distance of a point from the end planes of a mesh wall, m. A point nearer to an end plane is moved to this
/// distance, because the mesh is open in the end plane.
const INTO_M: f64 = 1e-7;

/// A closed mesh that is a body in the water.
#[derive(Debug, Clone)]
pub(super) struct MeshBody {
    pub(super) frame: Frame,
    pub(super) mesh: Arc<Mesh>,
}

/// A mesh that is the tunnel's wall between two chainages.
#[derive(Debug, Clone)]
pub(super) struct MeshWall {
    pub(super) feature: u16,
    pub(super) from_m: f64,
    pub(super) to_m: f64,
    /// Start and end of the wall on the x-axis of the mesh, m.
    pub(super) x_m: (f64, f64),
    pub(super) frame: Frame,
    pub(super) mesh: Arc<Mesh>,
}

impl MeshBody {
    /// First hit of a ray on the body: the range, or 0 if the ray starts inside, and the outward normal.
    pub(super) fn meet(&self, ray: &Ray) -> Option<(f64, V3)> {
        let local = self.frame.local_ray(ray);
        let hit = self.mesh.cast(local.origin, local.direction, f64::MAX)?;
        let range_m = if self.mesh.contains(local.origin) { 0.0 } else { hit.range_m };
        Some((range_m, self.frame.outwards(hit.normal)))
    }

    /// Whether `point` is inside the body.
    pub(super) fn contains(&self, point: V3) -> bool {
        self.mesh.contains(self.frame.local(point))
    }
}

impl MeshWall {
    /// Number of the feature with this mesh.
    pub(super) fn feature(&self) -> u16 {
        self.feature
    }

    /// Chainages between which the mesh is the tunnel's wall, m.
    pub(super) fn span_m(&self) -> (f64, f64) {
        (self.from_m, self.to_m)
    }

    /// Whether a point between the end planes, or on an end plane, is in the tunnel.
    pub(super) fn holds(&self, point: V3) -> bool {
        self.mesh.contains(self.between_ends(self.frame.local(point)))
    }

    /// First hit of the ray on the mesh, searched from `t_m` to `until_m`. At range `until_m` the ray passes an end
    /// plane of the wall.
    pub(super) fn leave(&self, ray: &Ray, t_m: f64, until_m: f64) -> Option<(f64, Face)> {
        let local = self.frame.local_ray(ray);
        // A ray that starts at a point enclosed by the mesh can leave it without a hit only through the ends.
        let from = self.between_ends(local.at(t_m));
        let hit = self.mesh.cast(from, local.direction, until_m - t_m)?;
        let face = Face { normal: self.frame.outwards(hit.normal), feature: Some(self.feature) };
        Some(((t_m + hit.range_m).min(until_m), face))
    }

    fn between_ends(&self, [x, y, z]: V3) -> V3 {
        let (low_m, high_m) = self.x_m;
        [x.max(low_m + INTO_M).min(high_m - INTO_M), y, z]
    }
}
