//! Builds a surface of triangles: welds coinciding vertices and checks that the surface is closed where its role
//! requires it.

use std::collections::BTreeMap;

use headrace_geometry::math;

use super::error::MeshError;
use super::ply::Triangles;

/// Role of a mesh in a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The tunnel's wall over the extent of the mesh along x, open at both ends and closed in between.
    Wall,
    /// A closed solid body in the water.
    Body,
}

/// Largest allowed coordinate, metres. A larger coordinate indicates a wrong unit or origin.
const FAR_M: f64 = 100_000.0;
/// Largest distance at which two vertices are welded into one, as a share of the mesh's diagonal.
const WELD: f64 = 1e-9;
/// Largest distance of a wall's opening from an end of the mesh, as a share of the wall's length. If [`END_M`] is the
/// larger distance, it applies instead.
const END: f64 = 0.02;
/// Largest distance of a wall's opening from an end of the mesh, metres, if it is larger than the distance by [`END`].
/// Neither limit may exceed a quarter of the wall's length, so that the ends stay apart.
const END_M: f64 = 0.5;

/// A checked surface of triangles.
#[derive(Debug, Clone)]
pub(super) struct Surface {
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) faces: Vec<[u32; 3]>,
    /// Number that each face has in the input.
    pub(super) given: Vec<u32>,
    /// Triangles that close the openings of a wall, one cap for each opening.
    pub(super) caps: Vec<Cap>,
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

/// Triangles that close an opening of a wall, and their bounding box.
#[derive(Debug, Clone)]
pub(super) struct Cap {
    pub(super) triangles: Vec<[[f64; 3]; 3]>,
    pub(super) low: [f64; 3],
    pub(super) high: [f64; 3],
}

/// A hole in the surface: connected edges, each of which belongs to only one face.
struct Hole {
    edges: Vec<[u32; 2]>,
    low_x: f64,
    high_x: f64,
}

impl Surface {
    /// Welds vertices, drops triangles with two coinciding corners, and checks the surface.
    pub(super) fn new(triangles: Triangles, role: Role) -> Result<Self, MeshError> {
        let Triangles { mut vertices, faces } = triangles;
        numbers(&vertices, &faces)?;
        let (low, high) = bounds(&vertices, &faces);
        let welded = weld(&vertices, low, diagonal(low, high));
        let mut kept = Vec::with_capacity(faces.len());
        let mut given = Vec::with_capacity(faces.len());
        for (number, face) in (0..).zip(&faces) {
            let [a, b, c] = face.map(|corner| welded[corner as usize]);
            if a != b && b != c && c != a {
                kept.push([a, b, c]);
                given.push(number);
            }
        }
        if kept.is_empty() {
            return Err(MeshError::NoFaces { given: faces.len() });
        }
        let holes = holes(&vertices, &open_edges(&vertices, &kept)?);
        let caps = match role {
            Role::Body => {
                refuse(&vertices, &holes.iter().collect::<Vec<_>>())?;
                Vec::new()
            }
            Role::Wall => {
                ends(&vertices, &holes, low[0], high[0])?;
                holes.iter().map(|hole| cap(&vertices, hole)).collect()
            }
        };
        vertices.shrink_to_fit();
        Ok(Self { vertices, faces: kept, given, caps, low, high })
    }

    /// Positions of a face's corners.
    pub(super) fn corners(&self, face: [u32; 3]) -> [[f64; 3]; 3] {
        face.map(|corner| self.vertices[corner as usize])
    }

    /// Positions of the corners of a face, by its number.
    pub(super) fn triangle(&self, number: u32) -> [[f64; 3]; 3] {
        self.corners(self.faces[number as usize])
    }
}

/// Checks the number of elements, the vertex numbers of the faces, and the coordinates.
fn numbers(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<(), MeshError> {
    for (what, given) in [("vertices", vertices.len()), ("faces", faces.len())] {
        if u32::try_from(given).is_err() {
            return Err(MeshError::TooMany { what, given });
        }
    }
    let near = |c: &f64| c.abs() <= FAR_M;
    if let Some(vertex) = vertices.iter().position(|at| !at.iter().all(near)) {
        return Err(MeshError::FarVertex { vertex, at: vertices[vertex] });
    }
    let is_there = |corner: u32| (corner as usize) < vertices.len();
    for (face, corners) in faces.iter().enumerate() {
        if let Some(&vertex) = corners.iter().find(|&&corner| !is_there(corner)) {
            return Err(MeshError::NoSuchVertex { face, vertex, vertices: vertices.len() });
        }
    }
    Ok(())
}

/// Bounding box of the corners of faces. Vertices without a face are ignored.
fn bounds(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> ([f64; 3], [f64; 3]) {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for &corner in faces.as_flattened() {
        for (k, &c) in vertices[corner as usize].iter().enumerate() {
            low[k] = low[k].min(c);
            high[k] = high[k].max(c);
        }
    }
    (low, high)
}

/// Length of a box's diagonal.
pub(super) fn diagonal(low: [f64; 3], high: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|k| high[k] - low[k]);
    math::sqrt(x * x + y * y + z * z)
}

/// Returns, for each vertex, the number of the first vertex to which it is close enough to be welded.
fn weld(vertices: &[[f64; 3]], low: [f64; 3], diagonal: f64) -> Vec<u32> {
    let near = (WELD * diagonal).max(f64::MIN_POSITIVE);
    // A cell of the search grid is several times as wide as the welding distance, so that only one cell is searched for
    // most vertices. A cell is still too small to hold many vertices.
    let cell = 8.0 * near;
    let mut cells: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    let mut welded = Vec::with_capacity(vertices.len());
    for (i, at) in (0..).zip(vertices) {
        let cell_of = |shift: f64| [0, 1, 2].map(|k| math::floor_to_i64((at[k] - low[k] + shift) / cell));
        let (from, own, to) = (cell_of(-near), cell_of(0.0), cell_of(near));
        let is_same = |&&j: &&u32| vertices[j as usize].iter().zip(at).all(|(a, b)| (a - b).abs() <= near);
        let mut first: Option<u32> = None;
        for x in from[0]..=to[0] {
            for y in from[1]..=to[1] {
                for z in from[2]..=to[2] {
                    let found = cells.get(&[x, y, z]).and_then(|places| places.iter().find(is_same));
                    first = first.into_iter().chain(found.copied()).min();
                }
            }
        }
        if first.is_none() {
            cells.entry(own).or_default().push(i);
        }
        welded.push(first.unwrap_or(i));
    }
    welded
}

/// Edges of the surface that belong to only one face.
fn open_edges(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<Vec<[u32; 2]>, MeshError> {
    let mut edges: Vec<[u32; 2]> = Vec::with_capacity(faces.len() * 3);
    for &[a, b, c] in faces {
        edges.extend([[a, b], [b, c], [c, a]].map(|[p, q]| [p.min(q), p.max(q)]));
    }
    edges.sort_unstable();
    let mut open = Vec::new();
    for same in edges.chunk_by(|p, q| p == q) {
        let [from, to] = same[0].map(|corner| vertices[corner as usize]);
        match same.len() {
            1 => open.push(same[0]),
            2 => {}
            faces => return Err(MeshError::NonManifold { from, to, faces }),
        }
    }
    Ok(open)
}

/// Sorts open edges into holes, in the order of their first edges.
fn holes(vertices: &[[f64; 3]], open: &[[u32; 2]]) -> Vec<Hole> {
    // Union-find over the vertices of open edges. The smallest number in each set is the root of the set.
    let mut parent: BTreeMap<u32, u32> = open.as_flattened().iter().map(|&v| (v, v)).collect();
    let mut root = |mut v: u32, w: Option<u32>| {
        let mut path = Vec::new();
        while parent[&v] != v {
            path.push(v);
            v = parent[&v];
        }
        let top = w.map_or(v, |w| w.min(v));
        path.push(v);
        for step in path {
            parent.insert(step, top);
        }
        top
    };
    for &[a, b] in open {
        let (a, b) = (root(a, None), root(b, None));
        root(a, Some(b));
        root(b, Some(a));
    }
    let mut holes: BTreeMap<u32, Hole> = BTreeMap::new();
    for &edge in open {
        let empty = || Hole { edges: Vec::new(), low_x: f64::INFINITY, high_x: f64::NEG_INFINITY };
        let hole = holes.entry(root(edge[0], None)).or_insert_with(empty);
        hole.edges.push(edge);
        for corner in edge {
            let x = vertices[corner as usize][0];
            hole.low_x = hole.low_x.min(x);
            hole.high_x = hole.high_x.max(x);
        }
    }
    holes.into_values().collect()
}

/// Returns an error if there are any holes.
fn refuse(vertices: &[[f64; 3]], holes: &[&Hole]) -> Result<(), MeshError> {
    // If several holes are equally large, the first one is reported.
    let Some(largest) = holes.iter().rev().max_by_key(|hole| hole.edges.len()) else {
        return Ok(());
    };
    let at = vertices[largest.edges[0][0] as usize];
    Err(MeshError::Hole { holes: holes.len(), edges: largest.edges.len(), at })
}

/// Checks that a wall has openings at both ends and nowhere else.
fn ends(vertices: &[[f64; 3]], holes: &[Hole], low_x: f64, high_x: f64) -> Result<(), MeshError> {
    let length = high_x - low_x;
    let within_m = (END * length).max(END_M).min(length / 4.0);
    let at_low = |hole: &Hole| hole.high_x <= low_x + within_m;
    let at_high = |hole: &Hole| hole.low_x >= high_x - within_m;
    let elsewhere: Vec<&Hole> = holes.iter().filter(|hole| !at_low(hole) && !at_high(hole)).collect();
    refuse(vertices, &elsewhere)?;
    if !holes.iter().any(at_low) {
        return Err(MeshError::ClosedEnd { x_m: low_x, within_m });
    }
    if !holes.iter().any(at_high) {
        return Err(MeshError::ClosedEnd { x_m: high_x, within_m });
    }
    Ok(())
}

/// Closes a hole by triangles from the centroid of the rim vertices to each edge.
///
/// Each edge of the hole then has two faces, whatever the hole's shape. It is therefore defined which points are inside
/// the surface.
fn cap(vertices: &[[f64; 3]], hole: &Hole) -> Cap {
    let mut middle = [0.0; 3];
    for &corner in hole.edges.as_flattened() {
        for (sum, c) in middle.iter_mut().zip(vertices[corner as usize]) {
            *sum += c;
        }
    }
    let middle = middle.map(|sum| sum / (2 * hole.edges.len()) as f64);
    let triangle = |&[a, b]: &[u32; 2]| [vertices[a as usize], vertices[b as usize], middle];
    let triangles: Vec<_> = hole.edges.iter().map(triangle).collect();
    // The centroid lies within the bounding box of the edges, so the box may start from it.
    let (mut low, mut high) = (middle, middle);
    for corner in triangles.as_flattened() {
        for k in 0..3 {
            (low[k], high[k]) = (low[k].min(corner[k]), high[k].max(corner[k]));
        }
    }
    Cap { triangles, low, high }
}
