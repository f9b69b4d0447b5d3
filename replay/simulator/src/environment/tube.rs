//! The tunnel's wall: a profile that follows the axis, with a variable scale and local displacements.
//!
//! The gauge of a point is a ratio of two distances from the reference point: the distance of the point, divided by the
//! distance of the wall in the same direction. The gauge is below 1 in the tunnel and 1 on the wall.
//!
//! If the axis is straight, the scale constant and the wall not displaced, the range to the wall has a closed form.
//! Otherwise a ray advances in steps of (1 - gauge) divided by an upper bound on the slope of the gauge. Such steps
//! cannot pass the wall, however thin a protrusion is. The one exception is that steps are at least [`LEAST_STEP_M`]
//! long, so a ray may cross a shorter length of rock unnoticed.
//!
//! A mesh that replaces the wall has a stretch of its own. The planes at its ends are also wall, wherever water on one
//! side meets rock on the other side. A ray therefore cannot escape between profile and mesh if they do not fit.

use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, WallPoint, Yz};

use super::axis::{Axis, Piece, Station};
use super::bulge::Bulge;
use super::mesh_parts::MeshWall;
use super::stations::Scales;
use super::steepness::Steepness;
use super::vector::{Face, Ray, V3, unit};
use super::widths::half_width_m;

/// Minimum length of a step along a ray, m.
const LEAST_STEP_M: f64 = 1e-4;
/// Accuracy of the point where a ray meets the wall, m.
const ROOT_M: f64 = 1e-11;
/// Displacement of the wall above which a hit is attributed to the feature that displaced the wall there, m.
const FEATURE_M: f64 = 1e-3;
/// The normal of a displaced wall is computed from differences between points on both sides of the hit. This constant
/// is half the distance between the two points, m.
const NORMAL_STEP_M: f64 = 1e-5;

/// The tunnel's wall along the whole tunnel, except openings.
#[derive(Debug, Clone)]
pub(super) struct Tube {
    axis: Axis,
    profile: Profile,
    /// Centre of the floor. The profile is scaled about this point.
    floor: Yz,
    scales: Scales,
    bulges: Vec<Bulge>,
    /// Meshes that replace the wall. They overlap no bend, change of scale, bulge or other mesh.
    meshes: Vec<MeshWall>,
    /// Stretches of the tunnel, without gaps, from -infinity to +infinity of chainage.
    stretches: Vec<Stretch>,
}

/// A length of tunnel within one piece of the axis, with a linear scale of the profile and the same bulges everywhere.
#[derive(Debug, Clone)]
struct Stretch {
    from_m: f64,
    piece: Piece,
    /// Planes across the tunnel at the stretch's ends; `None` for an end at infinity.
    ends: [Option<Station>; 2],
    /// Scale of the profile at the start of the stretch, or of the whole stretch if `scale_slope_pm` is zero.
    scale: f64,
    scale_slope_pm: f64,
    /// Numbers of the bulges that extend into the stretch.
    bulges: Vec<usize>,
    /// Number of the mesh that is the wall of this stretch; `None` if the profile is the wall.
    mesh: Option<usize>,
    /// Reciprocal of an upper bound on the slope of the gauge, m. It determines the length of steps along rays.
    step_m: f64,
}

/// Passage of a ray through the water in the tube.
#[derive(Debug, Clone, Copy)]
pub(super) struct Passage {
    /// Distance along the ray at which the ray leaves the tube or reaches the limit of the search, m.
    pub(super) t_m: f64,
    /// Whether the ray's passage ends at the wall.
    pub(super) wall: bool,
    /// Face of the wall at the end of the passage; `None` if it is not computed yet.
    pub(super) face: Option<Face>,
    /// Chainages of the start and the end of the passage, m.
    pub(super) chainages_m: [f64; 2],
}

impl Tube {
    /// Builds the wall of `profile` along `axis`, except where a mesh is the wall.
    ///
    /// Allocates: startup only.
    pub(super) fn new(
        axis: Axis,
        profile: Profile,
        scales: Scales,
        bulges: Vec<Bulge>,
        meshes: Vec<MeshWall>,
    ) -> Self {
        let floor = profile.point_at(0.0);
        let mut breaks: Vec<f64> = axis.pieces().iter().map(|piece| piece.from_m).collect();
        breaks.extend(scales.breaks());
        breaks.extend(bulges.iter().flat_map(|bulge| [bulge.begin_m(), bulge.end_m()]));
        // Boundaries of stretches within a mesh are removed, so that each mesh has a single stretch, even if two
        // straight pieces of the axis meet there.
        let spans: Vec<(f64, f64)> = meshes.iter().map(MeshWall::span_m).collect();
        breaks.retain(|at_m| !spans.iter().any(|(from_m, to_m)| from_m < at_m && at_m < to_m));
        breaks.extend(spans.iter().flat_map(|(from_m, to_m)| [*from_m, *to_m]));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let steepness = Steepness::new(&profile);
        let mut tube = Self { axis, profile, floor, scales, bulges, meshes, stretches: Vec::new() };
        let ends = breaks.iter().copied().skip(1).chain([f64::INFINITY]);
        tube.stretches =
            breaks.iter().zip(ends).map(|(from_m, to_m)| tube.stretch(*from_m, to_m, &steepness)).collect();
        tube
    }

    fn stretch(&self, from_m: f64, to_m: f64, steepness: &Steepness) -> Stretch {
        let middle_m = match (from_m.is_finite(), to_m.is_finite()) {
            (true, true) => f64::midpoint(from_m, to_m),
            (true, false) => from_m + 1.0,
            (false, true) => to_m - 1.0,
            (false, false) => 0.0,
        };
        let (_, piece) = self.axis.piece_at(middle_m);
        let reaches = |bulge: &Bulge| bulge.begin_m() < to_m && from_m < bulge.end_m();
        let bulges: Vec<usize> =
            self.bulges.iter().enumerate().filter(|(_, bulge)| reaches(bulge)).map(|(k, _)| k).collect();
        let scale_slope_pm = self.scales.slope_pm(from_m, to_m);
        let near: Vec<Bulge> = bulges.iter().map(|k| self.bulges[*k]).collect();
        let least_scale = self.scales.smallest(from_m, to_m);
        let slope_pm = steepness.gauge_slope_pm(&near, least_scale, scale_slope_pm, piece.curvature_pm());
        let end = |chainage_m: f64| chainage_m.is_finite().then(|| piece.station(chainage_m));
        Stretch {
            from_m,
            piece: *piece,
            ends: [end(from_m), end(to_m)],
            scale: if scale_slope_pm == 0.0 { self.scales.at(middle_m) } else { self.scales.at(from_m) },
            scale_slope_pm,
            bulges,
            mesh: self.mesh_over(from_m, to_m).map(|(number, _)| number),
            step_m: 1.0 / slope_pm,
        }
    }

    /// A mesh that is the wall somewhere between two chainages: its number, and the mesh.
    fn mesh_over(&self, from_m: f64, to_m: f64) -> Option<(usize, &MeshWall)> {
        let overlaps = |(begin_m, end_m): (f64, f64)| begin_m < to_m && from_m < end_m;
        self.meshes.iter().enumerate().find(|(_, mesh)| overlaps(mesh.span_m()))
    }

    /// Number of the feature whose mesh is the wall somewhere between two chainages.
    pub(super) fn mesh_within(&self, from_m: f64, to_m: f64) -> Option<u16> {
        self.mesh_over(from_m, to_m).map(|(_, mesh)| mesh.feature())
    }

    /// The axis of the tunnel.
    pub(super) fn axis(&self) -> &Axis {
        &self.axis
    }

    /// The tunnel's profile before it is scaled or displaced.
    pub(super) fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Largest distance of the tube's wall to either side of the axis, m.
    pub(super) fn reach_m(&self) -> f64 {
        let outwards_m = self.bulges.iter().map(|bulge| -bulge.depth_m).fold(0.0, f64::max);
        half_width_m(&self.profile) * self.scales.largest() + outwards_m
    }

    /// Scale of the tunnel's profile at `chainage_m`.
    pub(super) fn scale(&self, chainage_m: f64) -> f64 {
        self.scales.at(chainage_m)
    }

    /// Converts a point of the unscaled profile to the scale at `chainage_m`.
    pub(super) fn scaled(&self, chainage_m: f64, unscaled: Yz) -> Yz {
        let scale = self.scale(chainage_m);
        let [fy, fz] = self.floor;
        [fy + (unscaled[0] - fy) * scale, fz + (unscaled[1] - fz) * scale]
    }

    /// Place (y, z) of a wall point on the unscaled profile, and the profile's inward normal there.
    ///
    /// The place includes the displacement of the wall by bulges.
    pub(super) fn wall_place(&self, at: WallPoint) -> (Yz, Yz) {
        let reference = self.profile.reference();
        let [wy, wz] = self.profile.point_at(at.arc_m);
        let out = [wy - reference[0], wz - reference[1]];
        let normal = self.profile.cast_from_inside(reference, out).map_or([0.0, 1.0], |hit| hit.normal);
        let radius_m = self.scale(at.x_m) * math::hypot(out[0], out[1]);
        let perimeter_m = self.profile.perimeter_m();
        let inwards_m: f64 = self.bulges.iter().map(|b| b.displacement_m(at, perimeter_m)).sum();
        let share = 1.0 - inwards_m / radius_m;
        let place = [reference[0] + share * out[0], reference[1] + share * out[1]];
        (self.scaled(at.x_m, place), normal)
    }

    /// Range along the unit vector `direction` (y, z) from a point of the section at `chainage_m` to the profile's
    /// wall, m.
    ///
    /// Ignores displacements of the wall. `None` if the point `from` is outside the profile.
    pub(super) fn section_range_m(&self, chainage_m: f64, from: Yz, direction: Yz) -> Option<f64> {
        let scale = self.scale(chainage_m);
        let hit = self.profile.cast(self.unscaled(from, scale), direction.map(|c| c / scale))?;
        Some(hit.range_m)
    }

    /// Whether `point` is in the tube, which is bounded by the tunnel's wall.
    pub(super) fn contains(&self, point: V3) -> bool {
        let (number, _) = self.locate(point);
        self.stretches.get(number).is_some_and(|stretch| self.holds(stretch, point))
    }

    /// Passage of the ray from `t_m` to the point where it leaves the tube, at most to `far_m`; `None` if the ray is
    /// not in the tube at `t_m`.
    pub(super) fn leave(&self, ray: &Ray, t_m: f64, far_m: f64) -> Option<Passage> {
        let start = ray.at(t_m);
        let (mut number, start_m) = self.locate(start);
        let first = self.stretches.get(number)?;
        if !self.holds(first, start) {
            return None;
        }
        // Chainage is monotonic along a straight line. A ray towards growing chainage therefore never turns back.
        let [tx, ty] = first.piece.station(start_m).tangent;
        let forwards = ray.direction[0] * tx + ray.direction[1] * ty >= 0.0;
        let mut t_m = t_m;
        while let Some(stretch) = self.stretches.get(number) {
            let until_m = stretch.end_m(ray, forwards).max(t_m).min(far_m);
            let mut left = self.leave_stretch(stretch, ray, t_m, until_m);
            number = if forwards { number + 1 } else { number.wrapping_sub(1) };
            if left.is_none() && until_m < far_m {
                left = self.end_wall(stretch, number, ray, until_m).map(|face| (until_m, Some(face)));
            }
            if left.is_some() || until_m >= far_m {
                let (t_m, face) = left.unwrap_or((far_m, None));
                let end_m = stretch.chainage_m(ray.at(t_m));
                let chainages_m = [start_m, end_m];
                return Some(Passage { t_m, wall: left.is_some(), face, chainages_m });
            }
            t_m = until_m;
        }
        None
    }

    /// The wall's face (normal and feature) at a point of the wall.
    pub(super) fn face(&self, point: V3) -> Face {
        let (number, chainage_m) = self.locate(point);
        let wall = Face { normal: [0.0; 3], feature: None };
        let Some(stretch) = self.stretches.get(number) else { return wall };
        let section = [stretch.piece.left_of([point[0], point[1]]), point[2]];
        let scale = stretch.scale_at(chainage_m);
        let Some((hit, _)) = self.outwards(self.unscaled(section, scale)) else { return wall };
        if stretch.is_constant() {
            let [tx, ty] = stretch.piece.station(chainage_m).tangent;
            let [ny, nz] = hit.normal;
            return Face { normal: [-ty * ny, tx * ny, nz], feature: None };
        }
        Face {
            normal: self.falling(stretch, point),
            feature: self.displaced_by(stretch, WallPoint { x_m: chainage_m, arc_m: hit.arc_m }),
        }
    }

    /// Number of the stretch that the point lies in, and the point's chainage.
    fn locate(&self, point: V3) -> (usize, f64) {
        let (_, chainage_m, _) = self.axis.locate([point[0], point[1]]);
        let after = self.stretches.partition_point(|stretch| stretch.from_m <= chainage_m);
        (after.saturating_sub(1), chainage_m)
    }

    fn holds(&self, stretch: &Stretch, point: V3) -> bool {
        if let Some(mesh) = self.mesh_of(stretch) {
            return mesh.holds(point);
        }
        if stretch.is_constant() {
            let section = [stretch.piece.left_of([point[0], point[1]]), point[2]];
            return self.profile.contains(self.unscaled(section, stretch.scale));
        }
        self.gauge(stretch, point) < 1.0
    }

    fn mesh_of(&self, stretch: &Stretch) -> Option<&MeshWall> {
        stretch.mesh.and_then(|number| self.meshes.get(number))
    }

    /// Returns the range at which the ray leaves the tube, searched from `t_m` to `until_m` within the stretch. If a
    /// mesh is the wall of the stretch, also returns the face that the ray hits.
    fn leave_stretch(
        &self,
        stretch: &Stretch,
        ray: &Ray,
        t_m: f64,
        until_m: f64,
    ) -> Option<(f64, Option<Face>)> {
        if let Some(mesh) = self.mesh_of(stretch) {
            return mesh.leave(ray, t_m, until_m).map(|(t_m, face)| (t_m, Some(face)));
        }
        let left = if stretch.is_plain() {
            self.leave_plain(stretch, ray, t_m).filter(|leave_m| *leave_m <= until_m)
        } else {
            self.leave_warped(stretch, ray, t_m, until_m)
        };
        left.map(|t_m| (t_m, None))
    }

    /// Face of the plane between two stretches, if the plane is wall where the ray meets it at `t_m`; `None` if water
    /// is beyond.
    ///
    /// Only the end planes of a mesh can be wall.
    fn end_wall(&self, from: &Stretch, to: usize, ray: &Ray, t_m: f64) -> Option<Face> {
        let to = self.stretches.get(to)?;
        let mesh = self.mesh_of(to).or(self.mesh_of(from))?;
        if self.holds(to, ray.at(t_m)) {
            return None;
        }
        // The stretch with a mesh gives the direction, because the tunnel's axis is straight there.
        let [tx, ty] =
            if to.mesh.is_some() { to.piece.station(to.from_m) } else { from.piece.station(from.from_m) }
                .tangent;
        let against = -(ray.direction[0] * tx + ray.direction[1] * ty).signum();
        Some(Face { normal: [against * tx, against * ty, 0.0], feature: Some(mesh.feature()) })
    }

    /// Range at which the ray leaves the tube, in closed form, if axis and profile of the stretch are straight and
    /// constant.
    fn leave_plain(&self, stretch: &Stretch, ray: &Ray, t_m: f64) -> Option<f64> {
        let at = ray.at(t_m);
        let [tx, ty] = stretch.piece.station(0.0).tangent;
        let direction = [ray.direction[1] * tx - ray.direction[0] * ty, ray.direction[2]];
        let section = [stretch.piece.left_of([at[0], at[1]]), at[2]];
        let hit = self.profile.cast_from_inside(
            self.unscaled(section, stretch.scale),
            [direction[0] / stretch.scale, direction[1] / stretch.scale],
        );
        match hit {
            Some(hit) => Some(t_m + hit.range_m),
            // There are two cases without a wall ahead. If the point is on the wall itself, the ray ends at the point.
            // If the ray runs along the axis, it hits no wall.
            None => (self.gauge(stretch, at) > 1.0 - 1e-9).then_some(t_m),
        }
    }

    fn leave_warped(&self, stretch: &Stretch, ray: &Ray, t_m: f64, until_m: f64) -> Option<f64> {
        let gauge = |t_m: f64| self.gauge(stretch, ray.at(t_m)) - 1.0;
        let mut inside = (t_m, gauge(t_m));
        if inside.1 >= 0.0 {
            return Some(t_m);
        }
        while inside.0 < until_m {
            let t_m = (inside.0 + (-inside.1 * stretch.step_m).max(LEAST_STEP_M)).min(until_m);
            let next = (t_m, gauge(t_m));
            if next.1 >= 0.0 {
                return Some(root(inside, next, gauge));
            }
            inside = next;
        }
        None
    }

    /// Gauge of a point: its distance from the reference point divided by the wall's distance in the same direction.
    fn gauge(&self, stretch: &Stretch, point: V3) -> f64 {
        let plan = [point[0], point[1]];
        if stretch.is_constant() {
            let section = [stretch.piece.left_of(plan), point[2]];
            let hit = self.outwards(self.unscaled(section, stretch.scale));
            return hit.map_or(0.0, |(hit, _)| 1.0 / hit.range_m);
        }
        let (chainage_m, left_m) = stretch.piece.chart(plan);
        let scale = stretch.scale_at(chainage_m);
        let Some((hit, distance_m)) = self.outwards(self.unscaled([left_m, point[2]], scale)) else {
            return 0.0;
        };
        if stretch.bulges.is_empty() {
            return 1.0 / hit.range_m;
        }
        let perimeter_m = self.profile.perimeter_m();
        let near = stretch.bulges.iter().filter_map(|k| self.bulges.get(*k));
        let at = WallPoint { x_m: chainage_m, arc_m: hit.arc_m };
        let inwards_m: f64 = near.map(|bulge| bulge.displacement_m(at, perimeter_m)).sum();
        distance_m * scale / (distance_m * hit.range_m * scale - inwards_m)
    }

    /// The profile's wall in the direction from the reference point to the point `unscaled`, and the distance between
    /// the reference point and that point, m.
    fn outwards(&self, unscaled: Yz) -> Option<(headrace_geometry::tunnel::WallHit, f64)> {
        let [ry, rz] = self.profile.reference();
        let out = [unscaled[0] - ry, unscaled[1] - rz];
        let hit = self.profile.cast_from_inside([ry, rz], out)?;
        Some((hit, math::sqrt(out[0] * out[0] + out[1] * out[1])))
    }

    #[expect(clippy::float_cmp, reason = "any other scale, however near, is one")]
    fn unscaled(&self, section: Yz, scale: f64) -> Yz {
        // An unscaled tunnel must equal the profile exactly. Adding and subtracting the floor's position could change
        // the last bit of the result, so the point is returned as it is.
        if scale == 1.0 {
            return section;
        }
        let [fy, fz] = self.floor;
        [fy + (section[0] - fy) / scale, fz + (section[1] - fz) / scale]
    }

    /// Direction of steepest descent of the gauge, a unit vector.
    fn falling(&self, stretch: &Stretch, point: V3) -> V3 {
        let mut fall = [0.0; 3];
        for (k, fall) in fall.iter_mut().enumerate() {
            let (mut before, mut after) = (point, point);
            before[k] -= NORMAL_STEP_M;
            after[k] += NORMAL_STEP_M;
            *fall = self.gauge(stretch, before) - self.gauge(stretch, after);
        }
        unit(fall)
    }

    /// Number of the feature that displaces the wall most at a point; `None` if no feature displaces it noticeably.
    fn displaced_by(&self, stretch: &Stretch, at: WallPoint) -> Option<u16> {
        let perimeter_m = self.profile.perimeter_m();
        let near = stretch.bulges.iter().filter_map(|k| self.bulges.get(*k));
        near.map(|bulge| (bulge.displacement_m(at, perimeter_m).abs(), bulge.feature))
            .filter(|(by_m, _)| *by_m > FEATURE_M)
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, feature)| feature)
    }
}

impl Stretch {
    /// Whether all cross-sections of the stretch are equal.
    fn is_constant(&self) -> bool {
        self.scale_slope_pm == 0.0 && self.bulges.is_empty()
    }

    /// Whether the stretch is a prism: straight, with equal cross-sections.
    fn is_plain(&self) -> bool {
        self.is_constant() && self.piece.curvature_pm() == 0.0
    }

    fn scale_at(&self, chainage_m: f64) -> f64 {
        if self.scale_slope_pm == 0.0 {
            return self.scale;
        }
        self.scale + self.scale_slope_pm * (chainage_m - self.from_m)
    }

    fn chainage_m(&self, point: V3) -> f64 {
        self.piece.chart([point[0], point[1]]).0
    }

    /// Distance along the ray to the plane at the end of the stretch ahead, m; infinity if the ray never passes the
    /// plane.
    fn end_m(&self, ray: &Ray, forwards: bool) -> f64 {
        let Some(end) = self.ends[usize::from(forwards)] else { return f64::INFINITY };
        let [tx, ty] = end.tangent;
        let speed = ray.direction[0] * tx + ray.direction[1] * ty;
        if speed == 0.0 || (speed > 0.0) != forwards {
            return f64::INFINITY;
        }
        ((end.at[0] - ray.origin[0]) * tx + (end.at[1] - ray.origin[1]) * ty) / speed
    }
}

/// Finds a root of `f` by the Illinois method. The function is negative at `below` and not negative at `above`.
fn root(mut below: (f64, f64), mut above: (f64, f64), f: impl Fn(f64) -> f64) -> f64 {
    let mut kept = 0;
    for _ in 0..100 {
        if above.0 - below.0 <= ROOT_M || above.1 == 0.0 {
            break;
        }
        let t = below.0 - below.1 * (above.0 - below.0) / (above.1 - below.1);
        let value = f(t);
        // If an end of the search interval is kept twice in a row, the function's value at this end is halved.
        // Otherwise the interval could shrink from one side only.
        if value < 0.0 {
            below = (t, value);
            if kept == 1 {
                above.1 /= 2.0;
            }
            kept = 1;
        } else {
            above = (t, value);
            if kept == -1 {
                below.1 /= 2.0;
            }
            kept = -1;
        }
        if value.abs() < 1e-13 {
            return t;
        }
    }
    f64::midpoint(below.0, above.0)
}
