//! The trade Survey shows what `headrace plan` says.

use headrace::devices::KINDS;
use headrace_cost::effort::Effort;
use headrace_cost::point::Point;
use headrace_cost::scene::{Inputs, file};
use headrace_cost::trades::survey;
use headrace_tests::{program, root};
use serde_json::Value;

/// What `plan` says of a point: speed and hours of its mode.
fn planned(point: &Point) -> [f64; 2] {
    let vehicle = root().join("deploy/vehicles/vita1.toml");
    let mut command = program();
    command
        .args(["plan", "--json", "--target", &point.number.unwrap().to_string(), "--vehicle"])
        .arg(vehicle);
    let (layout, drift) = point.method.split_once(", ").unwrap_or_default();
    if let Some(drift_m) = drift.strip_suffix(" m off") {
        command.args(["--layout", &layout.replace(' ', "_"), "--drift", drift_m]);
    }
    let output = command.output().unwrap();
    let plan: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|why| panic!("{why}: {}", String::from_utf8_lossy(&output.stderr)));
    // Of a scene of modes the method is one; in others the value names the fastest.
    let mode = point.value.split_once(", ").map_or(point.method.as_str(), |(_, mode)| mode);
    let answer = plan["modes"].as_array().unwrap().iter().find(|answer| answer["mode"] == mode).unwrap();
    ["v_max_mps", "needed_h"].map(|key| answer[key].as_f64().unwrap())
}

#[test]
fn survey_shows_what_plan_says_to_the_bit() {
    let text = file("vita1.toml").unwrap();
    let inputs = Inputs { effort: Effort::Quick, kinds: &KINDS, vehicle: Some(("VITA 1", text)) };
    let trade = survey::measure(&inputs, &mut |_| {}).unwrap();
    let scenes = trade.scenes();
    assert_eq!(scenes.len(), 3);
    for scene in scenes {
        let points = trade.points.iter().filter(|point| point.scene == scene).count();
        assert!(points >= 3, "{points} points of {scene:?}");
    }
    for point in &trade.points {
        let figure =
            |name: &str| point.errors.iter().find(|error| error.name == name).unwrap().interval.middle;
        let found = [figure("speed"), figure("there")];
        assert_eq!(found.map(f64::to_bits), planned(point).map(f64::to_bits), "{point:?}");
        let hours = figure("there") + figure("back") + figure("again");
        assert!((point.cost.middle - hours).abs() < 1e-9, "{point:?}");
        // Promised and kept.
        let hole_m = point.errors.iter().find(|error| error.name.starts_with("largest D_true"));
        if let Some(hole_m) = hole_m.filter(|_| !point.method.contains(" m off")) {
            assert!(hole_m.interval.middle <= point.error(), "{point:?}");
        }
    }
    assert!(trade.oracle.size < 1e-3 * 0.4, "{}", trade.oracle.size);
}
