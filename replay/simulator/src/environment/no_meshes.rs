//! Replaces `meshes.rs` in a build without the feature `mesh`. Scenes with meshes are refused.

use headrace_config::{ConfigError, Section};

use super::bulge::Bulge;
use super::keys::{self, Kind};
use super::mesh_parts::MeshWall;
use super::placing::{Placed, Site};
use super::shapes::Solid;
use crate::file_loader::FileLoader;

/// Refuses meshes.
///
/// Errors: a table is a mesh or has no kind.
pub(super) fn parse(
    tables: &[Section<'_>],
    _site: &Site<'_>,
    _bulges: &[Bulge],
    _load: FileLoader<'_>,
) -> Result<(Vec<MeshWall>, Vec<Placed<Solid>>), ConfigError> {
    for table in tables {
        if keys::kind(table)? == Kind::Mesh {
            let problem = "needs a build with the feature mesh: cargo build --features mesh";
            return Err(table.invalid("kind", problem));
        }
    }
    Ok((Vec::new(), Vec::new()))
}
