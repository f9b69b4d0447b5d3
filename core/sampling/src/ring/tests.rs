use proptest::prelude::*;

use super::*;
use crate::head::Turn;
use crate::section;
use crate::spacing;
use headrace_geometry::frames::Body;
use headrace_geometry::tunnel::shapes;

fn pose(profile: &Profile, y: f64, z: f64, yaw: f64) -> Pose {
    let [y0, z0] = profile.reference();
    Pose {
        position: Point3::new(7_000.0, y0 + y, z0 + z),
        attitude: Rot::<Tunnel, Body>::from_roll_pitch_yaw(0.0, 0.0, yaw),
    }
}

fn mount() -> Mount {
    Mount { position: Vec3::zero(), rotation: Rot::identity() }
}

fn standing(profile: &Profile) -> Standing<'_> {
    Standing::new(profile, &pose(profile, 0.0, 0.0, 0.0), &mount()).unwrap()
}

/// The reference table lists T_max, by Eq. 16 of Jorge et al. 2021, for the tunnel `ceran` at 0.197 m/s.
///
/// In this test, the pings are at the head's actual angles.
#[test]
fn t_max_equals_the_reference_table() {
    let profile = shapes::ceran().unwrap();
    let modes = [
        (0.3, 21.6, [4.259, 2.132, 1.069]),
        (0.6, 10.8, [2.134, 1.074, 0.548]),
        (0.9, 8.0, [1.589, 0.811, 0.434]),
        (1.2, 6.6, [1.325, 0.695, 0.404]),
        (2.4, 4.8, [1.042, 0.639, 0.513]),
    ];
    for (step_deg, turn_s, expected) in modes {
        let turn = Turn::new(f64::to_radians(step_deg), turn_s).unwrap();
        for (heads, expected) in [1.0, 2.0, 4.0].into_iter().zip(expected) {
            // A quarter turn is 37.5 steps of 2.4 degrees, so every second head's pings are half a step away from the
            // corner.
            let t_y = (0..4)
                .map(|head| TAU * (f64::from(head) / heads))
                .map(|start| Ring::cast(&standing(&profile), start, turn.steps()).unwrap().largest_step_m(1))
                .fold(0.0, f64::max);
            let t = spacing::t_max_m(0.197 * turn_s / heads, 0.197 * turn.ping_period_s(), t_y);
            assert!((t / expected - 1.0).abs() < 2e-3, "{step_deg} deg x {heads}: {t} and {expected}");
        }
    }
}

/// At chainage 7 km, the closed forms hold on a flat floor and on a circle to 1e-12 of their values.
#[test]
fn ray_casting_agrees_with_the_closed_forms() {
    let square = shapes::rectangle(4.0, 4.0).unwrap();
    let round = shapes::circle(6.05).unwrap();
    for steps in [150_u32, 300, 400, 600, 1200] {
        let turn = Turn::new(TAU / f64::from(steps), 1.0).unwrap();
        let step = turn.step_rad();
        let ring = Ring::cast(&standing(&square), 0.0, steps).unwrap();
        let mut pairs = ring.pairs(1);
        let mut sum = 0.0;
        for m in 1..=steps / 8 {
            let (a, b) = pairs.next().unwrap();
            let closed = section::t_y2_m(2.0, step, m).unwrap();
            for cast in [a.chord_m(b), a.step_m(b, 16.0)] {
                assert!((cast / closed - 1.0).abs() < 1e-12, "{steps} steps, {m}: {cast} and {closed}");
            }
            sum += a.chord_m(b);
        }
        let mean = section::t_y2_mean_m(2.0, step, steps / 8).unwrap();
        assert!((sum / f64::from(steps / 8) / mean - 1.0).abs() < 1e-12);
        let [least, _, most] = Ring::cast(&standing(&round), 0.1, steps).unwrap().chords_m(1);
        let crown = section::t_c_m(6.05, step).unwrap();
        assert!((least / crown - 1.0).abs() < 1e-12 && (most / crown - 1.0).abs() < 1e-12);
    }
}

#[test]
fn footprint_on_a_flat_wall_equals_the_closed_form() {
    let square = shapes::rectangle(40.0, 4.0).unwrap();
    let beam = f64::to_radians(2.4);
    for angle_deg in [0.0, 20.0, 60.0, 80.0] {
        let angle = f64::to_radians(angle_deg);
        let footprint = standing(&square).footprint(angle, beam).unwrap();
        let closed = section::footprint_m(2.0, angle, beam).unwrap();
        assert!((footprint.in_plane_m / closed - 1.0).abs() < 1e-11, "{angle_deg}");
        let across = section::beam_width_m(2.0 / math::cos(angle), beam).unwrap();
        assert!((footprint.across_m / across - 1.0).abs() < 1e-11, "{angle_deg}");
    }
}

#[test]
fn yaw_widens_sample_spacing_until_a_beam_along_the_tunnel_is_an_error() {
    let profile = shapes::ceran().unwrap();
    let turned = pose(&profile, 0.0, 0.0, f64::to_radians(15.0));
    let head = Standing::new(&profile, &turned, &mount()).unwrap();
    let ring = Ring::cast(&head, 0.0, 400).unwrap();
    assert!(ring.largest_step_m(1) > Ring::cast(&standing(&profile), 0.0, 400).unwrap().largest_step_m(1));
    // At a yaw of 15 degrees, the beam to the left wall meets it ahead or astern by tan(15 degrees) times the lateral
    // range.
    let left = head.sounding(math::FRAC_PI_2).unwrap();
    assert!((left.beam.x() / left.beam.y() + math::tan(f64::to_radians(15.0))).abs() < 1e-12);

    let across = pose(&profile, 0.0, 0.0, math::FRAC_PI_2);
    let along = Standing::new(&profile, &across, &mount()).unwrap().sounding(math::FRAC_PI_2);
    assert!(matches!(along, Err(SamplingError::BeamAlongTunnel { angle_deg }) if angle_deg > 89.0));
    assert!(Ring::cast(&Standing::new(&profile, &across, &mount()).unwrap(), 0.0, 4).is_err());
    assert!(Ring::cast(&head, 0.0, 0).is_err());

    for (y, z) in [(7.0, 0.0), (0.0, -4.0), (f64::NAN, 0.0)] {
        let outside = Standing::new(&profile, &pose(&profile, y, z, 0.0), &mount());
        assert!(matches!(outside, Err(SamplingError::HeadOutside { .. })), "{y}, {z}");
    }
}

#[test]
fn every_eighth_ray_gives_the_largest_distance_of_a_head_with_an_8_times_larger_step() {
    let profile = shapes::ceran().unwrap();
    let fine = Ring::cast(&standing(&profile), 0.0, 1200).unwrap();
    let coarse = |start: u32| {
        let start = TAU * f64::from(start) / 1200.0;
        Ring::cast(&standing(&profile), start, 150).unwrap().largest_step_m(1)
    };
    let worst = (0..8).map(coarse).fold(0.0, f64::max);
    assert!((fine.largest_step_m(8) - worst).abs() < 1e-12);
    assert!(
        Ring::default().chords_m(1).iter().all(|m| *m <= 0.0) && Ring::default().largest_step_m(3) <= 0.0
    );
}

#[test]
fn sample_distance_with_few_pings_per_turn_is_at_least_half_of_the_perimeter() {
    let profile = shapes::rectangle(20.0, 2.0).unwrap();
    let ring = Ring::cast(&standing(&profile), 0.0, 1200).unwrap();
    let perimeter_m = profile.perimeter_m();
    assert!((ring.largest_step_m(1200) - perimeter_m).abs() < 1e-9);
    // With two pings per turn, one of the two distances between samples is at least half of the perimeter.
    assert!(ring.largest_step_m(600) >= perimeter_m / 2.0 - 1e-9);
    // For a head close to the left wall, a third of a turn spans more than half of the perimeter.
    let near = Standing::new(&profile, &pose(&profile, 9.9, 0.0, 0.0), &mount()).unwrap();
    let ring = Ring::cast(&near, 0.0, 1200).unwrap();
    assert!(ring.largest_step_m(400) > 0.8 * perimeter_m, "{}", ring.largest_step_m(400));
    // The distances between the samples of a turn add up to one perimeter.
    for stride in [1, 8, 400] {
        let around: f64 = ring.steps_m(stride).step_by(stride).sum();
        assert!((around - perimeter_m).abs() < 1e-9);
    }
}

proptest! {
    /// Eq. 10: for any head position and profile, the mean chord between samples of a turn is at most perimeter /
    /// pings.
    #[test]
    fn mean_sample_distance_is_bounded_by_the_perimeter(
        radii in prop::collection::vec(0.5..6.0f64, 5..40),
        (along, around) in (0.0..0.95f64, 0.0..TAU),
        steps in 3_u32..800,
        start in 0.0..TAU,
    ) {
        let count = radii.len() as f64;
        let points: Vec<[f64; 2]> = radii
            .iter()
            .enumerate()
            .map(|(k, r)| {
                let (sine, cosine) = math::sin_cos(TAU * (k as f64 + 0.3) / count);
                [r * cosine, r * sine]
            })
            .collect();
        let profile = Profile::polygon(&points, Some([0.0, 0.0])).unwrap();
        // Point at which the head is, between the reference point and the wall.
        let (sine, cosine) = math::sin_cos(around);
        let wall = profile.cast([0.0, 0.0], [cosine, sine]).unwrap().range_m;
        let pose = pose(&profile, along * wall * cosine, along * wall * sine, 0.0);
        let head = Standing::new(&profile, &pose, &mount()).unwrap();
        let [least, mean, most] = Ring::cast(&head, start, steps).unwrap().chords_m(1);
        let bound = section::t_yp_m(profile.perimeter_m(), steps).unwrap();
        prop_assert!(mean <= bound * (1.0 + 1e-12), "{mean} and {bound}");
        prop_assert!(least <= mean && mean <= most);
    }
}
