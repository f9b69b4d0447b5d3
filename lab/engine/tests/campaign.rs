//! Tests the program on small simulated dives: the golden logs.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by them")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use serde_json::Value;
use tempfile::TempDir;

#[cfg(feature = "cluster")]
mod cluster;

/// Logs of 16 to 20 s, all different.
const LOGS: [&str; 5] = ["adrift", "murk", "sectors", "stalls", "steel"];

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name)
}

/// A folder with two plants: one has two dives, the other has three.
fn dives() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (number, log) in LOGS.iter().enumerate() {
        let plant = folder.path().join(if number < 2 { "ceran" } else { "rosone" });
        std::fs::create_dir_all(&plant).unwrap();
        std::fs::copy(golden(&format!("{log}.mcap")), plant.join(format!("{log}.mcap"))).unwrap();
    }
    folder
}

fn program(folder: &Path, cache: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_headrace-campaign"));
    command.arg(folder).arg("--cache").arg(cache).args(arguments);
    command
}

fn run(folder: &Path, cache: &Path, arguments: &[&str]) -> Output {
    program(folder, cache, arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Runs SQL; returns the rows of the answer and the last line of stderr.
fn ask(folder: &Path, cache: &Path, sql: &str, more: &[&str]) -> (Vec<Value>, String) {
    let answer = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
    let output =
        program(folder, cache, more).args(["--sql", sql, "--out"]).arg(answer.path()).output().unwrap();
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", stderr(&output));
    let text = std::fs::read_to_string(answer.path()).unwrap();
    let rows = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (rows, stderr(&output).lines().last().unwrap_or_default().to_owned())
}

/// Content of every file of finished dives in a cache, by path below the folder of the program version.
fn files(cache: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn collect(folder: &Path, base: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in std::fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, base, files);
            } else {
                files.insert(path.strip_prefix(base).unwrap().to_owned(), std::fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    let version = cache.join(headrace_tables::program_version());
    collect(&version, &version, &mut found);
    found
}

/// Number of finished dives in a cache.
fn finished(cache: &Path) -> usize {
    files(cache).keys().filter(|path| path.ends_with("whole.json")).count()
}

#[test]
fn threads_shards_and_repeated_runs_give_the_same_tables() {
    let (folder, scratch) = (dives(), tempfile::tempdir().unwrap());
    let cache = |name: &str| scratch.path().join(name);
    let one = run(folder.path(), &cache("one"), &["--threads", "1"]);
    assert_eq!(one.status.code(), Some(0), "{}", stderr(&one));
    assert_eq!(stderr(&one), "5 dives: 5 replayed, 0 from the cache; 0 unreadable, 0 with lost data\n");
    let all = files(&cache("one"));
    assert_eq!(all.len(), 5 * 8);
    run(folder.path(), &cache("two"), &["--threads", "2"]);
    assert!(files(&cache("two")) == all, "two threads differ from one");
    let again = run(folder.path(), &cache("one"), &[]);
    assert_eq!(stderr(&again), "5 dives: 0 replayed, 5 from the cache; 0 unreadable, 0 with lost data\n");

    let mut union = BTreeMap::new();
    for shard in ["1/2", "2/2"] {
        let out = cache(&shard.replace('/', "-"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_headrace-campaign"));
        let output =
            command.arg("--batch").arg(folder.path()).args(["--shard", shard, "--out"]).arg(&out).output();
        assert_eq!(output.unwrap().status.code(), Some(0));
        for (path, content) in files(&out) {
            assert!(union.insert(path, content).is_none(), "two shards have the same dive");
        }
    }
    assert!(union == all, "all shards together differ from one run");
    // If the folders of all shards are merged into one folder, this folder is a cache.
    let moved = cache("1-2").join(headrace_tables::program_version());
    let copied = Command::new("cp").arg("-r").arg(&moved).arg(cache("2-2")).status().unwrap();
    assert!(copied.success());
    let from_shards = run(folder.path(), &cache("2-2"), &[]);
    assert!(stderr(&from_shards).contains(" 0 replayed, 5 from the cache"), "{}", stderr(&from_shards));
}

#[test]
fn sql_answers_match_the_reports() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    let sql = "SELECT d.log, d.plant, d.digest, s.chainage_m, s.verdict, s.d_m FROM sections s JOIN dives d ON s.dive = d.dive \
               ORDER BY d.log, s.chainage_m";
    let (rows, _) = ask(folder.path(), cache.path(), sql, &[]);
    let mut expected = Vec::new();
    for (number, log) in LOGS.iter().enumerate() {
        let report: Value =
            serde_json::from_str(&std::fs::read_to_string(golden(&format!("{log}.json"))).unwrap()).unwrap();
        let plant = if number < 2 { "ceran" } else { "rosone" };
        for section in report["sections"].as_array().unwrap() {
            let mut row = serde_json::json!({
                "log": format!("{plant}/{log}.mcap"), "plant": plant, "digest": report["digest"],
                "chainage_m": section["start_m"], "verdict": section["verdict"],
            });
            if let Some(d_m) = section["hole_m"].as_f64() {
                row["d_m"] = d_m.into();
            }
            expected.push(row);
        }
    }
    assert_eq!(rows, expected);
}

#[test]
fn replay_is_a_table_function_with_parameters() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    let of = |parameters: &str, more: &[&str]| {
        let sql = format!("SELECT log_sha256, target_m, fail_m FROM {parameters} ORDER BY log_sha256");
        ask(folder.path(), cache.path(), &sql, more).0
    };
    let asked = of("replay('*', 'target_m=0.3', 'dives')", &[]);
    assert_eq!(asked.len(), 5);
    assert!(asked.iter().all(|row| row["target_m"] == 0.3));
    assert_eq!(asked, of("dives", &["--target", "0.3"]));
    let fails = |rows: &[Value]| rows.iter().map(|row| row["fail_m"].as_f64().unwrap()).sum::<f64>();
    assert!(fails(&asked) > fails(&of("dives", &[])));
    let (one, _) =
        ask(folder.path(), cache.path(), "SELECT DISTINCT dive FROM replay('ceran/murk.mcap')", &[]);
    assert_eq!(one.len(), 1);
    for (wrong, why) in [
        ("replay('murk.mcap')", "has no such log"),
        ("replay('*', 'target_m=0')", "must be from 0.01 to 20"),
        ("replay('*', '', 'section')", "isn't a table of a dive"),
    ] {
        let output = run(folder.path(), cache.path(), &["--sql", &format!("SELECT * FROM {wrong}")]);
        assert_eq!(output.status.code(), Some(1));
        assert!(stderr(&output).contains(why), "{}", stderr(&output));
    }
}

#[test]
fn unreadable_log_becomes_a_row() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    std::fs::write(folder.path().join("no-log.mcap"), "this is no log").unwrap();
    let whole = std::fs::read(golden("stalls.mcap")).unwrap();
    std::fs::write(folder.path().join("rosone/cut.mcap"), &whole[..whole.len() / 2]).unwrap();
    std::fs::copy(golden("murk.mcap"), folder.path().join("copy.mcap")).unwrap();
    let output = run(folder.path(), cache.path(), &["--threads", "1"]);
    assert_eq!(output.status.code(), Some(3));
    let text = stderr(&output);
    assert!(text.contains("headrace-campaign: no-log.mcap: "), "{text}");
    assert!(text.contains("copy.mcap is a copy of ceran/murk.mcap; both count as one dive"), "{text}");
    assert!(
        text.ends_with("7 dives: 7 replayed, 1 from the cache; 1 unreadable, 1 with lost data\n"),
        "{text}"
    );
    let sql = "SELECT log, exit_code, losses, error FROM dives ORDER BY log";
    let (rows, last) = ask(folder.path(), cache.path(), sql, &[]);
    assert_eq!(rows.len(), 7);
    // Each run tries again to replay a log that can't be replayed.
    assert!(last.starts_with("7 dives: 1 replayed, 7 from the cache; 1 unreadable, 1 with"), "{last}");
    let of = |log: &str| rows.iter().find(|row| row["log"] == log).unwrap();
    assert_eq!(of("no-log.mcap")["exit_code"], 2);
    assert!(of("no-log.mcap")["error"].as_str().unwrap().contains("no-log.mcap"));
    assert_eq!(of("rosone/cut.mcap")["exit_code"], 3);
    assert!(of("rosone/cut.mcap")["losses"].as_i64().unwrap() > 0);
    assert_eq!(of("rosone/stalls.mcap")["exit_code"], 0);
    // The table function also returns the path of a log that is a copy.
    let (logs, _) =
        ask(folder.path(), cache.path(), "SELECT DISTINCT log FROM replay('*', '', 'dives')", &[]);
    assert_eq!(logs.len(), 8);
}

#[test]
fn sigkill_loses_no_finished_dive() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    let mut running = program(folder.path(), cache.path(), &["--threads", "1"]).spawn().unwrap();
    while finished(cache.path()) == 0 {
        assert!(running.try_wait().unwrap().is_none(), "the program ended before it finished a dive");
        std::thread::sleep(Duration::from_millis(2));
    }
    // `kill` sends SIGKILL.
    running.kill().unwrap();
    running.wait().unwrap();
    let there = finished(cache.path());
    let again = run(folder.path(), cache.path(), &[]);
    let wanted =
        format!("5 dives: {} replayed, {there} from the cache; 0 unreadable, 0 with lost data\n", 5 - there);
    assert_eq!(stderr(&again), wanted);
    let fresh = tempfile::tempdir().unwrap();
    run(folder.path(), fresh.path(), &[]);
    assert!(files(cache.path()) == files(fresh.path()), "after the kill the tables differ");
}

#[test]
fn broken_cache_entries_are_found_and_remade() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    run(folder.path(), cache.path(), &[]);
    let all = files(cache.path());
    let below = |path: &Path| cache.path().join(headrace_tables::program_version()).join(path);
    let sections: Vec<&PathBuf> = all.keys().filter(|path| path.ends_with("sections.parquet")).collect();
    // Three kinds of damage: a changed bit, a truncated file, and a deleted file.
    let mut flipped = all[sections[0]].clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    std::fs::write(below(sections[0]), flipped).unwrap();
    std::fs::write(below(sections[1]), &all[sections[1]][..100]).unwrap();
    std::fs::remove_file(below(sections[2]).with_file_name("whole.json")).unwrap();
    let output = run(folder.path(), cache.path(), &[]);
    assert_eq!(output.status.code(), Some(0));
    let text = stderr(&output);
    assert!(
        text.ends_with(
            "5 dives: 3 replayed, 2 from the cache, 3 damaged there; 0 unreadable, 0 with lost data\n"
        ),
        "{text}"
    );
    assert!(files(cache.path()) == all);
}

#[test]
fn changed_log_counts_as_a_new_dive() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    run(folder.path(), cache.path(), &[]);
    std::fs::copy(golden("echoes.mcap"), folder.path().join("ceran/murk.mcap")).unwrap();
    let output = run(folder.path(), cache.path(), &[]);
    assert!(stderr(&output).starts_with("5 dives: 1 replayed, 4 from the cache"), "{}", stderr(&output));
}

#[test]
fn every_question_has_an_answer_and_a_picture() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    let about = "log,plant,pilot,day\nceran/murk.mcap,Ceran,Ada,2020-05-01\nrosone/stalls.mcap,Ceran,Ben,2024-06-02\n";
    std::fs::write(folder.path().join("dives.csv"), about).unwrap();
    // Makes the cache look as if an earlier program version had replayed the same dives with the same results.
    run(folder.path(), cache.path(), &[]);
    let now = cache.path().join(headrace_tables::program_version());
    let before = cache.path().join("0.0.1+earlier");
    assert!(Command::new("cp").arg("-r").arg(&now).arg(&before).status().unwrap().success());
    let questions = ["years", "target", "causes", "versions", "worst"];
    let listed = Command::new(env!("CARGO_BIN_EXE_headrace-campaign")).arg("--questions").output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    let names: Vec<&str> = listed.lines().map(|line| line.split_whitespace().next().unwrap()).collect();
    assert_eq!(names, questions);
    let mut answers = BTreeMap::new();
    for question in questions {
        let (svg, json) = (cache.path().join("picture.svg"), cache.path().join("answer.json"));
        let output = program(folder.path(), cache.path(), &["--question", question, "--picture"])
            .arg(&svg)
            .arg("--out")
            .arg(&json)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(0), "{question}: {}", stderr(&output));
        let svg = std::fs::read_to_string(svg).unwrap();
        assert!(svg.starts_with("<svg") && svg.contains("<text"), "{question}");
        let text = std::fs::read_to_string(json).unwrap();
        let rows: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        assert!(!rows.is_empty(), "{question}");
        answers.insert(question, rows);
    }
    let years = &answers["years"];
    assert!(years.iter().any(|row| row["dived"] == "Ceran 2020-05-01"));
    assert!(years.iter().any(|row| row["dived"] == "Ceran 2024-06-02"));
    // Both versions have the same sections, so nothing has changed.
    assert!(answers["versions"].iter().all(|row| {
        let both = row["change"].as_str().unwrap().split_once(" -> ").unwrap();
        both.0 == both.1 && row["d_moved_most_m"].as_f64().is_none_or(|moved_m| moved_m == 0.0)
    }));
    assert!(answers["target"].iter().any(|row| row["fail_at_03_m"].as_f64() > row["fail_m"].as_f64()));
    let failed: Vec<f64> = answers["worst"].iter().filter_map(|row| row["d_m"].as_f64()).collect();
    assert!(failed.len() <= 20 && answers["worst"].iter().all(|row| !row["cause"].is_null()));
    assert!(answers["causes"].iter().all(|row| row["hours"].as_f64().unwrap() >= 0.0));
}

#[test]
fn invalid_requests_are_refused_with_a_reason() {
    let (folder, cache) = (dives(), tempfile::tempdir().unwrap());
    let refused = |folder: &Path, arguments: &[&str], code: i32, why: &str| {
        let output = run(folder, cache.path(), arguments);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}", stderr(&output));
        assert!(stderr(&output).contains(why), "{arguments:?}: {}", stderr(&output));
    };
    let here = folder.path();
    refused(
        here,
        &["--question", "best"],
        2,
        "--question best: expected one of years, target, causes, versions, worst",
    );
    refused(here, &["--sql", "SELECT x FROM sections"], 1, "No field named x");
    refused(here, &["--target", "50"], 2, "target_m = 50: must be from 0.01 to 20");
    refused(
        here,
        &["--sql", "SELECT 1", "--out", "answer.txt"],
        2,
        "expected an ending of .csv, .json, .parquet",
    );
    refused(&here.join("none"), &[], 2, "opening ");
    let empty = tempfile::tempdir().unwrap();
    refused(empty.path(), &[], 2, "none found");
    std::fs::write(here.join("dives.csv"), "log,day\nx,May\n").unwrap();
    refused(here, &[], 2, "dives.csv:2: day = May: must be a day like 2024-05-31");
}
