//! Disks that fail during a recording, and closed terminals. Each fault is reported.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use headrace_tests::{Folder, skipped};
use serde_json::Value;

const DIVE: [&str; 4] = ["run", "vehicle.toml", "--source", "dive.mcap"];

/// Runs the program in a folder under another program, such as strace.
fn below(folder: &Folder, command: &[&str], arguments: &[&str]) -> Command {
    let [above, options @ ..] = command else { panic!("no command") };
    let mut below = Command::new(above);
    below.args(options).arg(headrace_tests::program().get_program()).args(DIVE).args(arguments);
    below.current_dir(folder.path(""));
    below
}

/// Whether strace is available. The program strace can make chosen system calls of a process fail.
fn has_strace() -> bool {
    let can = Command::new("strace").args(["-o", "/dev/null", "true"]).output();
    let can = can.is_ok_and(|output| output.status.success());
    if !can {
        skipped("strace isn't there, or not allowed");
    }
    can
}

/// Records a dive while strace injects the fault `fault` into system calls. The dive is long enough for several syncs.
/// Returns exit code and report of the dive.
fn with_fault(folder: &Folder, fault: &[&str], records: &[&str]) -> (Option<i32>, Value) {
    let strace = [&["strace", "-f", "-qq", "-o", "trace.txt"][..], fault].concat();
    let records: Vec<&str> = records.iter().flat_map(|record| ["--record", record]).collect();
    let output =
        below(folder, &strace, &[&records[..], &["--speed", "10x", "--json"]].concat()).output().unwrap();
    let report = serde_json::from_slice(&output.stdout);
    (output.status.code(), report.unwrap_or_else(|error| panic!("{error}: {output:?}")))
}

fn losses(report: &Value) -> String {
    report["log"]["losses"].to_string()
}

/// Checks that `replay`, `verify` and `recover` each report a damaged log with exit code 3.
#[track_caller]
fn all_find_it(folder: &Folder, log: &str, words: &str) {
    let (code, report) = folder.replay(log, &[]);
    assert!(code == Some(3) && losses(&report).contains(words), "{code:?}: {}", losses(&report));
    assert_eq!(folder.headrace(&["verify", log]).code, Some(3));
    let recovered = folder.headrace(&["recover", log, "-o", "recovered.mcap"]);
    assert!(recovered.code == Some(3) && recovered.stdout.contains(words), "{}", recovered.stdout);
    assert!(!recovered.stdout.contains("nothing is missing"), "{}", recovered.stdout);
}

#[test]
fn single_failed_sync_is_reported_and_loses_nothing() {
    let folder = Folder::with_dive();
    if !has_strace() {
        return;
    }
    let digest = folder.digest("dive.mcap", &[]);
    let fault = ["-e", "trace=fdatasync", "-e", "inject=fdatasync:error=EIO:when=2"];
    let (code, report) = with_fault(&folder, &fault, &["log.mcap"]);
    let losses_text = losses(&report);
    assert!(
        code == Some(3) && losses_text.contains("Input/output error") && losses_text.contains("no message"),
        "{losses_text}"
    );
    assert!(folder.path("log.part002.mcap").exists());
    all_find_it(&folder, "log.mcap", "recording failed in log.mcap");
    // If the recording's name is given, both parts are replayed and give the same dive as the original log.
    assert_eq!(folder.replay("log.mcap", &[]).1["digest"], digest.as_str());
    assert_eq!(folder.replay("recovered.mcap", &[]).1["digest"], digest.as_str());
}

#[test]
fn failed_recording_is_reported_live_and_until_the_end() {
    let folder = Folder::with_dive();
    if !has_strace() {
        return;
    }
    let strace = ["strace", "-f", "-qq", "-o", "trace.txt", "-e", "trace=fdatasync"];
    let strace = [&strace[..], &["-e", "inject=fdatasync:error=EIO:when=2"]].concat();
    // The dive takes four seconds, so that the second sync ends before the dive does, even on a loaded machine.
    let arguments = ["--record", "log.mcap", "--speed", "5x", "--json-lines"];
    let output = below(&folder, &strace, &arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let lines = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |kind: &str| lines.iter().filter(|line| line["type"] == kind).collect::<Vec<_>>();
    let recording_lines = of("recording");
    assert_eq!(
        recording_lines.iter().map(|line| line["fails"].as_bool().unwrap()).collect::<Vec<_>>(),
        [true, false]
    );
    assert!(
        recording_lines[0]["text"].as_str().unwrap().contains("Input/output error"),
        "{}",
        recording_lines[0]
    );
    assert!(
        recording_lines[1]["text"].as_str().unwrap().contains("no message is missing"),
        "{}",
        recording_lines[1]
    );
    let states = of("state");
    let (first, last) = (states[0], states[states.len() - 1]);
    assert_eq!((&first["recording_fails"], &last["recording_fails"]), (&Value::Null, &Value::Bool(false)));
    assert!(last["text"].as_str().unwrap().contains("recording had failed"), "{}", last["text"]);
    let schema: Value =
        serde_json::from_str(include_str!("../../../docs/reference/live-state.schema.json")).unwrap();
    for line in &lines {
        let faults = headrace_tests::json_schema::faults(&schema, line);
        assert!(faults.is_empty(), "{line:#}: {faults:#?}");
    }
}

#[test]
fn failing_syncs_leave_a_truncated_log() {
    let folder = Folder::with_dive();
    if !has_strace() {
        return;
    }
    let fault = ["-e", "trace=fdatasync", "-e", "inject=fdatasync:error=EIO:when=2+"];
    let (code, report) = with_fault(&folder, &fault, &["log.mcap"]);
    assert!(code == Some(3) && losses(&report).contains("messages are missing"), "{}", losses(&report));
    assert!(!folder.path("log.part002.mcap").exists(), "nothing in it is certain");
    all_find_it(&folder, "log.mcap", "the file ends before its closing records");
}

#[test]
fn failure_of_one_recording_does_not_affect_the_other() {
    let folder = Folder::with_dive();
    if !has_strace() {
        return;
    }
    let digest = folder.digest("dive.mcap", &[]);
    let stick = folder.path("stick.mcap");
    let stick = stick.to_str().unwrap();
    let fault = ["-P", stick, "-e", "trace=fdatasync", "-e", "inject=fdatasync:error=EIO:when=2+"];
    for (records, other) in [(["log.mcap", stick], "log.mcap"), ([stick, "second.mcap"], "second.mcap")] {
        let (code, report) = with_fault(&folder, &fault, &records);
        let losses_text = losses(&report);
        assert!(code == Some(3) && losses_text.contains("stick.mcap: recording failed"), "{losses_text}");
        assert_eq!(folder.digest(other, &[]), digest, "nothing is missing there");
        assert!(!losses_text.contains(&format!("{other}:")), "{losses_text}");
        for file in ["stick.mcap", "stick.part002.mcap"] {
            std::fs::remove_file(folder.path(file)).unwrap();
        }
    }
    let twice = folder.headrace(&[&DIVE[..], &["--record", "a.mcap", "--record", "a.mcap"]].concat());
    assert!(twice.code == Some(2) && twice.stderr.contains("given twice"), "{}", twice.stderr);
}

/// A file size limit that splits the log of the dive into several parts; `None` if the limit can't be set.
fn limit(folder: &Folder) -> Option<String> {
    folder.record("dive.mcap", "whole.mcap", &[]);
    let bytes = std::fs::metadata(folder.path("whole.mcap")).unwrap().len();
    let can = Command::new("prlimit").args(["--fsize=1000000", "true"]).output();
    if !can.is_ok_and(|output| output.status.success()) {
        skipped("prlimit isn't there, or not allowed");
        return None;
    }
    Some(format!("--fsize={}", bytes * 2 / 3))
}

#[test]
fn file_size_limit_starts_another_part() {
    let folder = Folder::with_dive();
    let Some(limit) = limit(&folder) else { return };
    let mut dive =
        below(&folder, &["prlimit", &limit], &["--record", "log.mcap", "--speed", "20x", "--json"]);
    let output = dive.output().unwrap();
    assert_eq!(output.status.code(), Some(3), "SIGXFSZ killed the program: {output:?}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(losses(&report).contains("File too large"), "{}", losses(&report));
    all_find_it(&folder, "log.mcap", "File too large");
    let digest = folder.digest("dive.mcap", &[]);
    assert_eq!(folder.replay("log.mcap", &[]).1["digest"], digest.as_str());
}

/// Waits for a process that must end by itself, and returns its exit code.
#[track_caller]
fn ended(mut child: Child) -> Option<i32> {
    for _ in 0..1200 {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    child.kill().unwrap();
    panic!("the process doesn't end")
}

#[test]
fn unread_stderr_does_not_block_a_failing_recording() {
    let folder = Folder::with_dive();
    let Some(limit) = limit(&folder) else { return };
    let (reader, mut stderr) = std::io::pipe().unwrap();
    // The pipe for stderr is full from the start.
    stderr.write_all(&vec![b'.'; 1 << 16]).unwrap();
    let arguments = ["-vv", "--record", "log.mcap", "--speed", "max", "--report", "report.json"];
    let mut dive = below(&folder, &["prlimit", &limit], &arguments);
    let dive = dive.stdout(Stdio::null()).stderr(stderr).spawn().unwrap();
    assert_eq!(ended(dive), Some(3));
    drop(reader);
    let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
    assert!(losses(&report).contains("File too large"), "{}", losses(&report));
}

/// Waits until a dive has written to a file. An empty file doesn't count, because the program creates one to test the
/// folder.
fn wait_for(path: &Path, dive: &mut Child) {
    wait_for_more(path, 0, dive);
}

/// Waits until a file grows beyond `than` bytes; returns the file's new length.
fn wait_for_more(path: &Path, than: u64, dive: &mut Child) -> u64 {
    loop {
        let len = std::fs::metadata(path).map_or(0, |file| file.len());
        if len > than {
            return len;
        }
        assert!(dive.try_wait().unwrap().is_none(), "the dive has ended without {}", path.display());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Returns the number of missing messages that the text about a recording states.
#[track_caller]
fn missing_messages(text: &str) -> u64 {
    let number = text.split_once(" message").and_then(|(before, _)| before.rsplit(' ').next());
    match number {
        Some("no") => 0,
        Some(number) => number.parse().unwrap_or_else(|error| panic!("{error}: {text}")),
        None => panic!("no number of messages: {text}"),
    }
}

#[test]
fn removed_medium_loses_the_log_but_not_the_report() {
    let folder = Folder::with_dive();
    let digest = folder.digest("dive.mcap", &[]);
    std::fs::create_dir(folder.path("stick")).unwrap();
    let mut dive = headrace_tests::program();
    let arguments = ["--record", "stick/log.mcap", "--report", "report.json", "--speed", "10x"];
    let dive = dive.args(DIVE).args(arguments).current_dir(folder.path(""));
    let mut dive = dive.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(&folder.path("stick/log.mcap"), &mut dive);
    std::fs::remove_dir_all(folder.path("stick")).unwrap();
    let output = dive.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(3));
    let summary = String::from_utf8(output.stdout).unwrap();
    assert!(summary.contains(" samples, target ") && summary.contains("LOST"), "{summary}");
    let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
    assert_eq!(report["digest"], digest.as_str());
    assert!(losses(&report).contains("stick/log.mcap"), "{}", losses(&report));
}

#[test]
fn unwritable_report_still_prints_the_summary() {
    let folder = Folder::with_dive();
    std::fs::create_dir(folder.path("stick")).unwrap();
    let mut dive = headrace_tests::program();
    let arguments = ["--record", "log.mcap", "--report", "stick/report.json", "--speed", "10x"];
    let dive = dive.args(DIVE).args(arguments).current_dir(folder.path(""));
    let mut dive = dive.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    wait_for(&folder.path("log.mcap"), &mut dive);
    std::fs::remove_dir_all(folder.path("stick")).unwrap();
    let output = dive.wait_with_output().unwrap();
    let (summary, said) = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap()).into();
    assert!(output.status.code() == Some(1) && said.contains("stick/report.json"), "{said}");
    assert!(summary.contains(" samples, target "), "{summary}");
}

fn signal(name: &str, dive: &Child) {
    let done = Command::new("kill").args(["-s", name, &dive.id().to_string()]).status().unwrap();
    assert!(done.success(), "{name}");
}

#[test]
fn live_dive_without_its_terminal_goes_on_until_a_signal() {
    let folder = Folder::with_dive();
    for (end, arguments) in [("TERM", ["--json-lines"]), ("INT", ["--json"])] {
        let mut dive = headrace_tests::program();
        let recorded = ["run", "vehicle.toml", "--record", "log.mcap", "--report", "report.json", "--force"];
        let dive = dive.args(recorded).args(arguments).current_dir(folder.path(""));
        let mut dive = dive.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut lines = BufReader::new(dive.stdout.take().unwrap()).lines();
        if end == "TERM" {
            // The program installs its signal handlers before it prints the first line.
            lines.next().unwrap().unwrap();
        } else {
            // The first write to the log contains only the header, so the test also waits until later writes have made
            // the file longer.
            wait_for(&folder.path("log.mcap"), &mut dive);
            std::thread::sleep(Duration::from_secs(1));
        }
        for name in ["HUP", "USR1", "USR2", "XFSZ", "XCPU", "ALRM", "TSTP"] {
            signal(name, &dive);
            assert!(dive.try_wait().unwrap().is_none(), "{name} has ended the dive");
        }
        signal(end, &dive);
        // From here on, nobody reads the output, as if the terminal had been closed.
        drop(lines);
        // Exit code 1: nothing was inspected.
        assert_eq!(ended(dive), Some(1), "{end}");
        let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
        assert_eq!(losses(&report), "[]");
        std::fs::remove_file(folder.path("log.mcap")).unwrap();
    }
}

/// Another program removes the recording during the dive. The loss is reported at once, and a new part begins. The
/// removed data is lost.
#[cfg(target_os = "linux")]
#[test]
fn removed_recording_is_reported_and_continues_in_a_new_part() {
    let folder = Folder::with_dive();
    let (log, other) = (folder.path("log.mcap"), folder.path("other.mcap"));
    let digest = folder.digest("dive.mcap", &[]);
    let cases: [(&str, &dyn Fn()); 4] = [
        ("deleted the file", &|| std::fs::remove_file(&log).unwrap()),
        ("cut the file short", &|| drop(std::fs::File::create(&log).unwrap())),
        ("another file in its place", &|| {
            std::fs::rename(&log, folder.path("aside.mcap")).unwrap();
            folder.write("log.mcap", "another's");
        }),
        ("deleted the file", &|| {
            std::fs::copy(folder.path("dive.mcap"), &other).unwrap();
            std::fs::rename(&other, &log).unwrap();
        }),
    ];
    for (words, take) in cases {
        let mut dive = headrace_tests::program();
        // The dive takes seven seconds, so that it reports the next part before its end even if each sync takes a second.
        let arguments = ["--record", "log.mcap", "--report", "report.json", "--speed", "3x", "--json-lines"];
        let dive = dive.args(DIVE).args(arguments).current_dir(folder.path(""));
        let mut dive = dive.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        // The file grows at each write, twice a second. After four writes, it contains data of the dive.
        (0..4).fold(0, |len, _| wait_for_more(&log, len, &mut dive));
        take();
        let output = dive.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(3), "{words}");
        let lines = String::from_utf8(output.stdout).unwrap();
        let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        let recording_lines: Vec<_> = lines.iter().filter(|line| line["type"] == "recording").collect();
        assert_eq!(
            recording_lines.iter().map(|line| line["fails"].as_bool().unwrap()).collect::<Vec<_>>(),
            [true, false]
        );
        assert!(
            recording_lines[0]["text"].as_str().unwrap().contains(words),
            "{words}: {}",
            recording_lines[0]
        );
        let missing = missing_messages(recording_lines[1]["text"].as_str().unwrap());
        let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
        assert_eq!(report["digest"], digest.as_str());
        assert!(losses(&report).contains(words), "{words}: {}", losses(&report));
        // The second part of the recording has the rest of the data, and states that data before it was lost.
        let (code, rest) = folder.replay("log.part002.mcap", &[]);
        assert!(code == Some(3) && losses(&rest).contains(words), "{code:?}: {}", losses(&rest));
        // Each message of the dive is in the second part or counted as missing. On a disk with slow syncs, all may still
        // be in memory when the file is removed.
        let (kept, of) =
            (rest["log"]["messages"].as_u64().unwrap(), report["log"]["messages"].as_u64().unwrap());
        assert!(kept > 1000 && kept + missing >= of, "{kept} and {missing} of {of}");
        for file in ["log.mcap", "log.part002.mcap", "aside.mcap"] {
            std::fs::remove_file(folder.path(file)).ok();
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn moved_recording_is_complete() {
    let folder = Folder::with_dive();
    let digest = folder.digest("dive.mcap", &[]);
    let mut dive = headrace_tests::program();
    let dive = dive.args(DIVE).args(["--record", "log.mcap", "--speed", "10x"]).current_dir(folder.path(""));
    let mut dive = dive.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    wait_for(&folder.path("log.mcap"), &mut dive);
    std::fs::rename(folder.path("log.mcap"), folder.path("moved.mcap")).unwrap();
    // The file was moved, so the recorder doesn't find it under its old name. The report counts this as a loss.
    assert_eq!(dive.wait_with_output().unwrap().status.code(), Some(3));
    assert!(!folder.path("log.part002.mcap").exists());
    assert_eq!(folder.digest("moved.mcap", &[]), digest);
}
