//! Checks the prices in `docs/why/cost` against `headrace plan`.

use headrace_tests::{program, root};
use serde_json::Value;

/// Vehicles on the page `docs/why/cost`, with their vehicle files.
const VEHICLES: [(&str, &str); 4] = [
    ("VITA 1, one head", "vita1.toml"),
    ("VITA 2, two heads", "vita2-2.toml"),
    ("VITA 2, three heads", "vita2-3.toml"),
    ("VITA 2, four heads", "vita2-4.toml"),
];

/// Planned speed and duration in hours that `headrace plan` prints for a mode of a vehicle.
fn planned(file: &str, target_m: &Value, mode: &str) -> [f64; 2] {
    let vehicle = root().join("deploy/vehicles").join(file);
    let mut command = program();
    command.args(["plan", "--json", "--target", &target_m.to_string(), "--vehicle"]).arg(vehicle);
    let output = command.output().unwrap();
    let plan: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|why| panic!("{why}: {}", String::from_utf8_lossy(&output.stderr)));
    let answer = plan["modes"].as_array().unwrap().iter().find(|answer| answer["mode"] == mode).unwrap();
    ["v_max_mps", "needed_h"].map(|key| answer[key].as_f64().unwrap())
}

#[test]
fn cost_page_matches_plan_to_the_bit() {
    let results: Value =
        serde_json::from_str(&std::fs::read_to_string(root().join("docs/why/cost/cost.json")).unwrap())
            .unwrap();
    let trade = results["trades"].as_array().unwrap().iter().find(|trade| trade["name"] == "survey").unwrap();
    let mut compared = 0;
    for point in trade["points"].as_array().unwrap() {
        let method = point["method"].as_str().unwrap();
        let Some((_, file)) = VEHICLES.iter().find(|(name, _)| *name == method) else { continue };
        let (_, mode) = point["value"].as_str().unwrap().split_once(", ").unwrap();
        let figure = |name: &str| {
            let error = point["errors"].as_array().unwrap().iter().find(|error| error["name"] == name);
            error.unwrap()["interval"]["middle"].as_f64().unwrap()
        };
        let shown = [figure("speed"), figure("there")];
        assert_eq!(
            shown.map(f64::to_bits),
            planned(file, &point["number"], mode).map(f64::to_bits),
            "{point}"
        );
        compared += 1;
    }
    assert!(compared >= 12, "{compared} points");
}
