//! Checks which quantities the calibration refuses to estimate, and the reasons that it gives.

use super::super::collect::Material;
use super::super::estimate::NotEstimated;
use super::super::heads::heads;
use super::stand::{HEADS, Stand, Wrong, profiles};
use headrace_geometry::math::{self, PI, TAU};
use headrace_geometry::tunnel::shapes;
use headrace_monitor::messages::Event;
use headrace_sensor::reading::{Reading, SonarReturn};

fn why(stand: &Stand) -> NotEstimated {
    stand.ask(|material| heads(material).unwrap_err())
}

#[test]
fn mount_angle_is_not_estimated_in_a_circular_tunnel() {
    let wrong = [Wrong { angle_deg: 5.0, ..Wrong::default() }; 2];
    let stand = Stand { at: [0.05, 3.0], ..Stand::new(shapes::circle(3.0).unwrap(), &wrong, 1) };
    let found = stand.ask(|material| heads(material).unwrap());
    for head in &found.heads {
        assert!(matches!(head.angle_rad, Err(NotEstimated::Round { .. })), "{head:?}");
        assert_eq!(head.found.rotation, head.filed.rotation, "a value that isn't estimated stays the file's");
    }
}

#[test]
fn calibration_refuses_a_moving_vehicle() {
    for (_, profile) in profiles() {
        let stand = Stand { speed_mps: 0.1, ..Stand::new(profile, &[Wrong::default(); 2], 1) };
        let why = why(&stand);
        assert!(matches!(why, NotEstimated::Moved { what: "the cable length", unit: "m", .. }), "{why}");
        assert!(why.to_string().starts_with("the vehicle moved: the cable length varied by 1."), "{why}");
    }
}

/// A fit to half a turn has small standard deviations. But an error that all ranges share looks like an error of the
/// angle.
#[test]
fn calibration_from_part_of_a_turn_is_refused_and_states_the_missing_seconds() {
    for (sector_deg, swept_deg, missing_s) in [(95.0, 95, 34), (175.0, 174, 13), (350.0, 349, 1)] {
        for (name, profile) in profiles() {
            let why = why(&Stand { sector_deg, ..Stand::new(profile, &[Wrong::default(); 2], 1) });
            let words = format!(
                "no full turn: the head turned by only {swept_deg} degrees while the vehicle was stationary; 360 are \
                 needed, so that it sees opposite walls; stand still {missing_s} s longer"
            );
            assert_eq!(why.to_string(), words, "{name}");
        }
    }
}

/// The hull hides one side from the first head, so it has no returns from opposite walls. The other head is calibrated.
#[test]
fn head_that_sees_one_side_only_is_refused() {
    let stand = Stand::new(shapes::ceran().unwrap(), &[Wrong::default(); 2], 1);
    stand.ask(|material| {
        let hide = |event: &Event| match event.reading {
            Reading::Sonar(sonar)
                if event.source.index() == HEADS && math::wrap(sonar.angle_rad, TAU) > PI =>
            {
                Event { reading: Reading::Sonar(SonarReturn { range_m: None, ..sonar }), ..*event }
            }
            _ => *event,
        };
        let events: Vec<Event> = material.events.iter().map(hide).collect();
        let found = heads(&Material { events: &events, ..*material }).unwrap();
        let [hidden, free] = [0, 1].map(|number| found.heads[number].angle_rad);
        assert!(
            matches!(hidden, Err(NotEstimated::LittleWall { opposite_deg, .. }) if opposite_deg < 7.0),
            "{hidden:?}"
        );
        assert!(free.is_ok(), "{free:?}");
    });
}

/// Cross-section and returns are symmetric. The two sides can't be distinguished without echosounders, or if the
/// vehicle is in the centre.
#[test]
fn sense_of_rotation_in_a_symmetric_section_needs_echosounders_and_a_vehicle_off_the_centre() {
    let wrong = [Wrong::default(); 2];
    for (at, has_echoes, is_accepted) in
        [([0.6, 2.3], true, true), ([0.6, 2.3], false, false), ([0.0, 2.3], true, false)]
    {
        for (name, profile) in profiles() {
            let stand = Stand::new(profile, &wrong, 4);
            // There is one head only. With two heads side by side, no echosounders would be needed.
            let stand = Stand { at, has_echoes, wrong: vec![Wrong::default()], ..stand };
            let found = stand.ask(|material| heads(material).unwrap());
            let of = found.heads[0].is_mirrored;
            assert_eq!(of.is_ok(), is_accepted, "{name}, {at:?}, {has_echoes}: {of:?}");
            assert!(!of.unwrap_or(false));
            assert!(matches!(found.heads[0].left_m, Err(NotEstimated::OneHead)));
        }
    }
}

#[test]
fn wall_of_another_shape_contradicts_the_profile() {
    let stand = Stand::new(shapes::rectangle(6.0, 5.0).unwrap(), &[Wrong::default(); 2], 1);
    let other = shapes::circle(3.6).unwrap();
    let why = stand.ask(|material| heads(&Material { profile: &other, ..*material }).unwrap_err());
    assert!(matches!(why, NotEstimated::Contradicted { median_m, .. } if median_m > 0.15), "{why}");
}

#[test]
fn calibration_refusal_names_the_missing_readings() {
    let stand = Stand::new(shapes::ceran().unwrap(), &[], 1);
    assert_eq!(why(&stand), NotEstimated::Missing { what: "any profiling head" });
    let nothing = Stand { seconds: 0, ..stand };
    assert_eq!(why(&nothing), NotEstimated::Missing { what: "any sensor" });
}
