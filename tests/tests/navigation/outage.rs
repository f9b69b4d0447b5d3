//! Sensors that fall silent in the middle of a dive: what can't be placed is said so, nothing is flagged that going on
//! forward fills, and the dive goes on once they are back.

use headrace_tests::{Folder, raw_messages, write_log};
use mcap::WriteOptions;
use serde_json::Value;

const LEG: &str = "vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 2\n[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.197\n";

/// Replays a four-head dive of 12 m without what `source` sent between two moments, in seconds of its clock.
fn without(way: &str, source: &str, from_s: f64, to_s: f64) -> Value {
    let folder = Folder::new();
    // The heads' bodies aren't simulated: nothing is hidden, and the paper's speed meets the target.
    let vehicle = include_str!("../../../deploy/vehicles/vita2-4.toml")
        .replace("planned_speed_mps = 0.10", "planned_speed_mps = 0.197")
        .replace("[navigation]", &format!("[navigation]\nway = \"{way}\""));
    assert!(vehicle.contains(&format!("way = \"{way}\"")));
    folder.write("vehicle.toml", &vehicle);
    folder.write("scene.toml", LEG);
    folder.simulate("scene.toml", "whole.mcap");
    let whole = folder.read("whole.mcap");
    let topic = format!("/raw/{source}");
    let kept: Vec<_> = raw_messages(&whole)
        .into_iter()
        .filter(|message| {
            let at_s = message.log_time as f64 / 1e9;
            message.channel.topic != topic || !(from_s..to_s).contains(&at_s)
        })
        .collect();
    write_log(&folder.path("cut.mcap"), WriteOptions::new(), Some(&vehicle), &kept);
    folder.replay("cut.mcap", &[]).1
}

fn failed(report: &Value) -> Vec<&Value> {
    let sections = report["sections"].as_array().unwrap();
    let inner = |section: &&Value| (4.0..11.5).contains(&section["start_m"].as_f64().unwrap());
    sections.iter().filter(inner).filter(|section| section["verdict"] == "fail").collect()
}

#[test]
fn without_a_filter_a_lost_tether_is_named_as_lost_position_and_its_return_raises_no_false_flag() {
    let report = without("direct", "tether", 25.0, 31.0);
    assert!(report["dive"]["samples_rejected"]["no_fix"].as_u64().unwrap() > 500);
    let failed = failed(&report);
    assert!(!failed.is_empty(), "0.8 m of wall without a sample");
    let named = failed.iter().filter(|section| section["cause"]["cause"] == "position_lost").count();
    assert!(2 * named > failed.len(), "{named} of {}: {failed:#?}", failed.len());
    // The vehicle never turned back, so that no flag may have been cleared.
    assert_eq!(report["summary"]["flags_cleared"], 0, "{}", report["summary"]);
}

#[test]
fn a_short_silence_of_the_tether_is_bridged() {
    for (way, until_s) in [("direct", 26.5), ("filter", 31.0)] {
        let report = without(way, "tether", 25.0, until_s);
        assert_eq!(failed(&report).len(), 0, "{way}");
    }
}

#[test]
fn three_of_four_echosounders_are_enough() {
    for way in ["direct", "filter"] {
        let report = without(way, "ping_left", 25.0, 60.0);
        assert_eq!(failed(&report).len(), 0, "{way}");
    }
}
