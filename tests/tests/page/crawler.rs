//! A crawler that visits random moments of dives on all screens. A figure must be the same wherever it appears, and
//! each screen must give only one instruction at a time.

mod contradictions;
mod visit;

use headrace_tests::random_dives::{Draw, seeded};
use headrace_tests::{Folder, root};
use serde_json::{Value, json};

use contradictions::{contradictions, of_result};
use visit::{Crawl, Moment};

/// Visits `count` random moments of the dive in the folder, and then its end. Returns all contradictions.
fn crawl(folder: &Folder, draw: &mut Draw, count: u32) -> Vec<String> {
    let mut crawl = Crawl::start(folder);
    let last_s = crawl.last_s();
    let mut found = Vec::new();
    for _ in 0..count {
        // The time is rounded to whole milliseconds, because these are the same in all notations.
        let at_s = (draw.between(0.5, last_s - 0.5) * 1e3).round() / 1e3;
        let moment = crawl.visit(at_s, &mut contradictions);
        found.extend(contradictions(&moment).into_iter().map(|one| format!("{at_s} s: {one}")));
    }
    let (end, summary, report) = crawl.end(folder);
    found.extend(of_result(&end, &summary, &report).into_iter().map(|one| format!("at the end: {one}")));
    found
}

/// A folder with a golden log as `dive.mcap`.
fn with_golden(name: &str) -> Folder {
    let folder = Folder::new();
    folder.write("dive.mcap", std::fs::read(root().join(format!("tests/golden/{name}.mcap"))).unwrap());
    folder
}

#[test]
fn screens_agree_at_random_moments_of_golden_dives() {
    let mut found = Vec::new();
    for (seed, name) in (1..).zip(["too-fast", "adrift", "stalls"]) {
        let wrong = crawl(&with_golden(name), &mut Draw::new(seed), 4);
        found.extend(wrong.into_iter().map(|one| format!("{name}, {one}")));
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Run with `cargo test --release -p headrace_tests --test page crawler -- --ignored --nocapture`. `HEADRACE_SEED=100`
/// sets another first seed.
#[test]
#[ignore = "long: 200 moments of 20 dives"]
fn screens_agree_at_200_random_moments_of_20_random_dives() {
    let first = std::env::var("HEADRACE_SEED").map_or(0, |seed| seed.parse().unwrap());
    let mut found = Vec::new();
    for seed in first..first + 20 {
        let (folder, dive) = (Folder::new(), seeded(seed));
        folder.write("vehicle.toml", &dive.vehicle);
        folder.write("scene.toml", &dive.scene);
        folder.simulate("scene.toml", "dive.mcap");
        let wrong = crawl(&folder, &mut Draw::new(seed), 200);
        println!("seed {seed}, {:?}: {} contradictions {wrong:#?}", dive.kind, wrong.len());
        found.extend(wrong.into_iter().map(|one| format!("seed {seed}, {one}")));
    }
    assert!(found.is_empty(), "{found:#?}");
}

/// Each change makes one screen contradict the others.
#[test]
fn crawler_finds_every_changed_figure() {
    // At this moment, a limit applies and a missed stretch is outstanding.
    let moment = Crawl::start(&with_golden("too-fast")).visit(20.733, &mut contradictions);
    assert_eq!(contradictions(&moment), Vec::<String>::new());
    let changes: [(&str, Value); 12] = [
        ("/t_s", json!(0.5)),
        ("/now_s", json!(1e6)),
        ("/position/station", json!("9+999.99")),
        ("/position/chainage_m", json!(999.0)),
        ("/speeds/speed", json!("9.99")),
        ("/speeds/limit", json!("9.99")),
        ("/v_max_mps", json!(9.0)),
        ("/metres/pass_m", json!(99.0)),
        ("/metres/way_m", json!(99.0)),
        ("/outstanding", json!("99.00 m missed")),
        ("/alert_counts/active", json!(99)),
        ("/text", json!("0+000.00  go -> stop -> go")),
    ];
    for (path, value) in changes {
        for of_page in [false, true] {
            let mut changed = moment.clone();
            let of = if of_page { &mut changed.page } else { &mut changed.line };
            *of.pointer_mut(path).unwrap() = value.clone();
            assert!(!contradictions(&changed).is_empty(), "{path} of the page: {of_page}");
        }
        // If the same figure is changed on the page and in the JSON line, it contradicts the terminal or other figures.
        let mut changed = moment.clone();
        for of in [&mut changed.page, &mut changed.line] {
            *of.pointer_mut(path).unwrap() = value.clone();
        }
        assert!(!contradictions(&changed).is_empty(), "{path} of both");
    }
    for (shown, other) in
        [("SPEED  ", "SPEED  9"), ("METRES ", "METRES 9"), ("AT     ", "AT     9"), ("ALERTS ", "ALERTS 9")]
    {
        let screen = moment.screen.replacen(shown, other, 1);
        assert!(!contradictions(&Moment { screen, ..moment.clone() }).is_empty(), "{other}");
    }
    let screen = moment.screen.replacen("SPEED  ", "  → stop\nSPEED  ", 1).replacen("\n\n", "\n  → go\n", 1);
    assert!(!contradictions(&Moment { screen, ..moment.clone() }).is_empty(), "two instructions");
    let mut sections = moment.metres;
    sections[1] += 2.0;
    assert!(!contradictions(&Moment { metres: sections, ..moment }).is_empty(), "a section more");
}
