//! Tests that `headrace cost` finds planted errors, and that the page matches its data.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

use std::path::{Path, PathBuf};

use headrace_config::Document;
use headrace_cost::page::Results;
use headrace_cost::scene::file;
use headrace_cost::verdicts::{Judged, errors, inner};
use headrace_devices::KINDS;
use headrace_oracle::dive::{JudgedDive, dive};
use headrace_simulator::Scene;

const TARGET_M: f64 = 0.5;

/// Root folder of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn ideal() -> JudgedDive {
    let vehicle = |_: &str| Ok(file("vita2-4.toml").unwrap().as_bytes().to_vec());
    let document = Document::new("scene.toml", SCENE);
    let scene = Scene::parse(document, &KINDS, &vehicle, None).unwrap();
    dive(&scene).unwrap()
}

/// A scene whose only effects are motion within a turn and occlusion.
const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = 8\nspeed_mps = 0.1\n\
         [effects]\nmotion_within_turn = {}\nocclusion = {}\n";

/// Median of the hole error |D - D_true|, m, and metres per 100 m that falsely fail.
fn wrong(dive: &JudgedDive, judged: impl Fn(Judged) -> Judged) -> [f64; 2] {
    let sections: Vec<Judged> = inner(dive).map(|section| judged(Judged::of(section))).collect();
    assert!(sections.len() > 8, "{} sections", sections.len());
    let errors = errors(&[sections], TARGET_M);
    let figure = |name: &str| errors.iter().find(|error| error.name.contains(name)).unwrap().interval.middle;
    [figure("median"), figure("falsely failed")]
}

#[test]
fn deliberately_wrong_method_has_the_expected_error() {
    const PLANTED_M: f64 = 0.1;
    let dive = ideal();
    let [right_m, _] = wrong(&dive, |judged| judged);
    let [wrong_m, failed_m] = wrong(&dive, |judged| {
        let hole_m = judged.hole_m.map(|hole_m| hole_m + PLANTED_M);
        Judged { hole_m, passes: hole_m.map(|hole_m| hole_m <= TARGET_M), ..judged }
    });
    assert!(right_m < 0.005, "{right_m}");
    assert!((wrong_m - PLANTED_M).abs() <= right_m + 0.005, "{wrong_m}");
    assert!(failed_m > 50.0, "{failed_m} m in 100");
}

/// `docs/why/cost` must be generated from `cost.json` by the current program, without manual changes.
#[test]
fn cost_page_in_docs_matches_its_data() {
    let folder = root().join("docs/why/cost");
    let read =
        |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_else(|why| panic!("{name}: {why}"));
    let results: Results = serde_json::from_str(&read("cost.json")).unwrap();
    let files = results.files().unwrap();
    for (name, content) in &files {
        let end = if Path::new(name).extension().is_some_and(|of| of == "svg") {
            "<!-- headrace cost -->\n"
        } else {
            ""
        };
        let content = format!("{content}{end}");
        // Renews the layout of the files only. The measured times stay as they are.
        if std::env::var_os("HEADRACE_RENEW_COST").is_some() {
            std::fs::write(folder.join(name), &content).unwrap();
        }
        assert!(
            read(name) == content,
            "docs/why/cost/{name} differs from the page that headrace cost makes from docs/why/cost/cost.json; HEADRACE_RENEW_COST=1 renews it"
        );
    }
    let mut known: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
    known.sort_unstable();
    let there =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let mut there: Vec<String> = there.collect();
    there.sort_unstable();
    assert_eq!(there, known);
    for trade in &results.trades {
        let says_a_number = trade.advice.chars().any(|letter| letter.is_ascii_digit());
        assert!(says_a_number, "{}: {}", trade.name, trade.advice);
        assert!(trade.points.iter().any(|point| point.is_default), "{}: no default", trade.name);
    }
}

/// Among sections whose true hole D_true is over the target, the shipped defaults may pass only a small share.
#[test]
fn shipped_defaults_falsely_pass_few_sections() {
    let text = std::fs::read_to_string(root().join("docs/why/cost/cost.json")).unwrap();
    let results: Results = serde_json::from_str(&text).unwrap();
    let mut figures = 0;
    for point in results.trades.iter().flat_map(|trade| &trade.points).filter(|point| point.is_default) {
        for error in point.errors.iter().filter(|error| error.name.starts_with("passed of those over")) {
            figures += 1;
            assert!(error.interval.middle < 2.5, "{}: {} %", point.scene, error.interval.middle);
        }
    }
    assert!(figures > 0, "no trade has a figure for false passes");
}
