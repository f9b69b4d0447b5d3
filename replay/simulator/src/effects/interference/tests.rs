use headrace_geometry::frames::{Vec3, head_direction};
use headrace_geometry::time::DurNs;
use headrace_geometry::tunnel::shapes;

use super::*;
use crate::environment::Environment;
use crate::testing::Dive;

const SOUND_MPS: f64 = 1500.0;

/// Two heads, one at each side of a box-shaped vehicle. The true speed of sound is that of the vehicle file.
fn pair() -> Dive {
    let mut dive = Dive::with_heads(&[[0.0, 0.4, 0.0], [0.0, -0.4, 0.0]]);
    dive.vehicle = "[water]\nsound_speed_mps = 1500\n[heads]\nlayout = \"phase_shift\"";
    dive
}

/// Two heads that never ping at the same time.
fn out_of_step() -> Dive {
    let mut dive = pair();
    dive.sensors[1].2 = dive.sensors[1].2.replace("medium", "fastest");
    dive.seconds = 30.0;
    dive
}

fn head(dive: &Dive, source: usize) -> HeadSpec {
    dive.scene("").unwrap().facts.sensors[source].head.unwrap()
}

#[test]
fn apparent_ranges_of_reflected_and_direct_pings_follow_from_time_and_path() {
    let dive = pair();
    let spec = head(&dive, 0);
    let other_spec = head(&dive, 1);
    let room = Environment::straight(shapes::rectangle(6.0, 5.0).unwrap());
    let scene = dive.scene("").unwrap();
    let scenery = Scenery {
        environment: room.clone(),
        trajectory: scene.trajectory.clone(),
        site: scene.vehicle.site,
        sets_out: None,
    };
    let ray = |y_m: f64, angle_rad: f64| {
        let local = head_direction(angle_rad);
        let (origin, direction) = (Point3::new(0.0, y_m, 2.5), Vec3::new(0.0, local.y(), local.z()));
        Ray { origin, direction, hit: room.cast(origin, direction, 100.0) }
    };
    let parameters = Parameters { frequency: 1, share: 0.0, margin_rad: Some(0.02) };
    let at = MonoNs(5_000_000_000);
    let heard = |own_rad: f64, theirs_rad: f64, later_ms: f64| {
        let own = ray(0.4, own_rad);
        let mut theirs = Pings::default();
        let when = at + DurNs::from_secs_f64(later_ms / 1000.0);
        theirs.add(Ping::new(when, &ray(-0.4, theirs_rad), false));
        let stream = Stream::new(1, "interference", "sonar_0");
        let hears = Hears { parameters, spec, stream, pings: Pings::default() };
        let sounds = Hears { parameters, spec: other_spec, stream, pings: theirs };
        let range_m = own.hit.unwrap().range_m;
        let mut ear = Ear {
            scenery: &scenery,
            hears: &hears,
            at,
            ray: &own,
            stopped: false,
            step: 0,
            within_m: [0.2, range_m],
            heard: false,
        };
        ear.hear(1, &sounds);
        ear.heard.then_some(ear.within_m[1])
    };
    // Both heads look at the middle of the floor, and their sounds' paths have equal length. Simultaneous pings don't
    // interfere. An earlier ping of the other head is heard.
    let inwards = math::atan2(0.4, 2.5);
    let way_m = 2.0 * math::hypot(0.4, 2.5);
    assert_eq!(heard(-inwards, inwards, 0.0), None);
    for earlier_ms in [0.1, 1.0, 2.9] {
        let expected_m = (way_m - earlier_ms / 1000.0 * SOUND_MPS) / 2.0;
        assert!((heard(-inwards, inwards, -earlier_ms).unwrap() - expected_m).abs() < 1e-6);
    }
    // An even earlier ping of the other head arrives before this head's own ping or within its least range, so it isn't
    // heard.
    assert_eq!(heard(-inwards, inwards, -3.4), None);
    // The other head now looks at a point of the wall outside this head's beam, so its ping isn't heard.
    assert_eq!(heard(-inwards, inwards + 0.1, -1.0), None);
    // The heads face each other, 0.8 m apart. If both ping at once, each hears the other at an apparent range of 0.4 m.
    let (right, left) = (1.5 * math::PI, math::FRAC_PI_2);
    assert!((heard(right, left, 0.0).unwrap() - 0.4).abs() < 1e-9);
    assert!((heard(right, left, -0.2).unwrap() - 0.25).abs() < 1e-6);
    assert_eq!(heard(right, left, -0.4), None);
    assert_eq!(heard(right - 0.3, left, 0.0), None);
}

/// Two heads half a turn apart face each other twice per turn. Each then hears the other at an apparent range of half
/// their distance.
#[test]
fn synchronous_heads_hear_each_other_when_facing() {
    let dive = pair();
    let spec = head(&dive, 0);
    let half_rad = spec.beam_rad / 2.0 + math::asin(spec.body.radius_m / 0.8);
    let (base, dived) = (dive.dive(""), dive.dive("[effects.interference]"));
    let mut heard = 0;
    let others: Vec<f64> = dived.soundings(1).into_iter().map(|(angle_rad, _)| angle_rad).collect();
    for (number, ((angle_rad, range_m), was)) in
        dived.soundings(0).into_iter().zip(base.ranges_m(0)).enumerate()
    {
        let off = |angle: f64, middle: f64| math::wrap_signed(angle - middle, math::TAU).abs();
        let faces =
            off(angle_rad, 1.5 * math::PI) <= half_rad && off(others[number], math::FRAC_PI_2) <= half_rad;
        if faces {
            // The apparent range is only approximate, because the vehicle moves between the pings of the two heads.
            assert!((range_m.unwrap() - 0.4).abs() < 1e-4, "{range_m:?}");
            heard += 1;
        } else {
            assert_eq!(range_m, was);
        }
    }
    assert!(heard > 5, "{heard}");
}

#[test]
fn unsynchronised_heads_hear_each_other_via_the_wall_and_through_side_lobes() {
    let dive = Dive { seconds: 100.0, ..out_of_step() };
    let count = |effects: &str| {
        let rows = dive.dive(effects).rows;
        let heard = rows.iter().filter(|row| !row.causes.is_empty());
        heard
            .map(|row| assert!(row.causes.iter().all(|cause| cause.from.is_nan() || cause.to < cause.from)))
            .count()
    };
    let wide = count("[effects.interference]\nmargin_deg = 45");
    let some = count("[effects.interference]\nshare = 0.3");
    let all = count("[effects.interference]\nshare = 1");
    assert!(wide > 100 && some > 100 && all > wide && all > 2 * some, "{wide} {some} {all}");
}

#[test]
fn time_slice_length_does_not_change_interference() {
    let mut dive = out_of_step();
    dive.seconds = 12.0;
    dive.assert_slices_dont_matter("[effects.interference]\nshare = 0.5");
    pair().assert_slices_dont_matter("[effects.interference]\nshare = 0.5\n[effects.occlusion]");
}

#[test]
fn heads_receive_interference_only_on_their_own_frequency() {
    let mut dive = Dive::with_heads(&[[0.0, 0.4, 0.0], [0.0, -0.4, 0.0], [0.9, 0.4, 0.0], [0.9, -0.4, 0.0]]);
    dive.vehicle = "[water]\nsound_speed_mps = 1500";
    let crossed = "[[effects.interference]]\nsensors = [\"sonar_0\", \"sonar_2\"]\n\
                   [[effects.interference]]\nsensors = [\"sonar_1\", \"sonar_3\"]";
    let faced = "[[effects.interference]]\nsensors = [\"sonar_0\", \"sonar_1\"]\n\
                 [[effects.interference]]\nsensors = [\"sonar_2\", \"sonar_3\"]";
    let straight = |effects: &str| {
        let rows = dive.dive(effects).rows;
        let near =
            |row: &&crate::truth::TruthRow| row.sounding.unwrap().measured.range_m.is_some_and(|m| m < 0.5);
        rows.iter().filter(near).count()
    };
    assert_eq!(straight(crossed), 0);
    assert_eq!(straight(faced) > 0, straight("[effects.interference]") > 0);
}

#[test]
fn idealised_heads_in_one_place_do_not_hear_each_other() {
    let dive = Dive::with_heads(&[[0.0; 3], [0.0; 3]]);
    assert_eq!(dive.dive("").messages, dive.dive("[effects.interference]\nshare = 1").messages);
}

#[test]
fn interference_of_a_single_head_is_refused() {
    assert!(
        Dive::with_head().refusal("[effects.interference]").contains("has one head; at least two are needed")
    );
    let refusal = |keys: &str| pair().refusal(&format!("[effects.interference]\n{keys}"));
    assert!(refusal("sensors = [\"sonar_1\"]").contains("has one head; at least two are needed"));
    assert!(
        refusal("sensors = [\"sonar_1\", \"sonar_1\"]").contains("has one head; at least two are needed")
    );
    assert!(refusal("share = -0.1").contains("from 0 to 1"));
    assert!(refusal("frequency_khz = 700").contains("is not a key here"));
}
