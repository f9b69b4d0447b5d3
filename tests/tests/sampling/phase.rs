//! Heads that are mounted at different places along the hull are in phase at one speed only. At any other speed the
//! advice reports their phase error.

use headrace_tests::Folder;
use serde_json::Value;

/// VITA 2 with two heads in mode FAST (8 s per turn), 1.102 m apart along the hull.
const VEHICLE: &str = include_str!("../../../deploy/vehicles/vita2-2.toml");
const APART_M: f64 = 1.102;
const TURN_S: f64 = 8.0;
const PLANNED_MPS: f64 = 0.197;

/// Advice in a dive at constant speed, without the first seconds.
///
/// No effect disturbs the sensors. The vehicle has no navigation filter, because the filter adds a margin for cable
/// slack.
fn advice(speed_mps: f64, vehicle: &str) -> Vec<Value> {
    let folder = Folder::new();
    let direct = "[navigation]\nway = \"direct\"\n";
    let vehicle = if vehicle.contains("[navigation]") {
        vehicle.replace("[navigation]\n", direct)
    } else {
        vehicle.replace("[water]", &format!("{direct}\n[water]"))
    };
    folder.write("vehicle.toml", vehicle);
    folder.write(
        "scene.toml",
        format!("vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = {speed_mps}\n"),
    );
    folder.simulate("scene.toml", "dive.mcap");
    let (_, report) = folder.replay("dive.mcap", &[]);
    let settled = |entry: &&Value| entry["at_s"].as_f64().unwrap() > 12.0;
    report["advice"].as_array().unwrap().iter().filter(settled).cloned().collect()
}

#[test]
fn phase_error_matches_the_difference_from_the_planned_speed() {
    assert!(VEHICLE.contains("planned_speed_mps = 0.197"));
    for speed_mps in [0.12, PLANNED_MPS, 0.23, 0.35] {
        let advice = advice(speed_mps, VEHICLE);
        assert!(!advice.is_empty());
        let turns = APART_M / TURN_S * (1.0 / PLANNED_MPS - 1.0 / speed_mps);
        for entry in &advice {
            let error_deg = entry["phase_error_deg"].as_f64().unwrap();
            let off = (error_deg / 360.0 - turns + 0.5).rem_euclid(1.0) - 0.5;
            // The tolerance covers the head's steps of 0.9 degrees, and the rounding of start angles to 0.3 degrees.
            assert!(off.abs() * 360.0 < 1.5, "{speed_mps} m/s: {error_deg} degrees, not {}", turns * 360.0);
        }
    }
}

#[test]
fn single_head_and_heads_in_sector_layout_have_no_phase_error() {
    let one = include_str!("../../../deploy/vehicles/vita1.toml");
    let sectors = VEHICLE.replace("layout = \"phase_shift\"", "layout = \"sector_offset\"");
    assert_ne!(sectors, VEHICLE);
    for vehicle in [one, &sectors] {
        assert!(advice(0.2, vehicle).iter().all(|entry| entry["phase_error_deg"].is_null()));
    }
}

#[test]
fn advice_alternatives_list_every_mode_with_the_hours_that_it_needs() {
    let timed = format!("dive_hours = 12\n{VEHICLE}");
    let advice = advice(PLANNED_MPS, &timed);
    let last = advice.last().unwrap();
    let modes = last["alternatives"].as_array().unwrap();
    let names: Vec<_> = modes.iter().map(|mode| mode["mode"].as_str().unwrap()).collect();
    assert_eq!(names, ["slow", "medium", "fast", "faster", "fastest"]);
    let left_m = 7000.0 - last["chainage_m"].as_f64().unwrap();
    for mode in modes {
        let (v_mps, needed_h) = (mode["v_max_mps"].as_f64().unwrap(), mode["needed_h"].as_f64().unwrap());
        assert!((needed_h - left_m / v_mps / 3600.0).abs() < 1e-9);
        assert_eq!(mode["suffices"].as_bool().unwrap(), needed_h < 12.0 - 1e-2, "{mode}");
    }
    let [slow, faster] = [0, 3].map(|k| modes[k]["v_max_mps"].as_f64().unwrap());
    assert!(faster > 2.0 * slow);
}
