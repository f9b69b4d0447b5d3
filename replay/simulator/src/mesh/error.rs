//! Errors in a mesh or its file, with their location.

use core::fmt;

/// A reason why a mesh cannot be used. Positions are in the file's own axes.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// The mesh file cannot be read as PLY.
    #[error("reading PLY: {0}")]
    File(String),
    /// No triangle is left in the mesh after triangles with two coinciding corners are dropped.
    #[error("the mesh has no face ({given} given; triangles with two equal corners are ignored)")]
    NoFaces {
        /// Number of triangles in the input. Each has two coinciding corners.
        given: usize,
    },
    /// The mesh has more elements than 32 bits can number.
    #[error("the mesh has {given} {what}; at most {} are allowed", u32::MAX)]
    TooMany {
        /// Kind of element: vertices or faces.
        what: &'static str,
        /// Number of elements of this kind in the mesh.
        given: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error("face {face} refers to vertex {vertex}, but there are {vertices} vertices (both counted from 0)")]
    NoSuchVertex {
        /// Number of the face that refers to a missing vertex.
        face: usize,
        /// Number of the missing vertex.
        vertex: u32,
        /// Number of vertices in the mesh.
        vertices: usize,
    },
    /// A coordinate of a vertex is too large or not finite.
    #[error("vertex {vertex} (counted from 0) is at {}; coordinates must be finite and within 100 km of 0", At(*at))]
    FarVertex {
        /// Number of the vertex with the invalid coordinate.
        vertex: usize,
        /// Coordinates of the vertex, metres.
        at: [f64; 3],
    },
    /// More than two triangles meet at an edge, so the inside is undefined.
    #[error("{faces} faces share the edge from {} to {}; at most 2 may", At(*from), At(*to))]
    NonManifold {
        /// One end of the edge, metres.
        from: [f64; 3],
        /// The other end of the edge, metres.
        to: [f64; 3],
        /// Number of faces that meet at the edge.
        faces: usize,
    },
    /// A mesh that is a body has a hole, or a mesh that is a wall has a hole between its ends.
    #[error("the mesh has {holes} hole(s) where it must be closed; the largest has {edges} edges, one of them at {}", At(*at))]
    Hole {
        /// Number of holes, without the open ends of a wall.
        holes: usize,
        /// Number of edges around the largest hole.
        edges: usize,
        /// A vertex on the rim of the largest hole, metres.
        at: [f64; 3],
    },
    /// An end of a mesh that is a wall is closed.
    #[error(
        "the wall is closed at its end at x = {x_m:.3} m; it must have an opening within {within_m:.3} m of it"
    )]
    ClosedEnd {
        /// x-coordinate of the end of the mesh, metres.
        x_m: f64,
        /// Largest allowed distance from the end to the vertices of an opening, metres.
        within_m: f64,
    },
}

/// Formats a position as text.
struct At([f64; 3]);

impl fmt::Display for At {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = self.0;
        write!(f, "({x:.3}, {y:.3}, {z:.3})")
    }
}
