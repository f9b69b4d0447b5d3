//! Sensors that fall silent during a dive.
//!
//! Pings without a position are reported. No flag is raised for a hole that is filled when the vehicle drives on. When
//! the sensors send data again, the dive goes on.

use headrace_tests::{Folder, raw_messages, write_log};
use mcap::WriteOptions;
use serde_json::Value;

const LEG: &str = "vehicle = \"vehicle.toml\"\n[trajectory]\nstart_m = 2\n[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.197\n";

/// Replays a dive of 12 m with four heads, without the data that `source` sends between two times. The times are
/// seconds on the clock of the source. An empty `source` stands for all sources.
fn without(way: &str, source: &str, from_s: f64, to_s: f64) -> Value {
    let folder = Folder::new();
    // The simulated heads have no bodies that could hide the wall. At the speed by the formula of Jorge et al., the
    // holes therefore meet the target.
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
            !message.channel.topic.starts_with(&topic) || !(from_s..to_s).contains(&at_s)
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
fn silent_tether_in_direct_navigation_fails_sections_as_position_lost() {
    let report = without("direct", "tether", 25.0, 31.0);
    assert!(report["dive"]["samples_rejected"]["no_fix"].as_u64().unwrap() > 500);
    let failed = failed(&report);
    assert!(!failed.is_empty(), "0.8 m of wall without a sample");
    let named = failed.iter().filter(|section| section["cause"]["cause"] == "position_lost").count();
    assert!(2 * named > failed.len(), "{named} of {}: {failed:#?}", failed.len());
    // No flag may have been cleared, because the vehicle never turned back.
    assert_eq!(report["summary"]["flags_cleared"], 0, "{}", report["summary"]);
}

#[test]
fn short_tether_silence_is_bridged() {
    for (way, until_s) in [("direct", 26.5), ("filter", 31.0)] {
        let report = without(way, "tether", 25.0, until_s);
        assert_eq!(failed(&report).len(), 0, "{way}");
    }
}

/// The dive is interrupted for half a minute, in which the vehicle drives on. The wall that no head has sampled must
/// not pass. The stretch before the interruption is judged as usual.
#[test]
fn wall_unseen_during_an_interruption_does_not_pass() {
    for way in ["direct", "filter"] {
        let report = without(way, "", 20.0, 50.0);
        let sections = report["sections"].as_array().unwrap();
        let start_m = |section: &Value| section["start_m"].as_f64().unwrap();
        // During the interruption, the vehicle drives at 0.197 m/s from 5.9 to 11.9 m. The heads see 0.5 m ahead and
        // behind.
        let unseen = sections.iter().filter(|section| (6.6..11.0).contains(&start_m(section)));
        let passed: Vec<_> = unseen.filter(|section| section["verdict"] == "pass").map(start_m).collect();
        assert_eq!(passed, Vec::<f64>::new(), "{way}");
        let before = sections.iter().filter(|section| section["verdict"] == "pass" && start_m(section) < 5.0);
        let before: Vec<f64> = before.map(start_m).collect();
        assert!(before.len() > 1, "{way}: {before:?}");
    }
}

#[test]
fn three_of_four_echosounders_keep_the_position() {
    for way in ["direct", "filter"] {
        let report = without(way, "ping_left", 25.0, 60.0);
        assert_eq!(failed(&report).len(), 0, "{way}");
    }
}
