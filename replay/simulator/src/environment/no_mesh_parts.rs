//! Replaces `mesh_parts.rs` in a build without the feature `mesh`.

use super::vector::{Face, Ray, V3};

/// A wall of triangles. In a build without the feature `mesh`, the type has no values.
#[derive(Debug, Clone)]
pub(super) enum MeshWall {}

impl MeshWall {
    pub(super) fn feature(&self) -> u16 {
        match *self {}
    }

    pub(super) fn span_m(&self) -> (f64, f64) {
        match *self {}
    }

    pub(super) fn holds(&self, _point: V3) -> bool {
        match *self {}
    }

    pub(super) fn leave(&self, _ray: &Ray, _t_m: f64, _until_m: f64) -> Option<(f64, Face)> {
        match *self {}
    }
}
