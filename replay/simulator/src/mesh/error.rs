//! Errors in a mesh or its file, with their location.

use core::fmt;

/// Why a mesh can't be used. Positions are in the file's own axes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The file can't be read as PLY.
    #[error("reading PLY: {0}")]
    File(String),
    /// The mesh has no triangle left.
    #[error("the mesh has no face ({given} given; those with two corners in one place don't count)")]
    NoFaces {
        /// Number of triangles given, each with two corners in one place.
        given: usize,
    },
    /// More elements than 32 bits can number.
    #[error("the mesh has {given} {what}; at most {} can be numbered", u32::MAX)]
    TooMany {
        /// Kind of element.
        what: &'static str,
        /// Their number.
        given: usize,
    },
    /// A triangle refers to a vertex that doesn't exist.
    #[error("face {face} has vertex {vertex} as a corner, of {vertices} vertices (both counted from 0)")]
    NoSuchVertex {
        /// Number of the face.
        face: usize,
        /// The corner.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A vertex whose coordinates aren't finite or are too large.
    #[error("vertex {vertex} (counted from 0) is at {}; coordinates must be finite and within 100 km of 0", At(*at))]
    FarVertex {
        /// Number of the vertex.
        vertex: usize,
        /// Its coordinates, metres.
        at: [f64; 3],
    },
    /// More than two triangles meet at an edge, so that no side is inside.
    #[error("{faces} faces share the edge from {} to {}; at most 2 may", At(*from), At(*to))]
    NonManifold {
        /// One end of the edge, metres.
        from: [f64; 3],
        /// The other end, metres.
        to: [f64; 3],
        /// Faces that have this edge.
        faces: usize,
    },
    /// A body isn't closed, or a wall is open elsewhere than at its ends.
    #[error("the mesh has {holes} hole(s) where it must be closed; the largest has {edges} edges, one of them at {}", At(*at))]
    Hole {
        /// Number of holes, except a wall's open ends.
        holes: usize,
        /// Edges around the largest.
        edges: usize,
        /// A vertex on its rim, metres.
        at: [f64; 3],
    },
    /// A wall must be open at both ends.
    #[error(
        "the wall is closed at its end at x = {x_m:.3} m; it must have an opening within {within_m:.3} m of it"
    )]
    ClosedEnd {
        /// Where the mesh ends, metres.
        x_m: f64,
        /// Distance from there within which all vertices of an opening must lie, metres.
        within_m: f64,
    },
}

/// A position as text.
struct At([f64; 3]);

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0;
        write!(f, "({x:.3}, {y:.3}, {z:.3})")
    }
}
