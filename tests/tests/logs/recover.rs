//! Damaged logs and full disks. Checks exit codes and messages, and that the recovered log replays to the same digest.

use std::process::Command;

use headrace_tests::Folder;
use serde_json::Value;

/// Records a dive live; returns its folder and log.
fn recorded() -> (Folder, Vec<u8>) {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    let log = folder.read("live.mcap");
    (folder, log)
}

fn recover(folder: &Folder, log: &str, output: &str) -> (Option<i32>, Value) {
    let answer = folder.headrace(&["recover", log, "-o", output, "--json"]);
    (
        answer.code,
        serde_json::from_str(&answer.stdout).unwrap_or_else(|error| panic!("{error}: {}", answer.stderr)),
    )
}

#[test]
fn damaged_log_and_its_recovery_have_the_same_digest() {
    let (folder, whole) = recorded();
    let mut spotted = whole.clone();
    // The zeroed bytes simulate a disk that loses a block of 4096 bytes.
    spotted[whole.len() / 2..][..4096].fill(0);
    for (name, bytes) in [("cut", &whole[..whole.len() * 2 / 3]), ("spotted", &spotted)] {
        let (log, fixed) = (format!("{name}.mcap"), format!("{name}-fixed.mcap"));
        folder.write(&log, bytes);
        let (code, report) = recover(&folder, &log, &fixed);
        assert_eq!(code, Some(3), "{report}");
        let loss = &report["losses"][0];
        assert!(loss["from_ns"].is_u64() && loss["what"].as_str().unwrap().contains("after "), "{report}");
        let ((before, damaged), (after, recovered)) = (folder.replay(&log, &[]), folder.replay(&fixed, &[]));
        assert_eq!((before, after), (Some(3), Some(3)), "{name}: the loss is still reported");
        assert_eq!(recovered["digest"], damaged["digest"], "{name}");
        assert_eq!(recovered["sections"], damaged["sections"], "{name}");
        assert_eq!(recovered["log"]["messages"], damaged["log"]["messages"], "{name}");
        let losses = |report: &Value| report["log"]["losses"].as_array().unwrap().len();
        assert_eq!(losses(&recovered), losses(&damaged), "{name}: {}", recovered["log"]["losses"]);
    }
    // The recovered log also keeps the results that were recorded during the dive.
    let answer = folder.headrace(&["verify", "cut-fixed.mcap", "--json"]);
    let report: Value = serde_json::from_str(&answer.stdout).unwrap();
    assert_eq!(answer.code, Some(3), "{report}");
    assert!(report["same_records"].as_u64().unwrap() > 100 && report["differences"][0].is_null(), "{report}");
}

#[test]
fn recover_overwrites_nothing_and_leaves_no_file_for_a_non_log() {
    let (folder, _) = recorded();
    let (code, report) = recover(&folder, "live.mcap", "fixed.mcap");
    assert_eq!((code, &report["losses"]), (Some(0), &Value::Array(Vec::new())), "{report}");
    assert_eq!(folder.digest("fixed.mcap", &[]), folder.digest("live.mcap", &[]));
    for (output, why) in [("dive.mcap", "exists"), ("live.mcap", "is read by this command")] {
        let answer = folder.headrace(&["recover", "live.mcap", "-o", output]);
        assert_eq!(answer.code, Some(2), "{}", answer.stderr);
        assert!(answer.stderr.contains(output) && answer.stderr.contains(why), "{}", answer.stderr);
    }
    let answer = folder.headrace(&["recover", "vehicle.toml", "-o", "none.mcap"]);
    assert_eq!(answer.code, Some(2));
    assert!(answer.stderr.contains("is not an MCAP file"), "{}", answer.stderr);
    assert!(!folder.path("none.mcap").exists());
}

#[test]
fn logs_cut_or_changed_anywhere_give_the_documented_exit_codes() {
    let (folder, whole) = recorded();
    let digest = folder.digest("live.mcap", &[]);
    let mut lost = 0;
    for case in 1..=40 {
        let mut bytes = whole.clone();
        if case % 2 == 0 {
            bytes.truncate(whole.len() * case / 41);
        } else {
            bytes[whole.len() * case / 41] ^= 1 << (case % 8);
        }
        folder.write("damaged.mcap", &bytes);
        let answer = folder.headrace(&["replay", "damaged.mcap", "--json"]);
        match answer.code {
            Some(0) => {
                let report: Value = serde_json::from_str(&answer.stdout).unwrap();
                assert_eq!(report["digest"], digest.as_str(), "case {case}");
            }
            Some(3) => {
                let report: Value = serde_json::from_str(&answer.stdout).unwrap();
                assert!(report["log"]["losses"][0].is_string(), "case {case}");
                lost += 1;
            }
            // Exit code 2 is right if the vehicle file in the log is damaged or cut off.
            Some(2) => assert!(answer.stderr.contains("no vehicle file"), "case {case}: {}", answer.stderr),
            code => panic!("case {case}: {code:?}: {}", answer.stderr),
        }
    }
    assert!(lost > 20, "{lost} of 40");
}

/// Records the short dive on a small disk of `kilobytes`, and then copies the log to another disk. Returns exit code,
/// report and stderr. Returns `None` if the small disk can't be created.
fn on_a_disk_of(folder: &Folder, kilobytes: u32) -> Option<(i32, Value, String)> {
    std::fs::create_dir_all(folder.path("disk")).unwrap();
    let program = headrace_tests::program();
    let program = program.get_program().to_str().unwrap();
    // The small disk is mounted for the shell only, and disappears when the shell ends.
    let script = format!(
        "mount -t tmpfs -o size={kilobytes}k none disk || exit 99
        '{program}' run vehicle.toml --source dive.mcap --record disk/log.mcap --speed max --json > report.json 2> said.txt
        code=$?; cp disk/log.mcap small.mcap; exit $code"
    );
    let output =
        Command::new("unshare").args(["-rm", "sh", "-c", &script]).current_dir(folder.path("")).output();
    let code = output.ok()?.status.code()?;
    let report = serde_json::from_slice(&std::fs::read(folder.path("report.json")).ok()?).ok()?;
    Some((code, report, String::from_utf8(folder.read("said.txt")).unwrap()))
}

#[test]
fn recording_drops_echoes_on_a_nearly_full_disk_and_ends_on_a_full_disk() {
    let folder = Folder::with_dive();
    let digest = folder.digest("dive.mcap", &[]);
    // The first disk in the list becomes nearly full, but has room for all small messages. The second disk has room for
    // only a few seconds of the dive.
    for (kilobytes, words) in [(20_000, "echo returns"), (80, "recording failed")] {
        let Some((code, report, said)) = on_a_disk_of(&folder, kilobytes) else {
            headrace_tests::skipped("unshare and mount are not allowed here");
            return;
        };
        assert_eq!((code, &report["digest"]), (3, &digest.as_str().into()), "the dive goes on: {said}");
        let losses = report["log"]["losses"].to_string();
        assert!(losses.contains(words), "{losses}");
        assert!(said.contains("MB left"), "a warning while the dive goes on: {said}");
        // The part of the dive that was recorded is readable, and the log states the loss.
        let (code, replayed) = folder.replay("small.mcap", &[]);
        let losses = replayed["log"]["losses"].to_string();
        assert!(code == Some(3) && losses.contains("echo returns out"), "{code:?}: {losses}");
        if kilobytes > 1000 {
            // These heads send only short messages, so the recorder keeps all raw data. It drops only the published
            // results of pings.
            assert_eq!(replayed["digest"], digest.as_str());
        }
    }
}
