//! A replay is held against what the live dive published: the same, or named where it first parts.

use headrace_tests::{Folder, VEHICLE};
use serde_json::Value;

/// A dive that was recorded live.
fn recorded() -> Folder {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    folder
}

fn verified(folder: &Folder, further: &[&str]) -> (Option<i32>, Value) {
    let answer = folder.headrace(&[&["verify", "--json"], further].concat());
    (
        answer.code,
        serde_json::from_str(&answer.stdout).unwrap_or_else(|error| panic!("{error}: {}", answer.stderr)),
    )
}

#[test]
fn the_same_program_gives_the_same_dive_at_any_tick() {
    let folder = recorded();
    for tick in ["1", "20", "5000"] {
        let (code, told) = verified(&folder, &["live.mcap", "--tick-ms", tick]);
        assert_eq!(code, Some(0), "{told}");
        assert!(told["same_records"].as_u64().unwrap() > 1000, "{told}");
        assert_eq!(
            (&told["unrecorded_records"], &told["differences"]),
            (&0.into(), &Value::Array(Vec::new()))
        );
    }
}

#[test]
fn another_mount_by_a_hair_is_found_with_tick_sensor_field_and_bits() {
    let folder = recorded();
    // Two ulps of a metre and a bit, where the sensor's id says which.
    let other = VEHICLE.replacen("mode = \"fastest\"", "mode = \"fastest\"\nangles_deg = [0, 0, 1e-13]", 1);
    folder.write("other.toml", other);
    let (code, told) = verified(&folder, &["live.mcap", "--vehicle", "other.toml"]);
    assert_eq!(code, Some(4), "{told}");
    let first = &told["differences"][0];
    assert_eq!((&first["stream"], &first["source"]), (&"pings".into(), &"sonar_0".into()), "{first}");
    let bits = |key: &str| u64::from_str_radix(first[key].as_str().unwrap(), 16).unwrap();
    let (live, replayed) = (bits("live_bits"), bits("replayed_bits"));
    assert!(live != replayed && (f64::from_bits(live) - f64::from_bits(replayed)).abs() < 1e-9, "{first}");
    assert!(["x_m", "y_m", "z_m", "arc_m"].contains(&first["field"].as_str().unwrap()), "{first}");
    assert!(first["tick"].as_u64().unwrap() > 0);
}

#[test]
fn a_log_that_was_cut_off_is_verified_as_far_as_it_goes() {
    let folder = recorded();
    let whole = folder.read("live.mcap");
    folder.write("cut.mcap", &whole[..whole.len() / 2]);
    let (code, told) = verified(&folder, &["cut.mcap"]);
    assert_eq!(code, Some(3), "{told}");
    assert!(told["same_records"].as_u64().unwrap() > 100 && told["differences"][0].is_null(), "{told}");
}

#[test]
fn a_log_without_results_has_nothing_to_be_verified_by() {
    let folder = Folder::with_dive();
    let answer = folder.headrace(&["verify", "dive.mcap"]);
    assert_eq!(answer.code, Some(1));
    assert!(answer.stdout.contains("nothing to compare"), "{}", answer.stdout);
}
