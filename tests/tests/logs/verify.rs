//! `verify` compares a replay with the results of the live dive and reports the first difference.

use headrace_tests::{Folder, VEHICLE};
use serde_json::Value;

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
fn verify_passes_at_any_tick_length() {
    let folder = recorded();
    for tick in ["1", "20", "5000"] {
        let (code, report) = verified(&folder, &["live.mcap", "--tick-ms", tick]);
        assert_eq!(code, Some(0), "{report}");
        assert!(report["same_records"].as_u64().unwrap() > 1000, "{report}");
        assert_eq!(
            (&report["unrecorded_records"], &report["differences"]),
            (&0.into(), &Value::Array(Vec::new()))
        );
    }
}

#[test]
fn verify_reports_a_tiny_mount_change_with_tick_sensor_field_and_bits() {
    let folder = recorded();
    // Turning the mount by 1e-13 degrees moves a sample's position by about two units in the last place. `verify` names
    // the sensor.
    let other = VEHICLE.replacen("mode = \"fastest\"", "mode = \"fastest\"\nangles_deg = [0, 0, 1e-13]", 1);
    folder.write("other.toml", other);
    let (code, report) = verified(&folder, &["live.mcap", "--vehicle", "other.toml"]);
    assert_eq!(code, Some(4), "{report}");
    let first = &report["differences"][0];
    assert_eq!((&first["stream"], &first["source"]), (&"pings".into(), &"sonar_0".into()), "{first}");
    let bits = |key: &str| u64::from_str_radix(first[key].as_str().unwrap(), 16).unwrap();
    let (live, replayed) = (bits("live_bits"), bits("replayed_bits"));
    assert!(live != replayed && (f64::from_bits(live) - f64::from_bits(replayed)).abs() < 1e-9, "{first}");
    assert!(["x_m", "y_m", "z_m", "arc_m"].contains(&first["field"].as_str().unwrap()), "{first}");
    assert!(first["tick"].as_u64().unwrap() > 0);
}

#[test]
fn truncated_log_is_verified_up_to_its_end() {
    let folder = recorded();
    let whole = folder.read("live.mcap");
    folder.write("cut.mcap", &whole[..whole.len() / 2]);
    let (code, report) = verified(&folder, &["cut.mcap"]);
    assert_eq!(code, Some(3), "{report}");
    assert!(report["same_records"].as_u64().unwrap() > 100 && report["differences"][0].is_null(), "{report}");
}

#[test]
fn log_without_results_cannot_be_verified() {
    let folder = Folder::with_dive();
    let answer = folder.headrace(&["verify", "dive.mcap"]);
    assert_eq!(answer.code, Some(1));
    assert!(answer.stdout.contains("nothing to compare"), "{}", answer.stdout);
}
