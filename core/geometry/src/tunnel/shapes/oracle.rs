//! Comparison of difficult rays with 50-digit values.
//!
//! `tests/oracles/geometry.py` computes the values in `geometry.csv` with mpmath.

use super::*;
use crate::tunnel::{Piece, Yz};
use headrace_support::hard_cases::{found, found_at};

const LINES: &str = include_str!("../../../../../tests/oracles/geometry.csv");

/// Returns the largest errors of ray length and arc length in an oracle case, m, and the number of rays in it.
fn worst(case: &str) -> (f64, f64, u32) {
    let (mut range_m, mut arc_m, mut count) = (0.0_f64, 0.0_f64, 0);
    for line in LINES.lines().filter(|line| line.split(',').next() == Some(case)) {
        let fields: Vec<&str> = line.split(',').collect();
        let numbers: Vec<f64> = fields[2..].iter().map(|field| field.parse().unwrap()).collect();
        let [a, b, c, y, z, v, w, expected, expected_arc_m] = numbers[..] else { panic!("{line}") };
        let profile = match fields[1] {
            "rectangle" => rectangle(a, b),
            "circle" => circle(a),
            "arch" => arch(a, b, c),
            "trimmed_circle" => trimmed_circle(a, b),
            other => panic!("{other}"),
        };
        let profile = profile.unwrap();
        let hit = profile.cast_from_inside([y, z], [v, w]).unwrap_or_else(|| panic!("no wall: {line}"));
        range_m = range_m.max((hit.range_m - expected).abs() * math::hypot(v, w));
        let apart_m = math::wrap_signed(hit.arc_m - expected_arc_m, profile.perimeter_m());
        arc_m = arc_m.max(apart_m.abs());
        count += 1;
    }
    (range_m, arc_m, count)
}

#[test]
fn rays_that_start_1_mm_from_the_wall_agree_with_50_digit_values() {
    let (range_m, arc_m, count) = worst("millimetre");
    assert_eq!(count, 144);
    found("geometry.millimetre", range_m.max(arc_m), 1e-13);
}

/// A ray meets the wall at 89.99 degrees to the normal. Then a position error across the wall causes an error along the
/// wall that is 5,730 times as large.
#[test]
fn rays_nearly_along_the_wall_agree_with_50_digit_values() {
    let (range_m, arc_m, count) = worst("grazing");
    assert_eq!(count, 144);
    let condition = 1.0 / math::cos(f64::to_radians(89.99));
    found_at("geometry.grazing", condition, range_m.max(arc_m), 1e-11);
}

#[test]
fn rays_through_corners_and_an_ulp_beside_them_agree_with_50_digit_values() {
    let (range_m, arc_m, count) = worst("corner");
    assert_eq!(count, 36);
    found("geometry.corner", range_m.max(arc_m), 1e-14);
}

/// In the formula for a tangent ray, the value under the root is 0 or a few ulps.
///
/// An error of one ulp in it is an error of sqrt(ulp) in the result.
#[test]
fn rays_tangent_to_the_vault_agree_with_50_digit_values() {
    let (range_m, arc_m, count) = worst("tangent");
    assert_eq!(count, 56);
    found_at("geometry.tangent", 1.0 / math::sqrt(f64::EPSILON), range_m.max(arc_m), 1e-7);
}

/// The profile is a rotated square with rounded corners, so each wall runs into an arc tangentially.
///
/// Through rounding, a ray along a wall is slightly inside or outside the circle of the arc. So the value under the
/// root has either sign.
#[test]
fn rays_along_walls_end_at_the_end_of_the_wall() {
    let (half, radius) = (2.0, 0.5);
    let (mut worst_m, mut negative, mut positive) = (0.0_f64, 0, 0);
    for turn in 0..400 {
        let (sin, cos) = math::sin_cos(0.5 + f64::from(turn) * 1e-3);
        let turned = |[y, z]: Yz| [y * cos - z * sin, 3.0 + y * sin + z * cos];
        let inner = half - radius;
        // The profile's pieces run counter-clockwise from the middle of the lower wall.
        let corners = [[inner, -inner], [inner, inner], [-inner, inner], [-inner, -inner]];
        let lines = [[inner, -half], [half, inner], [-inner, half], [-half, -inner]];
        let mut pieces = Vec::new();
        for (centre, end) in corners.into_iter().zip(lines) {
            pieces.push(Piece::LineTo(turned(end)));
            pieces.push(Piece::Arc { centre: turned(centre), sweep_rad: math::FRAC_PI_2 });
        }
        let profile = Profile::new(turned([0.0, -half]), &pieces, [0.0, 3.0]).unwrap();
        for side in [[half, 0.0, 0.0, 1.0], [0.0, half, -1.0, 0.0], [-half, 0.0, 0.0, -1.0]] {
            let [y, z, v, w] = side;
            let (origin, direction) = (turned([y, z]), [v * cos - w * sin, v * sin + w * cos]);
            // The end of the wall, where the arc starts, and the centre of this arc.
            let end = turned([y + inner * v, z + inner * w]);
            let centre = turned([
                y + inner * v - radius * w.abs() * y.signum(),
                z + inner * w - radius * v.abs() * z.signum(),
            ]);
            let offset = [origin[0] - centre[0], origin[1] - centre[1]];
            let along = offset[0] * direction[0] + offset[1] * direction[1];
            let beyond = offset[0] * offset[0] + offset[1] * offset[1] - radius * radius;
            let under_root =
                along * along - (direction[0] * direction[0] + direction[1] * direction[1]) * beyond;
            if under_root < 0.0 {
                negative += 1;
            } else {
                positive += 1;
            }
            let hit = profile
                .cast_from_inside(origin, direction)
                .unwrap_or_else(|| panic!("no wall at turn {turn}"));
            // Through rounding, a ray along a straight wall may hit the wall before its end, which is no error. Past
            // the end, only the arc can be hit.
            let off = [hit.point[0] - end[0], hit.point[1] - end[1]];
            let beyond_m = off[0] * direction[0] + off[1] * direction[1];
            let across_m = off[0] * direction[1] - off[1] * direction[0];
            worst_m = worst_m.max(beyond_m).max(across_m.abs());
        }
    }
    assert!(negative > 100 && positive > 100, "{negative} and {positive}");
    found_at("geometry.tangent_turned", 1.0 / math::sqrt(f64::EPSILON), worst_m, 1e-6);
}
