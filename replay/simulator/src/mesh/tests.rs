//! Tests with generated meshes: rays, inside tests and checks.

use std::collections::BTreeMap;

use headrace_geometry::math;

use super::*;

/// A generator of pseudo-random numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// The next pseudo-random number in [-1, 1).
    fn signed(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn index(&mut self, below: usize) -> usize {
        usize::try_from(self.bits() % below as u64).unwrap()
    }

    fn unit(&mut self) -> [f64; 3] {
        loop {
            let v = [self.signed(), self.signed(), self.signed()];
            let square = v.iter().map(|c| c * c).sum::<f64>();
            if (0.01..1.0).contains(&square) {
                return v.map(|c| c / math::sqrt(square));
            }
        }
    }
}

fn sum(p: [f64; 3], q: [f64; 3], factor: f64) -> [f64; 3] {
    [0, 1, 2].map(|k| p[k] + factor * q[k])
}

fn dot(p: [f64; 3], q: [f64; 3]) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3])
}

/// Unit vector and distance from one point to another.
fn toward(from: [f64; 3], to: [f64; 3]) -> ([f64; 3], f64) {
    let d = sum(to, from, -1.0);
    let length = math::sqrt(dot(d, d));
    (d.map(|c| c / length), length)
}

/// A box from -`half` to `half` on each axis. Its faces are in the order -x, +x, -y, +y, -z, +z.
pub(super) fn cuboid(half: [f64; 3]) -> Triangles {
    let corner = |i: u32| [0, 1, 2].map(|k| if i >> k & 1 == 1 { half[k] } else { -half[k] });
    let mut faces = Vec::new();
    for axis in 0..3_u32 {
        let (u, v) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        for base in [0, 1 << axis] {
            faces.extend([[base, base + u, base + u + v], [base, base + u + v, base + v]]);
        }
    }
    Triangles { vertices: (0..8).map(corner).collect(), faces }
}

/// An icosahedron with each face split in four `levels` times. `radius_m` is called for the radius of each vertex.
pub(super) fn icosphere(levels: usize, mut radius_m: impl FnMut() -> f64) -> Triangles {
    let g = f64::midpoint(1.0, math::sqrt(5.0));
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    for (a, b) in [(1.0, g), (-1.0, g), (1.0, -g), (-1.0, -g)] {
        vertices.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let near = |p: [f64; 3], q: [f64; 3]| dot(sum(p, q, -1.0), sum(p, q, -1.0)) < 4.1;
    let mut faces = Vec::new();
    for i in 0..12_u32 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [i, j, k].map(|i| vertices[i as usize]);
                if near(a, b) && near(b, c) && near(c, a) {
                    faces.push([i, j, k]);
                }
            }
        }
    }
    for _ in 0..levels {
        let mut middles = BTreeMap::new();
        let mut middle = |p: u32, q: u32| {
            *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                vertices.push(sum(vertices[p as usize], vertices[q as usize], 1.0));
                u32::try_from(vertices.len()).unwrap() - 1
            })
        };
        let old = std::mem::take(&mut faces);
        for [a, b, c] in old {
            let (x, y, z) = (middle(a, b), middle(b, c), middle(c, a));
            faces.extend([[a, x, z], [x, b, y], [z, y, c], [x, y, z]]);
        }
        for v in &mut vertices {
            *v = toward([0.0; 3], *v).0;
        }
    }
    let vertices = vertices.into_iter().map(|v| toward([0.0; 3], v).0);
    let vertices = vertices
        .map(|v| {
            let r = radius_m();
            v.map(|c| c * r)
        })
        .collect();
    Triangles { vertices, faces }
}

/// A tube about the x-axis with open ends. `radius_m` is called for the radius of each vertex.
pub(super) fn tube(rings: u32, around: u32, length_m: f64, mut radius_m: impl FnMut() -> f64) -> Triangles {
    let mut triangles = Triangles::default();
    for i in 0..=rings {
        for j in 0..around {
            let (sin, cos) = math::sin_cos(math::TAU * f64::from(j) / f64::from(around));
            let r = radius_m();
            triangles.vertices.push([length_m * f64::from(i) / f64::from(rings), r * sin, r * cos]);
        }
    }
    for i in 0..rings {
        for j in 0..around {
            let [a, b] = [j, (j + 1) % around].map(|j| i * around + j);
            triangles.faces.extend([[a, b, a + around], [b, b + around, a + around]]);
        }
    }
    triangles
}

fn rough_body() -> Triangles {
    let mut random = Random(1);
    icosphere(4, || 3.0 + 0.2 * random.signed())
}

fn rough_tube() -> Triangles {
    let mut random = Random(2);
    tube(60, 48, 40.0, || 5.0 + random.signed())
}

/// Range of the nearest hit by the Moller-Trumbore method over all triangles; infinite if there is no hit.
///
/// `None` for a ray that passes within a billionth of an edge, because the mesh's own method may give another result
/// there.
fn brute(t: &Triangles, origin: [f64; 3], direction: [f64; 3]) -> Option<f64> {
    let mut nearest = f64::INFINITY;
    for face in &t.faces {
        let [a, b, c] = face.map(|i| t.vertices[i as usize]);
        let (e, f) = (sum(b, a, -1.0), sum(c, a, -1.0));
        let p = cross(direction, f);
        let det = dot(e, p);
        let s = sum(origin, a, -1.0);
        let (u, q) = (dot(s, p) / det, cross(s, e));
        let v = dot(direction, q) / det;
        let range = dot(f, q) / det;
        let inside = u.min(v).min(1.0 - u - v);
        if inside.abs() < 1e-9 || range.abs() < 1e-9 {
            return None;
        }
        if inside > 0.0 && range > 0.0 {
            nearest = nearest.min(range);
        }
    }
    Some(nearest)
}

#[test]
fn ray_hits_match_a_search_over_all_triangles() {
    let sphere = icosphere(3, || 2.0);
    for (triangles, role) in [
        (sphere, Role::Body),
        (rough_body(), Role::Body),
        (cuboid([1.0, 2.0, 3.0]), Role::Body),
        (rough_tube(), Role::Wall),
    ] {
        let mesh = Mesh::new(triangles.clone(), role).unwrap();
        let (low, high) = mesh.bounds();
        let mut random = Random(3);
        let (mut hits, mut misses) = (0, 0);
        for _ in 0..3_000 {
            let middle = [0, 1, 2].map(|k| f64::midpoint(low[k], high[k]));
            let origin = [0, 1, 2].map(|k| middle[k] + 0.7 * random.signed() * (high[k] - low[k]));
            let direction = random.unit();
            let Some(expected) = brute(&triangles, origin, direction) else { continue };
            let hit = mesh.cast(origin, direction, f64::INFINITY);
            match (hit, expected) {
                (Some(hit), range) if range < f64::INFINITY => {
                    hits += 1;
                    assert!((hit.range_m - range).abs() < 1e-9, "{hit:?}, not {range}");
                    let [a, b, c] =
                        triangles.faces[hit.face as usize].map(|i| triangles.vertices[i as usize]);
                    let n = cross(sum(b, a, -1.0), sum(c, a, -1.0));
                    assert!(dot(hit.normal, direction) < 0.0);
                    assert!((dot(hit.normal, n).abs() - math::sqrt(dot(n, n))).abs() < 1e-12);
                    assert!(mesh.cast(origin, direction, range * 0.999_999).is_none());
                }
                (None, f64::INFINITY) => misses += 1,
                (hit, range) => panic!("{hit:?}, not {range}, from {origin:?} along {direction:?}"),
            }
        }
        assert!(hits > 500 && misses > 300, "{hits} hits, {misses} misses");
    }
}

#[test]
fn no_ray_slips_between_triangles() {
    let mut far = rough_body();
    for v in &mut far.vertices {
        *v = sum(*v, [90_000.0, -70_000.0, 50.0], 1.0);
    }
    for (triangles, centre) in [
        (rough_body(), [0.0; 3]),
        (icosphere(3, || 2.0), [0.0; 3]),
        (cuboid([1.0, 2.0, 3.0]), [0.0; 3]),
        (far, [90_000.0, -70_000.0, 50.0]),
    ] {
        let mesh = Mesh::new(triangles.clone(), Role::Body).unwrap();
        let mut random = Random(4);
        for i in 0..50_000 {
            let face = triangles.faces[random.index(triangles.faces.len())];
            let [a, b, c] = face.map(|i| triangles.vertices[i as usize]);
            let target = match i % 3 {
                0 => a,
                1 => [0, 1, 2].map(|k| f64::midpoint(a[k], b[k])),
                _ => sum(b, sum(c, b, -1.0), random.signed().abs()),
            };
            let origin = if i % 2 == 0 { centre } else { sum(centre, random.unit(), 0.5) };
            let (direction, distance) = toward(origin, target);
            let hit = mesh.cast(origin, direction, f64::INFINITY);
            let range = hit.unwrap_or_else(|| panic!("out by {target:?} from {origin:?}")).range_m;
            // Rays with odd numbers start off the centre of the rough body, so a nearer face may hide the target.
            assert!(
                range < distance + 1e-9 && (i % 2 == 1 || range > distance - 1e-9),
                "{range}, not {distance}"
            );
        }
    }
}

#[test]
fn no_ray_from_the_axis_of_a_tube_slips_through_its_wall() {
    let triangles = rough_tube();
    let mesh = Mesh::new(triangles.clone(), Role::Wall).unwrap();
    for &target in &triangles.vertices {
        // The rays are perpendicular to the axis, so one or two components of their directions are zero or nearly zero.
        let origin = [target[0], 0.0, 0.0];
        let (direction, distance) = toward(origin, target);
        let hit = mesh.cast(origin, direction, 100.0).unwrap();
        assert!((hit.range_m - distance).abs() < 1e-9, "{hit:?}, not {distance}");
    }
}

#[test]
fn ranges_to_a_mesh_with_degenerate_triangles_are_exact() {
    // An additional vertex on an edge splits a triangle of the box's upper face. One of the three pieces has no area.
    let mut t = cuboid([1.0, 1.0, 1.0]);
    let old =
        t.faces.iter().position(|face| face.contains(&4) && face.contains(&5) && face.contains(&7)).unwrap();
    let [a, b, c] = t.faces.swap_remove(old);
    let [p, q] = [a, b].map(|i| t.vertices[i as usize]);
    let third = sum(p, sum(q, p, -1.0), 1.0 / 3.0);
    t.vertices.push(third);
    t.faces.extend([[a, b, 8], [a, 8, c], [8, b, c]]);
    let mesh = Mesh::new(t, Role::Body).unwrap();
    assert_eq!(mesh.surface.faces.len(), 14);
    let mut random = Random(5);
    for _ in 0..20_000 {
        let origin = [0, 1, 2].map(|_| 0.9 * random.signed());
        let (direction, distance) = toward(origin, sum(p, sum(q, p, -1.0), random.signed().abs()));
        let range = mesh.cast(origin, direction, 10.0).unwrap().range_m;
        assert!((range - distance).abs() < 1e-9, "{range}, not {distance}");
    }
}

#[test]
fn lowest_face_number_wins_at_equal_ranges() {
    let triangles = cuboid([1.0, 2.0, 3.0]);
    let hit = |t: &Triangles, direction| {
        Mesh::new(t.clone(), Role::Body).unwrap().cast([0.0; 3], direction, 9.0).unwrap()
    };
    // A ray along an axis hits the middle of a face, where the face's diagonal is the common edge of two triangles.
    let along_x = hit(&triangles, [1.0, 0.0, 0.0]);
    assert_eq!(along_x, MeshHit { range_m: 1.0, normal: [-1.0, 0.0, 0.0], face: 2 });
    assert_eq!(hit(&triangles, [0.0, 0.0, -1.0]).face, 8);
    let mut reversed = triangles.clone();
    reversed.faces.reverse();
    assert_eq!(hit(&reversed, [1.0, 0.0, 0.0]).face, 8);
    reversed.faces.iter_mut().for_each(|face| face.swap(0, 1));
    assert_eq!(hit(&reversed, [1.0, 0.0, 0.0]), MeshHit { face: 8, ..along_x });
}

#[test]
fn ranges_are_bit_identical_whatever_the_order_of_faces() {
    let triangles = rough_body();
    let mut shuffled = triangles.clone();
    let mut random = Random(8);
    for i in (1..shuffled.faces.len()).rev() {
        shuffled.faces.swap(i, random.index(i + 1));
    }
    let [one, other] = [triangles.clone(), shuffled].map(|t| Mesh::new(t, Role::Body).unwrap());
    for i in 0..20_000 {
        let vertex = triangles.vertices[random.index(triangles.vertices.len())];
        let direction = if i % 2 == 0 { random.unit() } else { toward([0.0; 3], vertex).0 };
        let origin = if i % 4 < 2 { [0.0; 3] } else { sum([0.0; 3], direction, -9.0) };
        let bits = |mesh: &Mesh| mesh.cast(origin, direction, 20.0).unwrap().range_m.to_bits();
        assert_eq!(bits(&one), bits(&other));
    }
}

#[test]
fn non_finite_rays_hit_nothing() {
    let mesh = Mesh::new(cuboid([1.0; 3]), Role::Body).unwrap();
    let ahead = [1.0, 0.0, 0.0];
    assert!(mesh.cast([f64::NAN, 0.0, 0.0], ahead, 9.0).is_none());
    assert!(mesh.cast([0.0; 3], [0.0; 3], 9.0).is_none());
    assert!(mesh.cast([0.0; 3], [f64::NAN, 0.0, 1.0], 9.0).is_none());
    assert!(mesh.cast([0.0; 3], ahead, f64::NAN).is_none());
    assert!(!mesh.contains([f64::NAN; 3]));
}

#[test]
fn points_between_an_inner_point_and_its_first_hit_are_inside() {
    for (triangles, role) in [(rough_body(), Role::Body), (rough_tube(), Role::Wall)] {
        let mut turned = triangles.clone();
        turned.faces.iter_mut().step_by(2).for_each(|face| face.swap(0, 1));
        let mesh = Mesh::new(turned, role).unwrap();
        let mut random = Random(6);
        for _ in 0..5_000 {
            let unit = random.unit();
            let (origin, direction) = match role {
                Role::Body => ([0.0; 3], unit),
                Role::Wall => {
                    ([20.0 + 19.9 * random.signed(), 0.0, 0.0], toward([0.0; 3], [0.0, unit[1], unit[2]]).0)
                }
            };
            let range = mesh.cast(origin, direction, 100.0).unwrap().range_m;
            assert!(mesh.contains(sum(origin, direction, range * random.signed().abs() * 0.999_999)));
            assert!(!mesh.contains(sum(origin, direction, range * 1.000_001)));
        }
    }
    let wall = Mesh::new(rough_tube(), Role::Wall).unwrap();
    assert!(wall.contains([0.001, 0.0, 0.0]) && wall.contains([39.999, 1.0, 1.0]));
    assert!(!wall.contains([-0.001, 0.0, 0.0]) && !wall.contains([40.001, 0.0, 0.0]));
    let cube = Mesh::new(cuboid([1.0; 3]), Role::Body).unwrap();
    assert!(
        cube.contains([1.0; 3]) && cube.contains([0.0; 3]),
        "the surface, and a place of many symmetries"
    );
}
