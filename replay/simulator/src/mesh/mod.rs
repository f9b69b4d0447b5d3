//! Triangle meshes from PLY files for the simulator: a stretch of the tunnel's wall, or a body in the water.
//!
//! The constructor checks that no ray from inside can leave through a gap between triangles. The winding of the
//! triangles does not matter.

mod check;
mod error;
mod geometry;
mod ply;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_check;
#[cfg(test)]
mod tests_read;

use std::cell::Cell;

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use check::Surface;
use geometry::{Crossing, Ray};

pub use check::Role;
pub use error::MeshError;
pub use ply::{Triangles, read};

/// Margin of the tree's boxes around their contents, as a share of the mesh's size.
///
/// The margin exceeds the rounding error of a triangle that is hit from up to a thousand times the mesh's size.
const SLACK: f64 = 1e-12;

/// Directions of the rays that test whether a point is inside.
///
/// The directions avoid the axes and planes that are likely in meshes. They point mostly across the tunnel, because
/// rays in these directions are short.
const WAYS_OUT: [[f64; 3]; 6] = [
    [0.137, 0.811, 0.573],
    [-0.219, -0.547, 0.829],
    [0.173, 0.677, -0.719],
    [-0.091, -0.911, -0.397],
    [0.593, 0.331, 0.739],
    [-0.701, 0.613, -0.367],
];

/// The point where a ray hits a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshHit {
    /// Distance from the ray's origin to the hit, metres.
    pub range_m: f64,
    /// Unit normal of the face, on the side from which the ray comes.
    pub normal: [f64; 3],
    /// Number of the face in the input. If the ray hits several faces at one point, this is the smallest number.
    pub face: u32,
}

/// A checked surface of triangles, with a tree for casting rays. Its coordinates are those of the input, metres.
#[derive(Debug, Clone)]
pub struct Mesh {
    surface: Surface,
    tree: Bvh,
}

impl Mesh {
    /// Checks triangles and builds the tree for casting rays.
    ///
    /// Vertices closer than 1e-9 of the mesh's size are welded, and triangles with two corners in one place are
    /// dropped. Each opening of a wall must lie near an end: within 2 % of the wall's length or 0.5 m, whichever is
    /// larger, but at most within a quarter of the length.
    ///
    /// Errors: a coordinate is out of range, a corner does not exist, there is no face, an edge has more than two
    /// faces, a body or a wall between its ends has a hole, or an end of a wall is closed. Allocates: about 190 bytes
    /// per face, and twice as much during construction. The tree is the same on any machine.
    pub fn new(triangles: Triangles, role: Role) -> Result<Self, MeshError> {
        let mut surface = Surface::new(triangles, role)?;
        let largest = surface.low.iter().chain(&surface.high).fold(0.0_f64, |most, c| most.max(c.abs()));
        let slack = SLACK * (largest + check::diagonal(surface.low, surface.high));
        for cap in &mut surface.caps {
            (cap.low, cap.high) = (cap.low.map(|c| c - slack), cap.high.map(|c| c + slack));
        }
        let boxes = surface.faces.iter().map(|&face| {
            let [a, b, c] = surface.corners(face);
            let low = [0, 1, 2].map(|k| a[k].min(b[k]).min(c[k]) - slack);
            let high = [0, 1, 2].map(|k| a[k].max(b[k]).max(c[k]) + slack);
            Aabb::new(Vector::from(low), Vector::from(high))
        });
        let tree = Bvh::from_iter(BvhBuildStrategy::Binned, boxes.enumerate());
        Ok(Self { surface, tree })
    }

    /// The nearest hit of a ray on the mesh, from either side, no farther than `far_m`.
    ///
    /// A ray that starts on the surface hits it at range 0. `direction_unit` must have length 1. The result is `None`
    /// if there is no hit, or if a component of `origin` or `direction_unit` is not finite.
    pub fn cast(&self, origin: [f64; 3], direction_unit: [f64; 3], far_m: f64) -> Option<MeshHit> {
        let ray = Ray::new(origin, direction_unit, far_m);
        // Range and face of the best hit. At equal ranges, the smallest face number is taken, because the tree alone
        // would return the hit that it visits first.
        let best: Cell<Option<(f64, u32)>> = Cell::new(None);
        self.tree.find_best(
            f64::MAX,
            |node, _| enters(&ray, node),
            |leaf, _| {
                let range = ray.hits(self.surface.triangle(leaf))?;
                if best.get().is_none_or(|(least, first)| range < least || (range <= least && leaf < first)) {
                    best.set(Some((range, leaf)));
                }
                Some(range)
            },
        );
        let (range_m, leaf) = best.get()?;
        let normal = geometry::normal_against(self.surface.triangle(leaf), direction_unit);
        Some(MeshHit { range_m, normal, face: self.surface.given[leaf as usize] })
    }

    /// Whether a point is in the solid, or within the wall and between its ends.
    ///
    /// This function counts how often a ray from the point crosses the surface. An odd number means inside. The
    /// openings of a wall are closed by triangles, which extend from an opening's centroid to its edges. If the ray
    /// touches an edge, a ray in another direction is tried. If all rays touch edges, the point is on the surface and
    /// counts as inside. A point in two overlapping parts of the mesh counts as outside.
    pub fn contains(&self, point: [f64; 3]) -> bool {
        let (low, high) = self.bounds();
        // All comparisons with NaN are false, so the negated condition counts a point with NaN as outside.
        if !(0..3).all(|k| point[k] >= low[k] && point[k] <= high[k]) {
            return false;
        }
        WAYS_OUT
            .iter()
            .find_map(|&way| self.is_crossed_oddly(&Ray::new(point, way, f64::MAX)))
            .unwrap_or(true)
    }

    /// Whether a ray crosses the closed surface an odd number of times; `None` if the ray touches an edge.
    fn is_crossed_oddly(&self, ray: &Ray) -> Option<bool> {
        let leaves = self.tree.leaves(|node| enters(ray, node) < f64::MAX);
        let met = leaves.map(|leaf| self.surface.triangle(leaf));
        let caps = self.surface.caps.iter().filter(|cap| ray.enters(cap.low, cap.high) < f64::MAX);
        let closing = caps.flat_map(|cap| cap.triangles.iter().copied());
        let mut is_odd = false;
        for triangle in met.chain(closing) {
            match ray.crosses(triangle) {
                Crossing::Beside => {}
                Crossing::Through => is_odd = !is_odd,
                Crossing::Unclear => return None,
            }
        }
        Some(is_odd)
    }

    /// Corners of the bounding box: least and greatest coordinates, metres.
    pub fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        (self.surface.low, self.surface.high)
    }

    /// The least and the greatest x between which the mesh is closed all round, metres.
    ///
    /// The openings of a wall lie at or beyond these two planes.
    pub fn closed_m(&self) -> (f64, f64) {
        let (low, high) = (self.surface.low[0], self.surface.high[0]);
        let middle = f64::midpoint(low, high);
        let triangles = self.surface.caps.iter().flat_map(|cap| cap.triangles.as_flattened());
        let rims = triangles.map(|corner| corner[0]);
        rims.fold((low, high), |(from, to), x| if x < middle { (from.max(x), to) } else { (from, to.min(x)) })
    }
}

fn enters(ray: &Ray, node: &BvhNode) -> f64 {
    ray.enters(node.mins().into(), node.maxs().into())
}
