use super::*;
use crate::frames::{Vec3, head_direction};
use crate::tunnel::Yz;
use headrace_support::hard_cases::found;
use proptest::prelude::*;

fn all() -> Vec<(&'static str, Profile)> {
    vec![
        ("ceran", ceran().unwrap()),
        ("ceran-blueprint", ceran_blueprint().unwrap()),
        ("rectangle", rectangle(4.0, 3.0).unwrap()),
        ("circle", circle(1.2).unwrap()),
        ("arch", arch(6.0, 5.0, 3.0).unwrap()),
        ("flat arch", arch(6.0, 5.0, 8.0).unwrap()),
        (
            "polygon",
            Profile::polygon(
                &[[2.0, 0.0], [3.0, 2.0], [0.0, 4.0], [-2.0, 3.0], [-2.5, 0.0]],
                Some([0.0, 1.8]),
            )
            .unwrap(),
        ),
    ]
}

/// The expected values are derived from the dimensions in Jorge et al. 2021.
#[test]
fn ceran_tunnel_has_the_dimensions_derived_from_the_paper() {
    let ceran = ceran().unwrap();
    assert!((ceran.perimeter_m() - 35.90).abs() < 0.005, "{}", ceran.perimeter_m());
    assert!((ceran.reference()[1] - 3.092).abs() < 0.0005);
    let up = ceran.cast(ceran.reference(), [0.0, 1.0]).unwrap();
    assert!((up.point[1] - 9.142).abs() < 0.0005);
    assert!((ceran_blueprint().unwrap().perimeter_m() - 34.17).abs() < 1e-12);
}

#[test]
fn arc_length_grows_with_the_head_angle_from_the_floor_centre() {
    for (name, profile) in all() {
        let mut last = -1.0;
        for degree in 0..360 {
            let d: Vec3<_> = head_direction(f64::from(degree).to_radians());
            let hit = profile.cast(profile.reference(), [d.y(), d.z()]).unwrap();
            assert!(hit.arc_m > last, "{name} at {degree} deg: {} after {last}", hit.arc_m);
            last = hit.arc_m;
            if degree == 90 {
                assert!(hit.point[0] > 0.0, "{name}: 90 deg is left");
            }
        }
    }
}

/// A dense polyline through points of the profile is inscribed in its arcs, so ranges to it are slightly too short.
#[test]
fn ranges_agree_with_a_dense_polyline() {
    for (name, profile) in all() {
        let count = 20_000;
        let points: Vec<Yz> = (0..count)
            .map(|i| profile.point_at(profile.perimeter_m() * f64::from(i) / f64::from(count)))
            .collect();
        let polyline = Profile::polygon(&points, Some(profile.reference())).unwrap();
        assert!((polyline.perimeter_m() - profile.perimeter_m()).abs() < 2e-3, "{name}");
        let reference = profile.reference();
        let origin = [reference[0] + 0.4, reference[1] - 0.3];
        for step in 0..97 {
            let angle = TAU * f64::from(step) / 97.0;
            let direction = [math::cos(angle), math::sin(angle)];
            let (a, b) =
                (profile.cast(origin, direction).unwrap(), polyline.cast(origin, direction).unwrap());
            assert!((a.range_m - b.range_m).abs() < 2e-3, "{name}: {} and {}", a.range_m, b.range_m);
            let apart = math::wrap_signed(a.arc_m - b.arc_m, profile.perimeter_m());
            assert!(apart.abs() < 3e-3, "{name}: {} and {}", a.arc_m, b.arc_m);
        }
    }
}

#[test]
fn rays_through_a_corner_and_an_ulp_beside_it_hit_the_corner() {
    for (name, profile) in all() {
        let origin = profile.reference();
        for arc in profile.corners_m() {
            let corner = profile.point_at(arc);
            let exact = [corner[0] - origin[0], corner[1] - origin[1]];
            for direction in [exact, [exact[0].next_up(), exact[1]], [exact[0].next_down(), exact[1]]] {
                let hit = profile.cast(origin, direction).unwrap();
                assert!((hit.range_m - 1.0).abs() < 1e-12, "{name} at {corner:?}: {}", hit.range_m);
                let apart = math::wrap_signed(hit.arc_m - arc, profile.perimeter_m());
                assert!(apart.abs() < 1e-9, "{name} at {corner:?}");
            }
        }
    }
}

#[test]
fn rays_that_start_1_mm_from_the_wall_end_on_the_wall() {
    for (name, profile) in all() {
        for step in 0..50 {
            let wall = profile.cast(profile.reference(), {
                let angle = TAU * f64::from(step) / 50.0 + 0.013;
                [math::cos(angle), math::sin(angle)]
            });
            let wall = wall.unwrap();
            let origin = [wall.point[0] + 1e-3 * wall.normal[0], wall.point[1] + 1e-3 * wall.normal[1]];
            for off_deg in [0.0, 45.0, 89.99, -89.99, 180.0] {
                let (sin, cos) = math::sin_cos(f64::to_radians(off_deg));
                let (n, t) = (wall.normal, [-wall.normal[1], wall.normal[0]]);
                let direction = [-n[0] * cos + t[0] * sin, -n[1] * cos + t[1] * sin];
                let hit = profile.cast(origin, direction).unwrap_or_else(|| panic!("{name} {off_deg}"));
                let back = profile.point_at(hit.arc_m);
                let error = math::hypot(back[0] - hit.point[0], back[1] - hit.point[1]);
                assert!(error < 1e-9, "{name} {off_deg}: {error}");
                if off_deg == 0.0 {
                    assert!((hit.range_m - 1e-3).abs() < 1e-12, "{name}: {}", hit.range_m);
                }
            }
        }
    }
}

/// A ray runs up along a wall, which continues tangentially as a half-circle.
///
/// The ray touches the circle at its start. A ray a few ulps inside the wall crosses the circle above its start, by
/// sqrt((2 - y) (2 + y)). The test computes this height without cancellation.
#[test]
fn ray_tangent_to_the_vault_meets_it_at_the_springing() {
    let profile = arch(4.0, 4.0, 2.0).unwrap();
    let mut half: f64 = 2.0;
    for ulps in 0..2000 {
        for y in [half, -half] {
            let Some(hit) = profile.cast_from_inside([y, 1.0], [0.0, 1.0]) else {
                panic!("no wall {ulps} ulps beside the wall");
            };
            let above_m = math::sqrt((2.0 - half) * (2.0 + half));
            // The circle's equation subtracts nearly equal values of 4 m^2, so the value under its root may be wrong by
            // one ulp of 4.
            let error_m = (hit.range_m - (1.0 + above_m)).abs();
            assert!(error_m < 4.3e-8, "{ulps} ulps, y {y}: {error_m}");
            assert!(profile.contains([hit.point[0] * 0.999, hit.point[1]]));
        }
        half = half.next_down();
    }
}

#[test]
fn ray_from_outside_has_no_hit() {
    for (name, profile) in all() {
        assert_eq!(profile.cast([100.0, 1.0], [-1.0, 0.0]), None, "{name}");
        assert_eq!(profile.cast(profile.reference(), [0.0, 0.0]), None, "{name}");
        assert_eq!(profile.cast([f64::NAN, 1.0], [1.0, 0.0]), None, "{name}");
    }
}

#[test]
fn error_of_an_invalid_curve_names_its_vertex() {
    let bow_tie = [[1.0, 0.0], [-1.0, 2.0], [1.0, 2.0], [-1.0, 0.0]];
    assert!(Profile::polygon(&bow_tie, Some([0.0, 1.0])).is_err());
    let hooked = [[3.0, 0.0], [3.0, 4.0], [2.9, 4.0], [2.9, 0.5], [-3.0, 0.5], [-3.0, 0.0]];
    assert!(matches!(
        Profile::polygon(&hooked, Some([0.0, 0.2])),
        Err(ProfileError::NotStarShaped { vertex: 2, .. })
    ));
    assert!(matches!(Profile::polygon(&[[0.0, 0.0]; 9], None), Err(ProfileError::TooFewPoints { count: 1 })));
    assert!(matches!(
        Profile::polygon(&[[0.0, f64::NAN], [1.0, 0.0], [1.0, 1.0]], None),
        Err(ProfileError::NotFinite { vertex: 0 })
    ));
}

#[test]
fn repeated_collinear_and_almost_equal_points_have_no_effect() {
    let plain = Profile::polygon(&[[2.0, 0.0], [2.0, 3.0], [-2.0, 3.0], [-2.0, 0.0]], None).unwrap();
    let messy = [
        [2.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [2.0, 1.0 + 1e-12],
        [2.0, 3.0],
        [0.0, 3.0],
        [-2.0, 3.0],
        [-2.0, 0.0],
        [-1.0, 0.0],
        [2.0, 0.0],
    ];
    let messy = Profile::polygon(&messy, Some(plain.reference())).unwrap();
    let mut worst_m = (plain.perimeter_m() - messy.perimeter_m()).abs();
    for step in 0..60 {
        let angle = TAU * f64::from(step) / 60.0;
        let direction = [math::cos(angle), math::sin(angle)];
        let (a, b) = (plain.cast([0.5, 1.0], direction).unwrap(), messy.cast([0.5, 1.0], direction).unwrap());
        worst_m = worst_m.max((a.range_m - b.range_m).abs()).max((a.arc_m - b.arc_m).abs());
    }
    found("geometry.slivers", worst_m, 1e-10);
}

proptest! {
    /// Seen from the reference point, the wall point at any arc length has that same arc length.
    #[test]
    fn wall_point_at_an_arc_length_has_that_arc_length(which in 0usize..7, share in 0.0f64..1.0) {
        let (name, profile) = all().swap_remove(which);
        let arc = share * profile.perimeter_m();
        let back = profile.arc_of(profile.point_at(arc));
        let apart = math::wrap_signed(back - arc, profile.perimeter_m());
        prop_assert!(apart.abs() < 1e-9, "{} at {}: {}", name, arc, back);
    }

    #[test]
    fn hit_lies_on_the_ray_and_on_the_wall(which in 0usize..7, y in -0.8f64..0.8, z in -0.8f64..0.8, turn in 0.0f64..1.0) {
        let (_, profile) = all().swap_remove(which);
        let origin = [profile.reference()[0] + y, profile.reference()[1] + z];
        let direction = [math::cos(turn * TAU), math::sin(turn * TAU)];
        let hit = profile.cast(origin, direction).unwrap();
        let wall = profile.point_at(hit.arc_m);
        let along = [origin[0] + hit.range_m * direction[0], origin[1] + hit.range_m * direction[1]];
        prop_assert!(math::hypot(wall[0] - along[0], wall[1] - along[1]) < 1e-9);
        prop_assert!((math::hypot(hit.normal[0], hit.normal[1]) - 1.0).abs() < 1e-12);
        prop_assert!(hit.normal[0] * direction[0] + hit.normal[1] * direction[1] < 1e-9);
    }
}

#[test]
fn farthest_wall_along_a_direction_equals_a_dense_search() {
    for (name, profile) in all() {
        for k in 0..24 {
            let (sin, cos) = math::sin_cos(0.26 * f64::from(k));
            let [y_m, z_m] = profile.reference();
            let origin = [y_m + 0.3 * cos, z_m - 0.2 * sin];
            let along_m = |m: u32| {
                let [y, z] = profile.point_at(profile.perimeter_m() * f64::from(m) / 20_000.0);
                (cos * (y - origin[0]) + sin * (z - origin[1])).abs()
            };
            let dense_m = (0..20_000).map(along_m).fold(0.0, f64::max);
            let exact_m = profile.farthest_along_m(origin, [cos, sin]);
            assert!((0.0..2e-3).contains(&(exact_m - dense_m + 1e-12)), "{name} {k}: {exact_m} {dense_m}");
        }
    }
}
