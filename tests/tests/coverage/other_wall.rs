//! Wall that differs from the vehicle file: a wider stretch, and a side tunnel that the file doesn't declare.

use headrace_tests::{Folder, VEHICLE};
use serde_json::Value;

/// A steady dive through a tunnel with the wall that `tunnel` describes.
fn scene(tunnel: &str, [start_m, distance_m]: [f64; 2], effects: &str) -> String {
    format!(
        "name = \"other wall\"\nvehicle = \"vehicle.toml\"\n{tunnel}\n[trajectory]\nstart_m = {start_m}\n\
         [[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = 0.1\n[effects]\nmotion_within_turn = {{}}\n{effects}"
    )
}

/// Simulates and replays a dive; returns its report and summary.
fn dive(vehicle: &str, scene: &str) -> (Value, String) {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle);
    folder.write("scene.toml", scene);
    folder.simulate("scene.toml", "dive.mcap");
    let answer = folder.headrace(&["replay", "dive.mcap", "--report", "r.json", "-q"]);
    (serde_json::from_slice(&folder.read("r.json")).unwrap(), answer.stdout)
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} of {value}"))
}

/// The sections between two chainages, m.
fn sections(report: &Value, from_m: f64, to_m: f64) -> Vec<&Value> {
    let all = report["sections"].as_array().unwrap().iter();
    all.filter(|section| (from_m..to_m).contains(&number(section, "start_m"))).collect()
}

/// From chainage 11 to 20 m, the radius is 23 % larger than designed. The wall is on average 0.66 m outside the design.
/// The navigation filter mistakes a part of this deviation for a change of the vehicle's height.
fn wider_wall() -> String {
    let stations = [(0, 1.0), (9, 1.0), (11, 1.23), (20, 1.23), (22, 1.0)];
    let station =
        |(chainage_m, scale)| format!("[[tunnel.stations]]\nchainage_m = {chainage_m}\nscale = {scale}\n");
    scene(&stations.map(station).concat(), [5.0, 20.0], "")
}

#[test]
fn wall_wider_than_the_design_passes_and_is_reported_if_two_heads_see_it() {
    let (report, summary) = dive(VEHICLE, &wider_wall());
    let within = sections(&report, 13.0, 18.0);
    assert!(within.iter().all(|section| section["verdict"] == "pass"), "{within:#?}");
    assert!(within.iter().all(|section| section["deviation"]["contradicts"] == false));
    assert!(
        !report["alert_list"].as_array().unwrap().iter().any(|alert| alert["kind"] == "profile_contradicted")
    );
    let stretches = report["wall_stretches"].as_array().unwrap();
    assert_eq!(stretches.len(), 1, "{stretches:?}");
    let [from_m, to_m, mean_m, outmost_m] =
        ["from_m", "to_m", "mean_m", "outmost_m"].map(|key| number(&stretches[0], key));
    assert!((9.0..11.0).contains(&from_m) && (20.0..22.0).contains(&to_m), "{stretches:?}");
    assert!((0.5..0.75).contains(&mean_m) && (1.0..1.5).contains(&outmost_m), "{stretches:?}");
    let line = format!("WALL: {mean_m:.2} m outside the design, up to {outmost_m:.2} m");
    assert!(summary.contains(&line), "{line}\n{summary}");
}

/// A side tunnel of 4 by 4 m with its axis at 12 m, on the left.
const SIDE_TUNNEL: &str = "[[tunnel.features]]\nkind = \"side_tunnel\"\nchainage_m = 12\nside = \"left\"\nwidth_m = 4\n\
                           height_m = 4\nlength_m = 12\n";

/// The shipped vehicle with four heads, with a target well above the holes that it leaves.
fn in_ceran() -> String {
    let text = include_str!("../../../deploy/vehicles/vita2-4.toml");
    text.replace("target_m = 0.5", "target_m = 0.6")
}

/// The lines which, according to a summary, can be appended to the vehicle file.
fn declaration(summary: &str) -> String {
    let lines = summary.lines().skip_while(|line| !line.contains("append to the vehicle file"));
    lines.skip(1).take_while(|line| line.starts_with("    ")).collect::<Vec<_>>().join("\n")
}

#[test]
fn suggested_declaration_of_a_side_tunnel_clears_its_missed_stretch() {
    let scene = scene(SIDE_TUNNEL, [4.0, 16.0], "");
    let vehicle = in_ceran();
    let (report, summary) = dive(&vehicle, &scene);
    let suggested = report["suggested_openings"].as_array().unwrap();
    assert_eq!(suggested.len(), 1, "{summary}");
    // Beams that enter the side tunnel obliquely return from its own walls. The patch without returns is therefore
    // smaller than the mouth of the side tunnel. The mouth extends from 10 to 14 m, and 2 m up and down from the side
    // tunnel's axis.
    let [from_m, to_m, clock_from, clock_to] =
        ["from_m", "to_m", "clock_from", "clock_to"].map(|key| number(&suggested[0], key));
    assert!(9.5 < from_m && from_m < 11.0 && 13.0 < to_m && to_m < 14.5, "{suggested:?}");
    assert!(7.5 < clock_from && clock_from < 9.0 && 9.0 < clock_to && clock_to < 10.5, "{suggested:?}");
    assert!(number(&report["summary"], "fail_m") > 2.0, "{summary}");
    assert!(summary.contains("raise the gain, or declare an opening"), "{summary}");
    let (declared, then) = dive(&format!("{vehicle}{}", declaration(&summary)), &scene);
    assert!(number(&declared["summary"], "fail_m") <= 0.0, "{then}");
    assert_eq!(declared["openings"].as_array().unwrap().len(), 1);
    assert!(declared["suggested_openings"].as_array().unwrap().is_empty());
}

/// If returns are lost all over the wall, or on a long stretch of one side, no opening is suggested.
#[test]
fn returns_lost_all_over_the_wall_suggest_no_opening() {
    let heads = "sensors = [\"sonar_0\", \"sonar_1\", \"sonar_2\", \"sonar_3\"]\n";
    let lost = format!("[effects.missing_returns]\nshare = 0.8\nmean_run = 20\n{heads}");
    let (report, summary) = dive(&in_ceran(), &scene("", [4.0, 8.0], &lost));
    assert!(number(&report["summary"], "fail_m") > 1.0, "{summary}");
    assert!(report["suggested_openings"].as_array().unwrap().is_empty(), "{summary}");
    assert!(!summary.contains("[[openings]]"), "{summary}");
}
