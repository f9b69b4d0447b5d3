//! Golden logs of hard situations. Each log replays to its stored report and its stored, reviewed text.
//!
//! `tests/golden/make` makes the logs of new scenes and renews reports.

use std::path::PathBuf;

/// Size limit of a log in the repository, bytes.
const MOST_BYTES: u64 = 2_000_000;

fn folder() -> PathBuf {
    headrace_tests::root().join("tests/golden")
}

/// Names of all golden files with the extension `ending`, sorted and without the extension.
fn names(ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(folder()).unwrap();
    let name = |entry: std::io::Result<std::fs::DirEntry>| entry.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> =
        entries.map(name).filter_map(|name| name.strip_suffix(ending).map(str::to_owned)).collect();
    names.sort();
    names
}

#[test]
fn golden_logs_replay_to_their_reports_and_printed_text() {
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(folder());
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    let mut differing = Vec::new();
    for name in names(".mcap") {
        let output = headrace_tests::program()
            .args(["replay", &format!("{name}.mcap"), "--expect", &format!("{name}.json")])
            .current_dir(folder())
            .output()
            .unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        if output.status.code() != Some(0) {
            differing.push(format!("{name}: exit code {:?}\n{stderr}", output.status.code()));
        }
        let stdout = String::from_utf8(output.stdout).unwrap();
        settings.bind(|| insta::assert_snapshot!(name.clone(), stdout));
    }
    assert!(differing.is_empty(), "{}", differing.join("\n"));
}

#[test]
fn every_golden_log_is_small_and_has_a_scene_a_report_and_a_text() {
    let logs = names(".mcap");
    assert!(logs.len() >= 10, "{logs:?}");
    for ending in [".scene.toml", ".json", ".snap"] {
        assert_eq!(names(ending), logs, "{ending}");
    }
    for name in &logs {
        let bytes = std::fs::metadata(folder().join(format!("{name}.mcap"))).unwrap().len();
        assert!(bytes < MOST_BYTES, "{name}: {bytes} bytes");
    }
}
