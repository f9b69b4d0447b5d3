//! In place of `meshes.rs` in a build without the feature `mesh`: there are none, and a scene that has one is refused.

use headrace_config::{ConfigError, Section};

use super::bulge::Bulge;
use super::features::{self, Kind, Placed, Site};
use super::shapes::Solid;
use super::tube::Face;
use super::vector::{Ray, V3};
use crate::simulate::FileLoader;

/// A wall of triangles, which can't be.
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

/// Refuses a mesh.
///
/// Errors: there is one, or a table has no kind.
pub(super) fn parse(
    tables: &[Section<'_>],
    _site: &Site<'_>,
    _bulges: &[Bulge],
    _load: FileLoader<'_>,
) -> Result<(Vec<MeshWall>, Vec<Placed<Solid>>), ConfigError> {
    for table in tables {
        if features::kind(table)? == Kind::Mesh {
            let problem = "needs a build with the feature mesh: cargo build --features mesh";
            return Err(table.invalid("kind", problem));
        }
    }
    Ok((Vec::new(), Vec::new()))
}
