//! Hits of rays on the walls of random cross-sections, compared with a formula that is applied to each edge.

use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::{Profile, Yz, shapes};

use crate::cases::{Case, few, many, within};

/// Tolerance, m. On edges with a length of a micrometre, hits are exact to some nanometres only, because the program
/// subtracts nearly equal numbers to find on which side of the ray an end of the edge lies.
const OFF_M: f64 = 1e-8;

/// Corners of a polygon that is star-shaped about (0, 3). Some corners coincide, or are 1e-12 or 1e-7 of a turn apart.
fn points(case: &mut Case) -> Vec<Yz> {
    let count = 3 + case.below(60);
    let mut turns: Vec<f64> = (0..count).map(|k| (k as f64 + 0.9 * case.unit()) / count as f64).collect();
    for k in 1..count {
        match case.below(12) {
            0 => turns[k] = turns[k - 1],
            1 => turns[k] = turns[k - 1] + 1e-12,
            2 => turns[k] = turns[k - 1] + 1e-7,
            _ => {}
        }
    }
    let round = case.below(3) == 0;
    turns
        .iter()
        .map(|turn| {
            let radius_m = if round { 2.0 } else { case.between(1.2, 2.8) };
            let (sin, cos) = math::sin_cos(turn * TAU);
            [radius_m * cos, 3.0 + radius_m * sin]
        })
        .collect()
}

/// Finds the first edge that a ray meets. Each edge is extended slightly. Returns the distance in ray lengths, and the
/// sine of the angle between ray and edge.
fn meets(points: &[Yz], origin: Yz, ray: Yz) -> Option<(f64, f64)> {
    let cross = |a: Yz, b: Yz| a[0] * b[1] - a[1] * b[0];
    let edges = points.iter().zip(points.iter().cycle().skip(1));
    let meetings = edges.filter_map(|(a, b)| {
        let (along, to) = ([b[0] - a[0], b[1] - a[1]], [a[0] - origin[0], a[1] - origin[1]]);
        let det = cross(ray, along);
        let (share, t) = (cross(to, ray) / det, cross(to, along) / det);
        let length_m = math::hypot(along[0], along[1]);
        ((-1e-12..=1.0 + 1e-12).contains(&share) && t > 0.0).then(|| (t, (det / length_m).abs()))
    });
    meetings.min_by(|a, b| a.0.total_cmp(&b.0))
}

fn rays(case: &mut Case) -> Result<(), String> {
    let given = points(case);
    let profile = match Profile::polygon(&given, Some([0.0, 3.0])) {
        Ok(profile) => profile,
        // A polygon with too few distinct points or with a gap of half a turn is refused. The error must state a
        // reason.
        Err(why) => return if why.to_string().is_empty() { Err("no reason".to_owned()) } else { Ok(()) },
    };
    for _ in 0..8 {
        let (sin, cos) = math::sin_cos(case.between(0.0, TAU));
        let off_m = case.between(0.0, 1.1);
        let origin = [off_m * cos, 3.0 + off_m * sin];
        if !profile.contains(origin) {
            continue;
        }
        let corner = given[case.below(given.len())];
        let to_corner = [corner[0] - origin[0], corner[1] - origin[1]];
        let (sin, cos) = math::sin_cos(case.between(0.0, TAU));
        let ray = match case.below(5) {
            0 => to_corner,
            1 => [to_corner[0].next_up(), to_corner[1]],
            2 => [to_corner[0], to_corner[1].next_down()],
            3 => [1e-6 * cos, 1e-6 * sin],
            _ => [cos, sin],
        };
        let hit =
            profile.cast(origin, ray).ok_or_else(|| format!("no wall from {origin:?} along {ray:?}"))?;
        let nearest = profile.nearest(hit.point);
        let wall = profile.point_at(hit.arc_m);
        let by_arc_m = math::hypot(wall[0] - hit.point[0], wall[1] - hit.point[1]);
        let along_m = hit.range_m * math::hypot(ray[0], ray[1]);
        let numbers = [hit.range_m, hit.arc_m, hit.normal[0], hit.normal[1]];
        let inwards = hit.normal[0] * ray[0] + hit.normal[1] * ray[1] < 1e-9;
        if !(numbers.iter().all(|number| number.is_finite())
            && inwards
            && (0.0..profile.perimeter_m()).contains(&hit.arc_m))
        {
            return Err(format!("{hit:?} from {origin:?} along {ray:?}"));
        }
        if nearest.distance_m > OFF_M || by_arc_m > 2.0 * OFF_M {
            return Err(format!(
                "{hit:?} is {} m off the wall, {by_arc_m} from its arc length: {origin:?} {ray:?}",
                nearest.distance_m
            ));
        }
        // If a ray goes through a corner or along an edge, rounding decides which of two edges it hits. Such rays
        // aren't compared.
        if let Some((t, sine)) = meets(&given, origin, ray)
            && sine > 1e-3 * math::hypot(ray[0], ray[1])
        {
            let off_m = (t - hit.range_m).abs() * math::hypot(ray[0], ray[1]);
            let is_steady = [1e-9, -1e-9].into_iter().all(|turn| {
                let beside = meets(&given, origin, [ray[0] - turn * ray[1], ray[1] + turn * ray[0]]);
                beside.is_some_and(|(other, _)| {
                    (other / t - 1.0).abs() < 4e-9 * math::hypot(ray[0], ray[1]) / sine
                })
            });
            if is_steady && off_m > OFF_M * (1.0 + along_m) * (1.0 + math::hypot(ray[0], ray[1]) / sine) {
                return Err(format!("{hit:?} isn't at {t}: {origin:?} {ray:?} {given:?}"));
            }
        }
    }
    inverses(case, &profile)
}

/// Converts an arc length to a place on the wall and back, in the given polygon and in a shape made of arcs. Checks
/// that the direction from the reference point stays the same.
fn inverses(case: &mut Case, polygon: &Profile) -> Result<(), String> {
    let width_m = case.between(0.5, 12.0);
    let shape = match case.below(3) {
        0 => shapes::circle(width_m),
        1 => shapes::arch(width_m, width_m * case.between(0.8, 2.0), width_m * case.between(0.5, 3.0)),
        _ => shapes::trimmed_circle(width_m, width_m * case.between(0.1, 1.99)),
    };
    for profile in [Some(polygon), shape.as_ref().ok()].into_iter().flatten() {
        let arc_m = case.unit() * profile.perimeter_m();
        let place = profile.point_at(arc_m);
        let back = profile.point_at(profile.arc_of(place));
        // Directions are compared instead of arc lengths, because all points of an edge that points at the reference
        // point have the same direction.
        let [to, from] =
            [place, back].map(|at| [at[0] - profile.reference()[0], at[1] - profile.reference()[1]]);
        let turned_rad = math::atan2(to[0] * from[1] - to[1] * from[0], to[0] * from[0] + to[1] * from[1]);
        if !within(turned_rad.abs(), 1e-9) {
            return Err(format!("arc length {arc_m} comes back {turned_rad} rad off: {place:?} {back:?}"));
        }
    }
    Ok(())
}

#[test]
fn ray_hits_match_the_formula_for_each_edge() {
    few("geometry", &rays);
}

#[test]
#[ignore = "long; see the module's description"]
fn ray_hits_match_the_formula_for_each_edge_in_a_long_run() {
    many("geometry", &rays);
}
