//! Triangle meshes and the distance to them.

use headrace_geometry::math;

use super::{Xyz, dot, norm, sub};

/// A surface made of triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Mesh {
    /// Positions of the vertices, m.
    pub vertices: Vec<Xyz>,
    /// Triangles, each as three vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// Triangles sorted into cubic bins, to find the triangle nearest to a position.
#[derive(Debug, Clone)]
pub(crate) struct MeshIndex<'a> {
    mesh: &'a Mesh,
    origin: Xyz,
    bin_m: f64,
    bins: [i64; 3],
    /// Index in `members` of each bin's first triangle, followed by the length of `members`.
    starts: Vec<usize>,
    members: Vec<u32>,
}

/// Maximum number of bins in which the triangles are sorted.
const BINS_MAX: f64 = 4e6;

impl MeshIndex<'_> {
    /// Builds the index with bins of side `bin_m`, m. The side should be about that of a triangle.
    ///
    /// The side is enlarged if it gives too many bins. Returns `None` for a mesh without triangles, with an invalid
    /// vertex index, or with a vertex that isn't finite.
    pub(crate) fn new(mesh: &Mesh, bin_m: f64) -> Option<MeshIndex<'_>> {
        let known = |t: &[u32; 3]| t.iter().all(|k| (*k as usize) < mesh.vertices.len());
        let finite = |p: &Xyz| p.iter().all(|c| c.is_finite());
        let (least, most) = bounds(&mesh.vertices);
        let good = mesh.triangles.iter().all(known) && mesh.vertices.iter().all(finite) && bin_m > 0.0;
        if mesh.triangles.is_empty() || !good {
            return None;
        }
        let counted =
            |side: f64| -> f64 { sub(most, least).iter().map(|e| (e / side).floor() + 1.0).product() };
        let mut bin_m = bin_m;
        while counted(bin_m) > BINS_MAX {
            bin_m *= 2.0;
        }
        let bins = sub(most, least).map(|extent| math::floor_to_i64(extent / bin_m) + 1);
        let mut index =
            MeshIndex { mesh, origin: least, bin_m, bins, starts: Vec::new(), members: Vec::new() };
        index.sort();
        Some(index)
    }

    /// Sorts the triangles into bins: counts the triangles of each bin, then inserts them.
    fn sort(&mut self) {
        let count = crate::index(self.bins.iter().product());
        let mut starts = vec![0_usize; count + 1];
        self.each(|bin, _| starts[bin + 1] += 1);
        for bin in 0..count {
            starts[bin + 1] += starts[bin];
        }
        let mut members = vec![0_u32; starts[count]];
        let mut next = starts.clone();
        self.each(|bin, triangle| {
            members[next[bin]] = triangle;
            next[bin] += 1;
        });
        self.starts = starts;
        self.members = members;
    }

    /// Calls `call` with each bin that a triangle's bounding box touches, and with the triangle's number.
    fn each(&self, mut call: impl FnMut(usize, u32)) {
        for (triangle, number) in self.mesh.triangles.iter().zip(0_u32..) {
            let (least, most) = bounds(&triangle.map(|k| self.mesh.vertices[k as usize]));
            let (from, to) = (self.bin(least), self.bin(most));
            for i in from[0]..=to[0] {
                for j in from[1]..=to[1] {
                    for k in from[2]..=to[2] {
                        if let Some(bin) = self.slot([i, j, k]) {
                            call(bin, number);
                        }
                    }
                }
            }
        }
    }

    fn bin(&self, place: Xyz) -> [i64; 3] {
        sub(place, self.origin).map(|d| math::floor_to_i64(d / self.bin_m))
    }

    fn slot(&self, bin: [i64; 3]) -> Option<usize> {
        let within = bin.iter().zip(&self.bins).all(|(b, n)| (0..*n).contains(b));
        within.then(|| crate::index((bin[0] * self.bins[1] + bin[1]) * self.bins[2] + bin[2]))
    }

    /// Distance from a position to the mesh, m. The position must be within about a million bins of the mesh.
    pub(crate) fn distance_m(&self, place: Xyz) -> f64 {
        let centre = self.bin(place);
        let outside = centre.iter().zip(&self.bins).map(|(c, n)| (-c).max(c - (n - 1)).max(0));
        let first = outside.max().unwrap_or(0);
        let last = centre.iter().zip(&self.bins).map(|(c, n)| (n - 1 - c).max(*c)).max().unwrap_or(0);
        let mut best = f64::INFINITY;
        for shell in first..=last {
            // All bins from this shell on are at least this far from the position, so no nearer triangle is left.
            if best <= (shell - 1) as f64 * self.bin_m {
                break;
            }
            self.shell(centre, shell, |triangle| {
                let corners = self.mesh.triangles[triangle as usize].map(|k| self.mesh.vertices[k as usize]);
                best = best.min(norm(sub(place, nearest_of(place, corners))));
            });
        }
        best
    }

    /// Calls `call` with the triangles of a shell: the bins whose largest offset from `centre` along any axis is
    /// `shell`.
    fn shell(&self, centre: [i64; 3], shell: i64, mut call: impl FnMut(u32)) {
        let reach =
            |axis: usize| (centre[axis] - shell).max(0)..=(centre[axis] + shell).min(self.bins[axis] - 1);
        for i in reach(0) {
            for j in reach(1) {
                let on_side = (i - centre[0]).abs() == shell || (j - centre[1]).abs() == shell;
                // Between the shell's sides, only the two bins at its ends along z belong to the shell.
                let step = if on_side || shell == 0 { 1 } else { 2 * shell };
                let from = if on_side { *reach(2).start() } else { centre[2] - shell };
                let mut k = from;
                while k <= centre[2] + shell && k < self.bins[2] {
                    if let Some(bin) = self.slot([i, j, k]) {
                        self.members[self.starts[bin]..self.starts[bin + 1]].iter().for_each(|t| call(*t));
                    }
                    k += step;
                }
            }
        }
    }
}

fn bounds(places: &[Xyz]) -> (Xyz, Xyz) {
    let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for place in places {
        for axis in 0..3 {
            least[axis] = least[axis].min(place[axis]);
            most[axis] = most[axis].max(place[axis]);
        }
    }
    (least, most)
}

/// The point of a triangle nearest to `place`.
///
/// This is the foot of the perpendicular on the triangle's plane if the foot is inside the triangle, and otherwise a
/// point on an edge.
fn nearest_of(place: Xyz, [a, b, c]: [Xyz; 3]) -> Xyz {
    let (u, v, w) = (sub(b, a), sub(c, a), sub(place, a));
    let (uu, uv, vv, uw, vw) = (dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w));
    let determinant = uu * vv - uv * uv;
    let (s, t) = ((vv * uw - uv * vw) / determinant, (uu * vw - uv * uw) / determinant);
    // A triangle without area gives NaN, for which the comparison fails.
    if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
        return [0, 1, 2].map(|k| a[k] + s * u[k] + t * v[k]);
    }
    let feet = [on_edge(place, a, b), on_edge(place, b, c), on_edge(place, c, a)];
    let far = |p: &Xyz| dot(sub(place, *p), sub(place, *p));
    feet.into_iter().min_by(|p, q| far(p).total_cmp(&far(q))).unwrap_or(a)
}

fn on_edge(place: Xyz, from: Xyz, to: Xyz) -> Xyz {
    let way = sub(to, from);
    let length2 = dot(way, way);
    let share = if length2 > 0.0 { (dot(sub(place, from), way) / length2).clamp(0.0, 1.0) } else { 0.0 };
    super::along(from, way, share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heap() -> Mesh {
        let at = |k: u32, scale: f64| {
            let t = f64::from(k) * 0.754_877;
            [math::sin(t * 3.1) * scale, math::sin(t * 5.3) * scale * 0.4, math::cos(t * 7.7) * scale * 0.3]
        };
        let mut mesh = Mesh::default();
        for k in 0..300 {
            let first = u32::try_from(mesh.vertices.len()).unwrap();
            let base = at(k, 5.0);
            mesh.vertices.push(base);
            mesh.vertices.push(super::super::along(base, at(k + 1000, 0.5), 1.0));
            mesh.vertices.push(super::super::along(base, at(k + 2000, 0.5), 1.0));
            mesh.triangles.push([first, first + 1, first + 2]);
        }
        // Degenerate triangles: a line, a point and one long sliver.
        mesh.triangles.push([0, 1, 1]);
        mesh.triangles.push([5, 5, 5]);
        mesh.triangles.push([0, 400, 401]);
        mesh
    }

    #[test]
    fn nearest_triangle_equals_that_of_a_full_search() {
        let mesh = heap();
        for bin_m in [0.1, 0.5, 3.0, 100.0] {
            let index = MeshIndex::new(&mesh, bin_m).unwrap();
            for k in 0..400 {
                let t = f64::from(k);
                let place = [
                    math::sin(t) * 9.0,
                    math::sin(t * 1.7) * 4.0,
                    math::sin(t * 2.3) * 30.0 / (1.0 + t % 7.0),
                ];
                let corners = |t: &[u32; 3]| t.map(|k| mesh.vertices[k as usize]);
                let all = mesh.triangles.iter().map(|t| norm(sub(place, nearest_of(place, corners(t)))));
                let least = all.fold(f64::INFINITY, f64::min);
                assert_eq!(index.distance_m(place).to_bits(), least.to_bits(), "{bin_m} {place:?}");
            }
        }
    }

    #[test]
    fn nearest_point_matches_a_dense_search() {
        let corners = [[0.0, 0.0, 0.0], [2.0, 0.1, 0.3], [0.4, 1.5, -0.2]];
        for k in 0..200 {
            let t = f64::from(k);
            let place = [math::sin(t) * 3.0, math::sin(t * 1.3) * 3.0, math::sin(t * 1.9)];
            let mut least = f64::INFINITY;
            for i in 0..=200 {
                for j in 0..=200 - i {
                    let (s, t) = (f64::from(i) / 200.0, f64::from(j) / 200.0);
                    let at = [0, 1, 2]
                        .map(|a| (1.0 - s - t) * corners[0][a] + s * corners[1][a] + t * corners[2][a]);
                    least = least.min(norm(sub(place, at)));
                }
            }
            let exact = norm(sub(place, nearest_of(place, corners)));
            assert!(exact <= least + 1e-12 && exact > least - 0.01, "{place:?} {exact} {least}");
        }
    }

    #[test]
    fn empty_mesh_has_no_index() {
        assert!(MeshIndex::new(&Mesh::default(), 1.0).is_none());
        let broken = Mesh { vertices: vec![[0.0; 3]], triangles: vec![[0, 0, 1]] };
        assert!(MeshIndex::new(&broken, 1.0).is_none());
        assert!(MeshIndex::new(&heap(), 0.0).is_none());
    }
}
