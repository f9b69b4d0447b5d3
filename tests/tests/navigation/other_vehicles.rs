//! A vehicle with a velocity log and an autopilot. The autopilot has the inertial unit, the pressure sensor and the
//! distance sensors.
//!
//! The tests use the crates of these devices unchanged, and cover all steps from the simulator's bytes to the
//! navigation.

use headrace_tests::Folder;
use serde_json::Value;

const SCENE: &str = r#"vehicle = "vehicle.toml"
[trajectory]
start_m = 3
[[trajectory.legs]]
distance_m = 8
speed_mps = 0.2
"#;

fn source<'a>(report: &'a Value, id: &str) -> &'a Value {
    report["sources"].as_array().unwrap().iter().find(|source| source["id"] == id).unwrap()
}

#[test]
fn autopilot_sensors_and_a_velocity_log_are_fused() {
    let folder = Folder::new();
    folder.write("vehicle.toml", headrace_tests::other_vehicle());
    folder.write("scene.toml", SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    let (code, report) = folder.replay("dive.mcap", &[]);
    assert_eq!(code, Some(0), "{}", report["log"]["losses"]);
    // Expected numbers of readings in 40 s, from the rates in the sensors' tables.
    for (id, readings) in [
        ("imu", 12_000),
        ("depth", 400),
        ("left", 400),
        ("right", 400),
        ("up", 400),
        ("down", 400),
        ("dvl", 320),
    ] {
        let source = source(&report, id);
        let got = source["readings"].as_i64().unwrap();
        assert!((got - readings).abs() <= readings / 100 + 3, "{id}: {source}");
        for nothing in ["bad_frames", "skipped_bytes", "withheld"] {
            assert_eq!(source[nothing], 0, "{id}: {source}");
        }
    }
    // Devices without noise agree if axes, lever arm and delay are right. If one axis were reversed, the NIS
    // (normalised innovation squared) would be 0.08.
    let dvl = &source(&report, "dvl")["navigation"];
    println!("velocity log: {dvl}");
    assert_eq!(dvl["gated"], 0, "{dvl}");
    // The first reading arrives 100 ms after its ping. The ping may therefore be earlier than the filter's start, and
    // the reading then counts as late. There are two readings a second, with three components each.
    assert!(dvl["late"].as_u64().unwrap() <= 1 && dvl["used"].as_u64().unwrap() > 220, "{dvl}");
    assert!(dvl["nis"].as_f64().unwrap() < 0.001, "{dvl}");
    let dive = &report["dive"];
    assert!(dive["samples_valid"].as_u64().unwrap() > 1000, "{dive}");
    assert!((dive["to_m"].as_f64().unwrap() - 11.0).abs() < 0.05, "{dive}");
}
