//! Tests that simulated dives keep the plans of the trade Survey.
//!
//! `tests/tests/sampling/survey.rs` tests that the plans agree with `headrace plan`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

use headrace_cost::effort::Effort;
use headrace_cost::scene::{Inputs, file};
use headrace_cost::trades::survey;
use headrace_devices::KINDS;

#[test]
fn true_holes_of_a_survey_stay_within_the_planned_target() {
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
        let hours = figure("there") + figure("back") + figure("again");
        assert!((point.cost.middle - hours).abs() < 1e-9, "{point:?}");
        // The simulated dive's largest hole is at most the planned spacing T.
        let hole_m = point.errors.iter().find(|error| error.name.starts_with("largest D_true"));
        if let Some(hole_m) = hole_m.filter(|_| !point.method.contains(" m off")) {
            assert!(hole_m.interval.middle <= point.error(), "{point:?}");
        }
    }
    assert!(trade.oracle.size < 1e-3 * 0.4, "{}", trade.oracle.size);
}
