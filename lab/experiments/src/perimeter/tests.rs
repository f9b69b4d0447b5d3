use headrace_geometry::math::PI;
use headrace_geometry::tunnel::{Profile, Yz, shapes};

use super::*;

/// Simulates a turn of 1200 pings of a head at a position in the cross-section. Each ping is a fan of rays.
fn turn(profile: &Profile, from: Yz, beam_deg: f64, rays: u32) -> Vec<Ping> {
    let ping = |k: u32| {
        let angle_rad = f64::from(k) * TAU / 1200.0;
        let off = |ray: u32| (f64::from(ray) / f64::from((rays - 1).max(1)) - 0.5) * beam_deg.to_radians();
        let range = |ray: u32| {
            let shift = if rays == 1 { 0.0 } else { off(ray) };
            let (sin, cos) = math::sin_cos(angle_rad + shift);
            profile.cast(from, [sin, -cos]).unwrap().range_m
        };
        Ping { angle_rad, ranges_m: (0..rays).map(range).collect() }
    };
    (0..1200).map(ping).collect()
}

fn close(value: f64, wanted: f64, share: f64) {
    assert!((value / wanted - 1.0).abs() < share, "{value}, wanted {wanted}");
}

#[test]
fn polygon_through_points_of_a_circle_has_the_length_of_its_chords() {
    let profile = shapes::circle(4.0).unwrap();
    let pings = turn(&profile, [0.0, 4.0], 0.0, 1);
    let chords = 1200.0 * 8.0 * math::sin(PI / 1200.0);
    close(polygon_m(&least_ranges(&pings)).unwrap(), chords, 1e-12);
    let mut shuffled = mean_ranges(&pings);
    shuffled.reverse();
    shuffled.push((f64::NAN, 1.0));
    shuffled.push((1.0, f64::INFINITY));
    close(polygon_m(&shuffled).unwrap(), chords, 1e-12);
}

#[test]
fn corrected_skeleton_of_a_circle_has_its_perimeter() {
    for (centre, radius) in [([0.0, 4.0], 4.0), ([0.6, 4.3], 4.0), ([0.0, 2.0], 2.0)] {
        let profile = shapes::circle(radius).unwrap();
        let chain = skeleton(&turn(&profile, centre, 0.0, 1), &Settings::of_paper()).unwrap();
        close(chain.corrected_m, TAU * radius, 0.01);
        close(chain.steps_m, TAU * radius * 1.055, 0.02);
    }
}

#[test]
fn thin_beam_measures_the_perimeter_of_the_ceran_tunnel() {
    let profile = shapes::ceran_blueprint().unwrap();
    let pings = turn(&profile, profile.reference(), 0.0, 1);
    close(polygon_m(&least_ranges(&pings)).unwrap(), 34.17, 1e-3);
    let chain = skeleton(&pings, &Settings::of_paper()).unwrap();
    close(chain.corrected_m, 34.17, 0.01);
}

#[test]
fn wide_beam_rounds_corners_off() {
    let profile = shapes::ceran_blueprint().unwrap();
    let pings = turn(&profile, profile.reference(), 1.4, 29);
    let first = polygon_m(&least_ranges(&pings)).unwrap();
    let chain = skeleton(&pings, &Settings::of_paper()).unwrap();
    assert!(first < 34.17 && first > 33.0, "{first}");
    close(chain.corrected_m, 34.17, 0.02);
}

#[test]
fn polygon_of_a_square_has_its_perimeter() {
    let profile = shapes::rectangle(4.0, 4.0).unwrap();
    let chain = skeleton(&turn(&profile, [0.0, 2.0], 0.0, 1), &Settings::of_paper()).unwrap();
    close(chain.steps_m, 16.0, 0.01);
    close(chain.corrected_m, 16.0, 0.03);
}

#[test]
fn small_gap_between_pings_is_interpolated() {
    let profile = shapes::circle(4.0).unwrap();
    let mut pings = turn(&profile, [0.0, 4.0], 0.0, 1);
    pings.retain(|p| p.angle_rad > 0.5);
    close(skeleton(&pings, &Settings::of_paper()).unwrap().corrected_m, TAU * 4.0, 0.01);
    for ping in pings.iter_mut().filter(|p| p.angle_rad > 1.0) {
        ping.ranges_m = vec![1.0];
    }
    assert_eq!(skeleton(&pings, &Settings::of_paper()), Err(PerimeterError::NotClosed));
}

#[test]
fn specks_inside_the_wall_outline_do_not_change_the_perimeter() {
    let profile = shapes::circle(4.0).unwrap();
    let clean = turn(&profile, [0.0, 4.0], 0.0, 1);
    let mut noisy = clean.clone();
    for ping in noisy.iter_mut().step_by(100) {
        ping.ranges_m.push(1.5);
    }
    let settings = Settings::of_paper();
    assert_eq!(skeleton(&noisy, &settings).unwrap(), skeleton(&clean, &settings).unwrap());
}

#[test]
fn input_without_perimeter_is_refused() {
    let settings = Settings::of_paper();
    assert_eq!(skeleton(&[], &settings), Err(PerimeterError::TooFewPings { count: 0 }));
    assert_eq!(polygon_m(&[(0.0, 1.0); 2]), Err(PerimeterError::TooFewPings { count: 2 }));
    let far = vec![Ping { angle_rad: 0.0, ranges_m: vec![50.0] }; 10];
    assert!(skeleton(&far, &settings).is_err());
    let tiny = Settings { pixel_m: 1e-6, ..settings };
    assert!(matches!(skeleton(&far, &tiny), Err(PerimeterError::Setting { setting: "pixel_m", .. })));
    let nan = Settings { threshold: f64::NAN, ..settings };
    assert!(matches!(skeleton(&far, &nan), Err(PerimeterError::Setting { setting: "threshold", .. })));
}
