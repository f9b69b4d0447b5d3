//! Impossible walls: samples outside the tunnel, and a profile that contradicts the returns. Both must be reported once
//! and counted, and neither may make a section pass.

use headrace_tests::{Folder, SCENE, VEHICLE};
use serde_json::Value;

/// Simulates and replays a dive with the files `vehicle` and `scene`. Returns its report and terminal output.
fn dive(vehicle: &str, scene: &str) -> (Value, String) {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle);
    folder.write("scene.toml", scene);
    folder.simulate("scene.toml", "dive.mcap");
    let answer = folder.headrace(&["replay", "dive.mcap", "--report", "r.json"]);
    (serde_json::from_slice(&folder.read("r.json")).unwrap(), answer.stdout)
}

fn metres(report: &Value, verdict: &str) -> f64 {
    report["summary"][format!("{verdict}_m")].as_f64().unwrap()
}

/// Alerts about observations, such as an impossible wall, that the report lists with their number of occurrences.
fn observed(report: &Value) -> Vec<&Value> {
    let alerts = report["alert_list"].as_array().unwrap().iter();
    alerts.filter(|alert| !alert["occurrences"].is_null()).collect()
}

#[test]
fn wall_with_a_contradicted_profile_never_passes_and_is_reported_once() {
    let vehicle = VEHICLE.replace("[water]", "[navigation]\nway = \"direct\"\n\n[water]");
    let as_built = "\n[tunnel.as_built]\nprofile = \"rectangle\"\nwidth_m = 7.6\nheight_m = 7.6\n";
    let (right, _) = dive(&vehicle, SCENE);
    let (wrong, said) = dive(&vehicle, &format!("{SCENE}{as_built}"));
    assert!(metres(&right, "pass") > 2.0 && observed(&right).is_empty());
    assert!(metres(&wrong, "pass") <= 0.0, "{}", wrong["summary"]);
    let alerts = observed(&wrong);
    assert_eq!(alerts.len(), 1, "{alerts:?}");
    assert_eq!(alerts[0]["kind"], "profile_contradicted");
    assert!(alerts[0]["occurrences"].as_u64().unwrap() > 5 && alerts[0]["worst_m"].as_f64().unwrap() > 0.5);
    assert_eq!(said.matches("ALERT").count(), 1, "{said}");
}

#[test]
fn samples_behind_the_portal_are_reported_once_with_distance() {
    let scene = SCENE.replace("start_m = 3", "start_m = 0.6");
    let vehicle = VEHICLE.replace(
        "id = \"sonar_1\"\nplugin = \"imagenex881\"\n",
        "id = \"sonar_1\"\nplugin = \"imagenex881\"\nposition_m = [-2.4, 0, 0]\n",
    );
    let (report, said) = dive(&vehicle, &scene);
    let alerts = observed(&report);
    assert_eq!((alerts.len(), &alerts[0]["kind"]), (1, &Value::from("outside_tunnel")));
    assert!((1.3..2.0).contains(&alerts[0]["worst_m"].as_f64().unwrap()), "{alerts:?}");
    assert_eq!(said.matches("outside the tunnel").count(), 1, "{said}");
    assert!(report["sections"].as_array().unwrap().iter().all(|s| s["start_m"].as_f64().unwrap() >= 0.0));
}

#[test]
fn declared_opening_is_listed_and_does_not_fail() {
    let (scene, vehicle) = (
        format!("{SCENE}\n[effects.missing_returns]\nshare = 0.0001\n"),
        format!(
            "{VEHICLE}\n[[openings]]\nname = \"adit\"\nfrom_m = 4.2\nto_m = 5.4\nclock_from = 8\nclock_to = 10\n"
        ),
    );
    let (report, _) = dive(&vehicle, &scene);
    assert_eq!(report["openings"][0]["name"], "adit");
    let masked: Vec<f64> = report["sections"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|section| section["masked_share"].as_f64().unwrap() > 0.0)
        .map(|section| section["start_m"].as_f64().unwrap())
        .collect();
    assert_eq!(masked, [4.0, 4.25, 4.5, 4.75, 5.0, 5.25]);
    // The opening covers two of the twelve clock positions, and chainages from 4.2 to 5.4 m. It therefore covers a
    // fifth of the length of the first section, and three fifths of the last section.
    let share = |start_m: f64| {
        let section =
            report["sections"].as_array().unwrap().iter().find(|s| s["start_m"] == start_m).unwrap();
        section["masked_share"].as_f64().unwrap()
    };
    for (start_m, whole) in [(4.0, 0.2), (4.25, 1.0), (5.0, 1.0), (5.25, 0.6)] {
        assert!((share(start_m) - whole / 6.0).abs() < 1e-9, "{start_m}: {}", share(start_m));
    }
    let all_round = vehicle.replace("clock_from = 8\nclock_to = 10\n", "");
    let (report, _) = dive(&all_round, &scene);
    let sections = report["sections"].as_array().unwrap();
    let of = |start_m: f64| sections.iter().find(|s| s["start_m"] == start_m).unwrap();
    assert_eq!(of(4.5)["verdict"], "cannot_say", "there is no wall to pass");
}

#[test]
fn replay_with_several_targets_gives_the_verdicts_of_single_replays() {
    let folder = Folder::with_dive();
    let (_, together) = folder.replay("dive.mcap", &["--target", "0.5,1.2,2", "--section", "0.25,1"]);
    let others = together["other_targets"].as_array().unwrap();
    assert_eq!(others.len(), 6);
    for other in others {
        let of = |key: &str| other[key].as_f64().unwrap();
        let (target, section) = (of("target_m").to_string(), of("section_m").to_string());
        let (_, alone) = folder.replay("dive.mcap", &["--target", &target, "--section", &section]);
        assert!(alone["other_targets"].as_array().unwrap().is_empty());
        for verdict in ["pass", "fail", "cannot_say", "open"] {
            let (a, b) = (of(&format!("{verdict}_m")), metres(&alone, verdict));
            assert!((a - b).abs() <= 1e-9, "target {target}, sections {section}: {verdict} {a}, alone {b}");
        }
    }
}

#[test]
fn wrong_speed_of_sound_shifts_the_wall() {
    let folder = Folder::with_dive();
    let mean = |report: &Value| report["sections"][8]["deviation"]["mean_m"].as_f64().unwrap();
    let (_, as_told) = folder.replay("dive.mcap", &[]);
    let (_, faster) = folder.replay("dive.mcap", &["--sound-speed", "1500"]);
    assert!(mean(&as_told).abs() < 0.02, "{}", mean(&as_told));
    // The wall is expected to shift by 3.7 % of the 3 m radius.
    assert!((0.06..0.15).contains(&mean(&faster)), "{}", mean(&faster));
}
