//! A dive recorded in several parts is replayed, verified and recovered like a dive in one log, also after a kill.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use headrace_tests::Folder;
use serde_json::Value;

/// Number of dives that the test kills while they are recorded.
const KILLS: u64 = 12;

fn record(folder: &Folder, further: &[&str]) -> Value {
    let arguments = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--json"];
    let answer = folder.headrace(&[&arguments, further].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    serde_json::from_str(&answer.stdout).unwrap()
}

fn shell_digest(folder: &Folder, files: &str) -> Option<String> {
    let script = format!("cat {files} | sha256sum");
    let output = Command::new("sh").args(["-c", &script]).current_dir(folder.path("")).output().ok()?;
    Some(String::from_utf8(output.stdout).ok()?.split_whitespace().next()?.to_owned())
}

#[test]
fn dive_in_parts_replays_and_verifies_as_one() {
    let folder = Folder::with_dive();
    let whole = record(&folder, &["--record", "whole.mcap"]);
    std::fs::create_dir(folder.path("parts")).unwrap();
    record(&folder, &["--record", "parts/dive.mcap", "--rotate", "5s"]);
    let (code, report) = folder.replay("parts/dive.mcap", &[]);
    assert_eq!((code, &report["digest"]), (Some(0), &whole["digest"]));
    let names = |report: &Value| {
        let parts = report["log"]["parts"].as_array().cloned().unwrap_or_default();
        parts.iter().map(|part| part["path"].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    let expected = ["parts/dive.part001.mcap", "parts/dive.part002.mcap", "parts/dive.part003.mcap"];
    assert!(names(&report).len() >= 3 && names(&report)[..3] == expected, "{:?}", names(&report));
    assert_eq!(names(&whole), [""; 0]);

    // A command accepts the recording's name, its folder, or its files in any order.
    let mut files = names(&report);
    files.reverse();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    for log in [&["parts/dive.mcap"][..], &["parts"], &files] {
        let answer = folder.headrace(&[&["replay", "--json"], log].concat());
        let replayed: Value = serde_json::from_str(&answer.stdout).unwrap();
        assert_eq!((answer.code, &replayed["digest"]), (Some(0), &whole["digest"]), "{log:?}");
        assert_eq!(replayed["log"]["parts"], report["log"]["parts"], "{log:?}");
        assert_eq!(replayed["log"]["messages"], whole["log"]["messages"]);
        let parts = report["log"]["parts"].as_array().unwrap().iter();
        let sum: u64 = parts.map(|part| part["messages"].as_u64().unwrap()).sum();
        assert_eq!(replayed["log"]["messages"], sum);
        assert_eq!(replayed["log"]["sha256"], report["log"]["sha256"]);
    }
    if let Some(digest) = shell_digest(&folder, "parts/dive.part*.mcap") {
        assert_eq!(report["log"]["sha256"], digest.as_str());
    }
    let answer = folder.headrace(&["verify", "parts"]);
    assert!(
        answer.code == Some(0) && answer.stdout.contains("the replay equals the dive"),
        "{}",
        answer.stdout
    );

    // `recover` joins the parts into one log.
    let answer = folder.headrace(&["recover", "parts", "-o", "joined.mcap"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    assert_eq!(folder.digest("joined.mcap", &[]), whole["digest"].as_str().unwrap());

    // A single missing part is reported as a loss. If all parts except one are missing, each missing part is reported
    // as well.
    std::fs::remove_file(folder.path("parts/dive.part002.mcap")).unwrap();
    let (code, report) = folder.replay("parts", &[]);
    let losses = report["log"]["losses"].to_string();
    assert!(code == Some(3) && losses.contains("part 2 of the recording is missing (after "), "{losses}");
    let (code, report) = folder.replay("parts/dive.part001.mcap", &[]);
    let losses = report["log"]["losses"].to_string();
    assert!(
        code == Some(3) && losses.contains("part 2 of the recording is missing, and any after"),
        "{losses}"
    );
}

#[test]
fn live_report_lists_the_parts_of_the_recording() {
    let folder = Folder::with_dive();
    // There may or may not be devices at the addresses in the vehicle file. In either case, they send too little data
    // for a second part of the log.
    let arguments =
        ["run", "vehicle.toml", "--record", "live.mcap", "--rotate", "1GiB", "--for", "1", "--json"];
    let answer = folder.headrace(&arguments);
    let report: Value = serde_json::from_str(&answer.stdout).unwrap_or_else(|_| panic!("{}", answer.stderr));
    assert_eq!(report["log"]["path"], "live.mcap");
    let [part] = &report["log"]["parts"].as_array().unwrap()[..] else { panic!("{report}") };
    assert_eq!((&part["path"], &part["messages"]), (&"live.part001.mcap".into(), &report["log"]["messages"]));
    assert_eq!(part["sha256"], report["log"]["sha256"]);
    if let Some(digest) = shell_digest(&folder, "live.part001.mcap") {
        assert_eq!(part["sha256"], digest.as_str());
    }
}

#[test]
fn parts_are_never_overwritten_or_mixed() {
    let folder = Folder::with_dive();
    for name in ["a", "b"] {
        let log = format!("{name}.mcap");
        record(&folder, &["--record", &log, "--rotate", "5s"]);
        let arguments = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--record", &log];
        let answer = folder.headrace(&[&arguments[..], &["--rotate", "1h"]].concat());
        assert!(answer.code == Some(2) && answer.stderr.contains("part001"), "{}", answer.stderr);
    }
    let answer = folder.headrace(&["replay", "a.part001.mcap", "b.part002.mcap"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
    assert!(answer.stderr.contains("are parts of different recordings"), "{}", answer.stderr);
    for wrong in ["5", "10B", "fast", "0.1s"] {
        let arguments = ["run", "vehicle.toml", "--record", "c.mcap", "--rotate", wrong];
        assert_eq!(folder.headrace(&arguments).code, Some(2), "{wrong}");
    }
}

#[test]
fn dive_killed_between_parts_loses_at_most_one_second() {
    let folder = Folder::with_dive();
    let (mut parts, mut same) = (0, 0);
    for number in 0..KILLS {
        let name = format!("killed-{number}");
        std::fs::create_dir(folder.path(&name)).unwrap();
        let log = format!("{name}/dive.mcap");
        // Each part covers one second of the dive, which takes a twentieth of a second of real time.
        let mut dive = headrace_tests::program()
            .args(["run", "vehicle.toml", "--source", "dive.mcap", "--record", &log])
            .args(["--rotate", "1s", "--speed", "20x"])
            .current_dir(folder.path(""))
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        std::thread::sleep(Duration::from_millis(150 + 60 * number));
        dive.kill().ok();
        dive.wait().unwrap();
        parts += std::fs::read_dir(folder.path(&name)).unwrap().count();
        let answer = folder.headrace(&["verify", "--json", &name]);
        let Ok(report) = serde_json::from_str::<Value>(&answer.stdout) else {
            let early = ["holds no log", "is not an MCAP file", "no vehicle file can be read"];
            assert!(early.iter().any(|words| answer.stderr.contains(words)), "{name}: {}", answer.stderr);
            continue;
        };
        assert_eq!(report["differences"], Value::Array(Vec::new()), "{name}: {report}");
        let lost = report["losses"].as_array().unwrap();
        // After a kill, data may be lost from two parts of the log: the part that was being written, and a part that
        // had just begun.
        assert!(lost.len() <= 2, "{name}: {report}");
        assert!(lost.iter().all(|loss| !loss.as_str().unwrap().contains("missing")), "{name}: {report}");
        same += report["same_records"].as_u64().unwrap();
        assert!(Path::new(&folder.path(&name)).exists());
    }
    println!("{KILLS} kills, {parts} parts, {same} results the same");
    assert!(parts > 20 && same > 1000, "{parts} parts, {same} results");
}

#[test]
fn part_named_twice_is_read_once() {
    let folder = Folder::with_dive();
    record(&folder, &["--record", "a.mcap", "--rotate", "5s"]);
    let digest = folder.digest("a.mcap", &[]);
    // After a failed write, the first part may have the plain name of the recording.
    std::fs::rename(folder.path("a.part001.mcap"), folder.path("a.mcap")).unwrap();
    let mut names: Vec<String> = std::fs::read_dir(folder.path(""))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("a."))
        .collect();
    names.sort();
    assert!(names.len() > 2, "{names:?}");
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    for further in [&names[1..], &["a.part002.mcap"], &["./a.part002.mcap", "a.mcap"]] {
        assert_eq!(folder.digest("a.mcap", further), digest, "{further:?}");
    }
    // If two files claim to be the same part, the error names both.
    std::fs::copy(folder.path("a.part002.mcap"), folder.path("b.mcap")).unwrap();
    let answer = folder.headrace(&["replay", "a.mcap", "b.mcap"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
    let both = "a.part002.mcap and b.mcap are both part 2";
    assert!(
        answer.stderr.contains(both) || answer.stderr.contains("b.mcap and a.part002.mcap"),
        "{}",
        answer.stderr
    );
}
