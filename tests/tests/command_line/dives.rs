//! `headrace dives`: the dives of a folder, with the metres of their reports.

use headrace_tests::{Folder, root};
use serde_json::Value;

fn golden(name: &str) -> Vec<u8> {
    std::fs::read(root().join(format!("tests/golden/{name}.mcap"))).unwrap()
}

#[test]
fn dives_of_a_folder_have_the_figures_of_their_reports() {
    let folder = Folder::new();
    folder.write("murk.mcap", golden("murk"));
    folder.write("fast.mcap", golden("too-fast"));
    for (name, broken) in [
        ("a.json", &b"\xff{"[..]),
        ("b.json", b"{"),
        ("c.json", b"{\"log\": {\"path\": 1}}"),
        ("d.json", b"[]"),
    ] {
        folder.write(name, broken);
    }
    let murk: Value = folder.replay("murk.mcap", &[]).1;
    folder.write("of-murk.json", murk.to_string());
    let answer = folder.headrace(&["dives", "--json"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let list: Value = serde_json::from_str(&answer.stdout).unwrap();
    let of = |name: &str| {
        let named = |dive: &&Value| dive["recording"].as_str().unwrap().ends_with(name);
        list["dives"].as_array().unwrap().iter().find(named).unwrap()
    };
    assert_eq!(list["dives"].as_array().unwrap().len(), 2);
    let (dive, sums) = (of("murk.mcap"), &murk["summary"]);
    assert_eq!((&dive["pass_m"], &dive["fail_m"]), (&sums["pass_m"], &sums["fail_m"]));
    assert_eq!(dive["from_m"], murk["coverage_extent"]["from_m"]);
    let rest_m: f64 =
        ["cannot_say_m", "open_m", "not_inspected_m"].iter().map(|key| sums[key].as_f64().unwrap()).sum();
    assert!((dive["no_verdict_m"].as_f64().unwrap() - rest_m).abs() < 1e-9, "{dive}");
    assert!(
        (dive["duration_s"].as_f64().unwrap() - murk["dive"]["duration_s"].as_f64().unwrap()).abs() < 1.0
    );
    assert_eq!(of("fast.mcap")["pass_m"], Value::Null, "it has no report");
    // The report that is named like the recording has precedence over others of the same recording.
    let (_, other) = folder.replay("murk.mcap", &["--target", "0.1"]);
    assert_ne!(other["summary"], murk["summary"]);
    folder.write("a-report.json", other.to_string());
    folder.write("murk.json", murk.to_string());
    let again: Value = serde_json::from_str(&folder.headrace(&["dives", "--json"]).stdout).unwrap();
    let paths: Vec<&Value> = again["dives"].as_array().unwrap().iter().map(|dive| &dive["report"]).collect();
    assert!(paths.contains(&&Value::from("./murk.json")), "{paths:?}");
    let text = folder.headrace(&["dives"]).stdout;
    let pass_m = format!(" {:.2} ", sums["pass_m"].as_f64().unwrap());
    let is_of_murk = |line: &str| line.starts_with("murk.mcap ") && line.contains(&pass_m);
    assert!(text.lines().any(is_of_murk), "{text}");
    assert!(text.contains("fast.mcap: there is no report"), "{text}");
    assert!(!text.contains("murk.mcap: "), "{text}");
    assert_eq!(text.lines().count(), 4, "titles, two dives, and the missing report: {text}");
}

#[test]
fn interrupted_and_unreadable_dives_are_named() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "cut.mcap", &[]);
    let whole = folder.read("cut.mcap");
    folder.write("cut.mcap", &whole[..whole.len() * 3 / 4]);
    folder.write("junk.mcap", "no log");
    let answer = folder.headrace(&["dives", "."]);
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    for words in ["junk.mcap: ", "cut.mcap: the dive was interrupted", "dive.mcap: there is no report"] {
        assert!(answer.stdout.contains(words), "{words}: {}", answer.stdout);
    }
    assert_eq!(folder.headrace(&["dives", "absent"]).code, Some(2));
    std::fs::create_dir(folder.path("empty")).unwrap();
    assert_eq!(folder.headrace(&["dives", "empty"]).code, Some(2));
}
