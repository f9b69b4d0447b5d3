//! Extracts the zero surface of a field on a grid by marching tetrahedra.
//!
//! Each cell is split into six tetrahedra that share the cell's long diagonal. Neighbouring tetrahedra therefore share
//! faces, and no case is ambiguous.

use super::grid::Grid;
use super::mesh::Mesh;
use super::{Xyz, along, dot, sub};

/// Tetrahedra of a cell, as numbers of their corners. The bits of a number are 1 along x, 2 along y and 4 along z.
///
/// Each tetrahedron is a path from corner 0 to corner 7.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];
/// Number of edges that begin at a node. They lead to the other corners of the cell whose least corner is the node.
const EDGES: usize = 7;
const NONE: u32 = u32::MAX;
/// Maximum number of steps of the search for a crossing along an edge.
const STEPS: usize = 24;
/// Tolerance of an edge crossing, as a share of the edge.
const CLOSE_ENOUGH: f64 = 1e-6;

struct Extraction<'a, F> {
    grid: &'a Grid,
    value: F,
    corners: Vec<f64>,
    /// Index of the vertex on each edge; [`NONE`] if the vertex hasn't been created.
    on_edge: Vec<u32>,
    mesh: Mesh,
}

/// The zero surface of `value` within the grid's box. Triangles face the positive side.
pub(super) fn mesh(grid: &Grid, value: impl Fn(Xyz) -> f64) -> Mesh {
    let count: usize = grid.cells.iter().map(|n| n + 1).product();
    let mut extraction = Extraction {
        grid,
        value,
        corners: Vec::new(),
        on_edge: vec![NONE; count * EDGES],
        mesh: Mesh::default(),
    };
    extraction.corners = (0..count).map(|k| (extraction.value)(extraction.place(k))).collect();
    let [nx, ny, nz] = grid.cells;
    for i in 0..nx {
        for j in 0..ny {
            for k in 0..nz {
                extraction.cell((i * (ny + 1) + j) * (nz + 1) + k);
            }
        }
    }
    extraction.mesh
}

impl<F: Fn(Xyz) -> f64> Extraction<'_, F> {
    fn place(&self, corner: usize) -> Xyz {
        let [_, ny, nz] = self.grid.cells.map(|n| n + 1);
        let index = [corner / (ny * nz), corner / nz % ny, corner % nz];
        [0, 1, 2].map(|axis| self.grid.origin[axis] + index[axis] as f64 * self.grid.cell_m)
    }

    fn step(&self, bits: usize) -> usize {
        let [_, ny, nz] = self.grid.cells.map(|n| n + 1);
        (bits & 1) * ny * nz + (bits >> 1 & 1) * nz + (bits >> 2 & 1)
    }

    fn cell(&mut self, first: usize) {
        let above = (0..8).filter(|bits| self.corners[first + self.step(*bits)] >= 0.0).count();
        if above == 0 || above == 8 {
            return;
        }
        for tetrahedron in TETRAHEDRA {
            self.tetrahedron(first, tetrahedron);
        }
    }

    fn tetrahedron(&mut self, first: usize, bits: [usize; 4]) {
        let above = |b: &usize| self.corners[first + self.step(*b)] >= 0.0;
        let (plus, minus): (Vec<usize>, Vec<usize>) = bits.iter().partition(|b| above(b));
        let mut edge = |a: usize, b: usize| self.vertex(first, a.min(b), a.max(b));
        let (ring, towards) = match (plus.as_slice(), minus.as_slice()) {
            ([a], [b, c, d]) | ([b, c, d], [a]) => (vec![edge(*a, *b), edge(*a, *c), edge(*a, *d)], [*a, *b]),
            ([a, b], [c, d]) => (vec![edge(*a, *c), edge(*a, *d), edge(*b, *d), edge(*b, *c)], [*a, *c]),
            _ => return,
        };
        let single_below = minus.len() == 1;
        let [from, to] = if single_below { towards } else { [towards[1], towards[0]] };
        let up = sub(self.place(first + self.step(to)), self.place(first + self.step(from)));
        for k in 2..ring.len() {
            self.triangle([ring[0], ring[k - 1], ring[k]], up);
        }
    }

    /// Adds a triangle facing the direction `up`.
    fn triangle(&mut self, [a, b, c]: [u32; 3], up: Xyz) {
        let at = |k: u32| self.mesh.vertices[k as usize];
        let (u, v) = (sub(at(b), at(a)), sub(at(c), at(a)));
        let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        self.mesh.triangles.push(if dot(normal, up) >= 0.0 { [a, b, c] } else { [a, c, b] });
    }

    /// The vertex on the edge between two corners of a cell.
    fn vertex(&mut self, first: usize, from: usize, to: usize) -> u32 {
        let corner = first + self.step(from);
        let slot = corner * EDGES + (to - from) - 1;
        if self.on_edge[slot] == NONE {
            let place = self.crossing(corner, first + self.step(to));
            // A grid has at most 16 million nodes, and the surface crosses far fewer than 4 billion edges.
            self.on_edge[slot] = u32::try_from(self.mesh.vertices.len()).unwrap_or(NONE);
            self.mesh.vertices.push(place);
        }
        self.on_edge[slot]
    }

    /// Finds the crossing of an edge by false position, with a bisection in every third step.
    fn crossing(&self, from: usize, to: usize) -> Xyz {
        let (start, way) = (self.place(from), sub(self.place(to), self.place(from)));
        let (mut low, mut high) = ((0.0, self.corners[from]), (1.0, self.corners[to]));
        for step in 0..STEPS {
            let share = if step % 3 == 2 { 0.5 } else { low.1 / (low.1 - high.1) };
            let t = low.0 + share * (high.0 - low.0);
            let here = (t, (self.value)(along(start, way, t)));
            if (here.1 >= 0.0) == (low.1 >= 0.0) {
                low = here;
            } else {
                high = here;
            }
            if high.0 - low.0 < CLOSE_ENOUGH || here.1 == 0.0 {
                break;
            }
        }
        let share = low.1 / (low.1 - high.1);
        let share = if share.is_finite() { share } else { 0.5 };
        along(start, way, low.0 + share * (high.0 - low.0))
    }
}

#[cfg(test)]
mod tests {
    use super::super::norm;
    use super::*;
    use std::collections::BTreeMap;

    const GRID: Grid = Grid { origin: [-1.5, -1.5, -1.5], cell_m: 0.2, cells: [15, 15, 15] };

    #[test]
    fn sphere_mesh_is_closed_and_faces_outwards() {
        let sphere = mesh(&GRID, |p| norm(p) - 1.0);
        assert!(sphere.vertices.iter().all(|p| (norm(*p) - 1.0).abs() < 1e-5));
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for [a, b, c] in &sphere.triangles {
            for (u, v) in [(a, b), (b, c), (c, a)] {
                *edges.entry((*u.min(v), *u.max(v))).or_default() += if u < v { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|both_ways| *both_ways == 0));
        assert_eq!(sphere.vertices.len() + sphere.triangles.len(), edges.len() + 2, "Euler's formula");
        let volume: f64 = sphere
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|k| sphere.vertices[k as usize]);
                let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
                dot(a, cross) / 6.0
            })
            .sum();
        let exact = 4.0 / 3.0 * headrace_geometry::math::PI;
        assert!(volume < exact && volume > 0.98 * exact, "{volume}");
    }

    #[test]
    fn surface_through_grid_corners_is_meshed() {
        let plane = mesh(&GRID, |p| ((p[0] + 1.5) / 0.2).round() - 5.0);
        assert!(plane.triangles.len() >= 15 * 15 * 2);
        let none = mesh(&GRID, |_| 1.0);
        assert!(none.triangles.is_empty());
    }
}
