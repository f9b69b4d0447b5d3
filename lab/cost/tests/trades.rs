//! Results that the trades of `headrace cost` must give on any machine: planted differences are found, and equal
//! settings give equal results.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

use headrace_cost::effort::Effort;
use headrace_cost::point::{Point, Trade};
use headrace_cost::scene::{Inputs, file};
use headrace_cost::trades::{Measure, live, navigation, simulation, sureness, survey};
use headrace_sampling::layout::HeadLayout;

fn inputs() -> Inputs<'static> {
    Inputs { effort: Effort::Quick, kinds: &headrace_devices::KINDS, vehicle: None }
}

fn measured(measure: Measure) -> Trade {
    measure(&inputs(), &mut |_| {}).unwrap_or_else(|why| panic!("{why}"))
}

/// Finds a figure of the only point with this scene, method and value.
fn figure(trade: &Trade, [scene, method, value]: [&str; 3], name: &str) -> f64 {
    let is = |point: &&Point| point.scene.contains(scene) && point.method == method && point.value == value;
    let found: Vec<&Point> = trade.points.iter().filter(is).collect();
    assert_eq!(found.len(), 1, "{scene}, {method}, {value}");
    let error = found[0].errors.iter().find(|error| error.name == name);
    error.unwrap_or_else(|| panic!("{name} of {scene}, {method}, {value}")).interval.middle
}

/// Asserts that a trade has a default setting, finite errors, positive costs, and advice with figures.
fn is_whole(trade: &Trade) {
    let defaults = trade.points.iter().filter(|point| point.is_default).count();
    assert!(defaults > 0, "{}: no default", trade.name);
    assert!(trade.points.iter().all(|point| point.error().is_finite() && point.cost.middle > 0.0));
    assert!(
        !trade.advice.contains("NaN") && trade.advice.chars().any(|c| c.is_ascii_digit()),
        "{}",
        trade.advice
    );
}

#[test]
fn filter_is_more_accurate_than_the_cable_alone() {
    let trade = measured(navigation::measure);
    is_whole(&trade);
    let of = |scene: &str, value: &str, name: &str| figure(&trade, [scene, "method", value], name);
    let across = |value: &str| of("VITA 1, field", value, "position across");
    assert!(across("cable only") > 10.0 * across("filter, sonar returns"));
    let within = |scene: &str, value: &str| of(scene, value, "displacements within two sigma");
    assert!(within("taut cable", "filter, sonar returns") > 90.0);
    assert!(within("taut cable", "cable only") < 20.0, "the counter's resolution isn't its error");
    assert!(within("slack cable", "filter, sonar returns") < 60.0, "undeclared slack must show");
    let slack = |scene: &str| of(scene, "cable only", "displacement between passes");
    assert!(slack("VITA 1, slack") > 2.0 * slack("VITA 1, field"), "a slack three times as large");
    // If a setting has no effect, its result is exactly that of the default.
    let field = |method: &str, value: &str| {
        figure(&trade, ["VITA 1, field", method, value], "position across").to_bits()
    };
    let usual = field("method", "filter, sonar returns");
    for (method, same, others) in [
        ("inertial unit", "100 Hz", vec!["400 Hz", "25 Hz"]),
        ("epoch", "0.1 s", vec!["0.02 s", "0.05 s", "0.2 s", "0.5 s"]),
        ("window", "0.2 s", vec!["0.1 s", "0.5 s", "1 s"]),
        ("method", "filter, sonar returns", vec!["filter", "direct", "smoothed"]),
    ] {
        assert_eq!(field(method, same), usual, "{method}");
        assert!(others.iter().all(|value| field(method, value) != usual), "{method}");
    }
}

#[test]
fn tick_length_changes_no_verdict_but_a_coarse_profile_changes_the_advice() {
    let trade = measured(live::measure);
    is_whole(&trade);
    for value in ["1 ms", "5 ms", "20 ms", "50 ms", "100 ms"] {
        let of = |name: &str| figure(&trade, ["rehearsal", "tick", value], name);
        assert_eq!(of("dives with another digest than by default").to_bits(), 0.0_f64.to_bits(), "{value}");
        assert_eq!(of("other verdicts than by default").to_bits(), 0.0_f64.to_bits(), "{value}");
    }
    let off =
        |scene: &str, method: &str, value: &str| figure(&trade, [scene, method, value], "advised speed off");
    assert!(off("rehearsal", "ring", "1 degrees") > 2.0 * off("rehearsal", "ring", "0.1 degrees"));
    let vertices = |value: &str| off("surveyed", "vertices", value);
    assert!(
        vertices("10") > 10.0 * vertices("1000") && vertices("arcs") == 0.0,
        "{} {}",
        vertices("10"),
        vertices("1000")
    );
}

#[test]
fn omitting_an_effect_changes_the_result() {
    let trade = measured(simulation::measure);
    is_whole(&trade);
    for scene in ["boulders", "small pipe"] {
        let of = |value: &str| {
            let is =
                |point: &&Point| point.scene == scene && point.value == value && point.method == "left out";
            trade.points.iter().find(is).unwrap().error()
        };
        assert_eq!(of("none").to_bits(), 0.0_f64.to_bits(), "{scene}");
        assert!(of("beam_cone") > 0.0, "{scene}");
    }
    let rays =
        |value: &str| figure(&trade, ["field, rays", "rays of a beam", value], "size of the change of D");
    assert!(rays("1") > rays("64"), "{} and {}", rays("1"), rays("64"));
    let boulder = |value: &str, name: &str| {
        let is = |point: &&Point| point.scene == "boulders" && point.value == value;
        let point = trade.points.iter().find(is).unwrap();
        point.errors.iter().find(|error| error.name == name).unwrap().interval.middle
    };
    let (hit_m, missed_m) =
        (boulder("none", "smallest boulder hit"), boulder("none", "largest boulder missed"));
    assert!(
        (0.02..=0.8).contains(&hit_m) && missed_m < 0.8 && (hit_m - missed_m).abs() > 0.0,
        "{hit_m}, {missed_m}"
    );
}

/// At a confidence of k standard deviations (sigma), the plan aims at a smaller hole: T - k (sigma - 2 mm). It ignores
/// the first 2 mm of sigma.
#[test]
fn survey_hours_at_confidence_k_equal_the_hours_for_a_smaller_target() {
    let trade = measured(sureness::measure);
    is_whole(&trade);
    let inputs = inputs();
    let planner = survey::planner(&inputs, file("vita2-4.toml").unwrap(), HeadLayout::PhaseShift, 0.0)
        .unwrap()
        .with_errors(None);
    let mode = planner.modes().iter().position(|planned| planned.mode.name == "fast").unwrap();
    for (confidence, sigma_m) in [(1, 0.01), (2, 0.01), (3, 0.01), (2, 0.02)] {
        let target_m = 0.5 - f64::from(confidence) * (sigma_m - 0.002);
        let expected_mps = planner.v_max_mps(mode, target_m).unwrap();
        let method = format!("{confidence} sigma");
        let found =
            trade.points.iter().find(|point| point.method == method && point.value == format!("{sigma_m} m"));
        let hours = found.unwrap().cost.middle;
        assert!((hours - 7000.0 / expected_mps / 3600.0).abs() < 1e-9, "{method}, {sigma_m}: {hours}");
    }
}
