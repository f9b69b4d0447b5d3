use headrace_geometry::frames::{Point3, Vec3};
use headrace_geometry::tunnel::shapes;
use headrace_sampling::section::footprint_m;

use super::*;
use crate::testing::Dive;

fn down(angle_rad: f64, height_m: f64) -> Ray {
    let (sine, cosine) = math::sin_cos(angle_rad);
    Ray { origin: Point3::new(0.0, 0.0, height_m), direction: Vec3::new(0.0, sine, -cosine), hit: None }
}

fn wide_tunnel() -> Environment {
    Environment::straight(shapes::rectangle(60.0, 20.0).unwrap())
}

#[test]
fn beam_rays_cover_the_whole_footprint_on_the_floor() {
    let tunnel = wide_tunnel();
    for (angle_deg, width_deg) in [(0.0, 2.4), (30.0, 2.4), (60.0, 1.4), (60.0, 20.0)] {
        let (angle_rad, width_rad) = (f64::to_radians(angle_deg), f64::to_radians(width_deg));
        let ray = down(angle_rad, 3.0);
        let hits: Vec<Hit> = Cone::new(width_rad, 64).hits(&tunnel, &ray, 100.0).flatten().collect();
        assert_eq!(hits.len(), 64);
        let y_m = |most: fn(f64, f64) -> f64| hits.iter().map(|hit| hit.point.y()).reduce(most).unwrap();
        let found_m = y_m(f64::max) - y_m(f64::min);
        let whole_m = footprint_m(3.0, angle_rad, width_rad).unwrap();
        assert!((found_m - whole_m).abs() < 1e-9, "{angle_deg}: {found_m}, {whole_m}");
    }
}

#[test]
fn first_return_of_oblique_beam_is_from_its_nearer_edge() {
    let tunnel = wide_tunnel();
    let half_rad = f64::to_radians(0.7);
    for angle_deg in [0.0, 0.5, 20.0, 60.0] {
        let angle_rad = f64::to_radians(angle_deg);
        let cone = Cone::new(2.0 * half_rad, 64);
        let ray = down(angle_rad, 3.0);
        let first_m =
            cone.hits(&tunnel, &ray, 100.0).flatten().map(|hit| hit.range_m).reduce(f64::min).unwrap();
        // Range of the point of the floor that is nearest within the cone.
        let nearest_m = 3.0 / math::cos((angle_rad - half_rad).max(0.0));
        // If the perpendicular to the floor is within the cone, no ray hits the floor's nearest point exactly, so more
        // error is allowed.
        let allowed_m = if angle_rad < half_rad { 2e-5 } else { 1e-12 };
        assert!((first_m - nearest_m).abs() < allowed_m, "{angle_deg}: {first_m} {nearest_m}");
    }
}

#[test]
fn mean_range_is_averaged_over_the_disc_of_the_cone() {
    let tunnel = wide_tunnel();
    let (half_rad, ray) = (f64::to_radians(10.0), down(0.0, 3.0));
    let mean_m = {
        let cone = Cone::new(2.0 * half_rad, 64);
        let ranges_m = cone.hits(&tunnel, &ray, 100.0).flatten().map(|hit| hit.range_m);
        mean(ranges_m).unwrap()
    };
    // Mean range h / cos x of rays to a flat wall, where h is the height of the beam's origin and x a ray's angle from
    // the axis. The squares of the angles are evenly spread, as for rays that fill a disc.
    let count = 10_000;
    let ring = |k: i32| 3.0 / math::cos(half_rad * math::sqrt((f64::from(k) + 0.5) / f64::from(count)));
    let whole_m = (0..count).map(ring).sum::<f64>() / f64::from(count);
    assert!((mean_m - whole_m).abs() < 1e-4 * whole_m, "{mean_m} {whole_m}");
}

#[test]
fn beam_cone_of_one_ray_equals_the_ideal_beam_bit_for_bit() {
    let dive = Dive::with_head();
    let base = dive.dive("");
    for effects in ["[effects.beam_cone]\nrays = 1", "[effects.beam_cone]\nrays = 1\nform = \"mean\""] {
        assert_eq!(base.messages, dive.dive(effects).messages);
    }
}

#[test]
fn beam_cone_leaves_the_true_axis_point_and_perpendicular_ranges_unchanged() {
    let dive = Dive::with_head();
    let (base, first, bilinear) = (
        dive.dive(""),
        dive.dive("[effects.beam_cone]"),
        dive.dive("[effects.beam_cone]\nform = \"bilinear\""),
    );
    assert!(bilinear.rows.len() > 400);
    for ((base, first), bilinear) in base.rows.iter().zip(&first.rows).zip(&bilinear.rows) {
        let range_m = |row: &crate::truth::TruthRow| row.sounding.unwrap().measured.range_m.unwrap();
        assert!(base.wall() == first.wall() && base.wall() == bilinear.wall());
        assert!(range_m(first) <= range_m(base) + 1e-12);
        // The beam is at most 45 degrees from the perpendicular to a wall. A turn by half a degree then changes its
        // range by less than 3 %.
        assert!((range_m(bilinear) - range_m(base)).abs() < 0.03 * range_m(base));
        if range_m(base) < 2.501 {
            assert!((range_m(bilinear) - range_m(base)).abs() < 0.002, "{}", range_m(bilinear));
        }
    }
}

#[test]
fn small_object_gives_the_first_echo_but_not_the_strongest() {
    let mut bins = Bins::new(0.02);
    let cone = Cone::new(f64::to_radians(1.4), 64);
    for (number, part) in cone.rays.iter().enumerate() {
        bins.add(if number == 40 { 4.0 } else { 5.0 }, part.strength);
    }
    assert!((bins.take_surface_m().unwrap() - 5.0).abs() < 1e-9);
}

#[test]
fn beam_width_of_a_head_follows_its_frequency() {
    for (khz, deg) in [(600.0, 2.4), (800.0, 1.9), (1000.0, 1.4)] {
        assert!((width_at_deg(khz) - deg).abs() < 1e-12);
    }
}

#[test]
fn time_slice_length_does_not_change_results() {
    Dive::with_head().assert_slices_dont_matter("[effects.beam_cone]\nform = \"bilinear\"\nrays = 8");
}

#[test]
fn impossible_beams_are_refused() {
    let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.beam_cone]\n{keys}"));
    assert!(refusal("rays = 1025").contains("must be a whole number from 1 to 1024"));
    assert!(refusal("width_deg = 2\nfrequency_khz = 700").contains("cannot be combined with width_deg"));
    assert!(refusal("bin_m = 0.02").contains("bilinear"));
    assert!(refusal("form = \"last\"").contains("must be one of first, mean, bilinear"));
    assert!(refusal("rings = 3").contains("is not a key here"));
    assert!(refusal("sensors = [\"depth\"]").contains("this effect can act on: sonar_0"));
}

#[test]
fn single_echo_is_found_at_its_range_and_then_removed() {
    let mut bins = Bins::new(0.02);
    for range_m in [3.0, 3.001, 3.009, 3.010, 3.0199, 0.0, 12.5] {
        bins.add(range_m, 0.7);
        assert!((bins.take_surface_m().unwrap() - range_m).abs() < 1e-12, "{range_m}");
    }
    assert_eq!(bins.take_surface_m(), None);
}

#[test]
fn range_is_the_mean_of_the_strongest_echo_and_its_neighbours() {
    let mut bins = Bins::new(0.02);
    bins.add(3.0, 1.0);
    bins.add(4.0, 1.5);
    assert!((bins.take_surface_m().unwrap() - 4.0).abs() < 1e-12);
    bins.add(3.00, 1.0);
    bins.add(3.02, 3.0);
    assert!((bins.take_surface_m().unwrap() - 3.015).abs() < 1e-12);
}
