//! Mesh files: which format, and what their readers share.

use core::fmt;

use super::error::{MeshError, Place};
use super::{obj, ply, stl};

/// A format of mesh files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// Stanford's polygon format, text or binary.
    Ply,
    /// Wavefront's object format.
    Obj,
    /// Stereolithography, text or binary.
    Stl,
}

impl MeshFormat {
    /// The format that a file's extension (without the dot, in either case) stands for, if any.
    pub fn from_extension(extension: &str) -> Option<Self> {
        let all = [("ply", Self::Ply), ("obj", Self::Obj), ("stl", Self::Stl)];
        all.into_iter().find(|(name, _)| name.eq_ignore_ascii_case(extension)).map(|(_, format)| format)
    }

    /// An error at a place of a file of this format.
    pub(super) fn error(
        self,
        place: Place,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> MeshError {
        MeshError::File { format: self, place, expected: expected.into(), found: found.into() }
    }
}

impl fmt::Display for MeshFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ply => "PLY",
            Self::Obj => "OBJ",
            Self::Stl => "STL",
        })
    }
}

/// Triangles as a file has them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Triangles {
    /// Corners, in the file's own units, which are taken as metres.
    pub vertices: Vec<[f64; 3]>,
    /// Numbers of each triangle's corners, either way round.
    pub faces: Vec<[u32; 3]>,
}

impl Triangles {
    /// Adds a polygon as a fan about its first corner.
    pub(super) fn push_polygon(&mut self, corners: &[u32]) {
        if let [first, rest @ ..] = corners {
            for pair in rest.windows(2) {
                self.faces.push([*first, pair[0], pair[1]]);
            }
        }
    }
}

/// The triangles of a mesh file; polygons become fans of triangles.
///
/// Colours, normals, textures, groups and whatever else a file may hold are passed over.
/// Errors: what isn't as the format says, with its line or byte.
/// Allocates: in proportion to `bytes`, whatever counts they claim.
pub fn read(format: MeshFormat, bytes: &[u8]) -> Result<Triangles, MeshError> {
    match format {
        MeshFormat::Ply => ply::read(bytes),
        MeshFormat::Obj => obj::read(bytes),
        MeshFormat::Stl => stl::read(bytes),
    }
}

/// The lines of a text with their numbers, without what ends them.
pub(super) fn lines(bytes: &[u8]) -> impl Iterator<Item = (Place, &[u8])> {
    bytes.split(|&b| b == b'\n').enumerate().map(|(i, line)| (Place::Line(i + 1), line.trim_ascii()))
}

/// The words of a line.
pub(super) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// A word as a number of type `T`, if it is one.
pub(super) fn number<T: core::str::FromStr>(word: &[u8]) -> Option<T> {
    core::str::from_utf8(word).ok()?.parse().ok()
}

/// A finite coordinate from a word.
pub(super) fn coordinate(format: MeshFormat, place: Place, word: Option<&[u8]>) -> Result<f64, MeshError> {
    let value = word.and_then(number).filter(|value: &f64| value.is_finite());
    value.ok_or_else(|| format.error(place, "a finite coordinate", quoted(word)))
}

/// A word of a file for a message: printable and not long.
pub(super) fn quoted(word: Option<&[u8]>) -> String {
    const LONGEST: usize = 40;
    let Some(word) = word else {
        return "nothing".into();
    };
    let shown = word.get(..LONGEST).unwrap_or(word).escape_ascii();
    let more = if word.len() > LONGEST { "..." } else { "" };
    format!("\"{shown}{more}\"")
}
