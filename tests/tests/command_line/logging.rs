//! Log messages go to stderr, are filtered by level and crate, and never mix with results.

use headrace_tests::{Answer, Folder, VEHICLE};
use serde_json::Value;

/// Runs the program with `RUST_LOG` set or unset.
fn headrace(folder: &Folder, rust_log: Option<&str>, arguments: &[&str]) -> Answer {
    let mut command = headrace_tests::program();
    command.args(arguments).current_dir(folder.path("")).env_remove("RUST_LOG");
    command.envs(rust_log.map(|value| ("RUST_LOG", value)));
    let output = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    Answer { code: output.status.code(), stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Probes an address without a listener. The crate of the program then logs that it reads the vehicle file, and the
/// crate `headrace_ports` logs the probe.
fn probe(folder: &Folder, rust_log: Option<&str>, flags: &[&str]) -> Answer {
    let devices = ["devices", "--vehicle", "vehicle.toml", "--address", "tcp:127.0.0.1:1", "--json"];
    headrace(folder, rust_log, &[flags, &devices].concat())
}

const VEHICLE_EVENT: &str = "INFO headrace::vehicle_file: vehicle file parsed";
const SENSOR_EVENT: &str = "DEBUG headrace::vehicle_file: sensor ";
const PROBE_EVENT: &str = "headrace_ports::probe: probing";

#[test]
fn events_of_all_crates_are_shown_with_verbose_but_not_by_default() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let quiet = probe(&folder, None, &[]);
    assert_eq!(quiet.stderr, "");
    let verbose = probe(&folder, None, &["-v"]);
    for event in [VEHICLE_EVENT, SENSOR_EVENT, PROBE_EVENT, "address=tcp:127.0.0.1:1"] {
        assert!(verbose.stderr.contains(event), "{event:?} is not in {}", verbose.stderr);
    }
    assert_eq!((verbose.code, verbose.stdout), (quiet.code, quiet.stdout.clone()));
    serde_json::from_str::<Value>(&quiet.stdout).unwrap();
}

#[test]
fn rust_log_variable_shows_only_the_named_crate() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let ports = probe(&folder, Some("headrace_ports=debug"), &[]);
    assert!(ports.stderr.contains(PROBE_EVENT), "{}", ports.stderr);
    assert!(!ports.stderr.contains(" headrace::"), "{}", ports.stderr);
    let ours = probe(&folder, Some("headrace::vehicle_file=info"), &[]);
    assert!(ours.stderr.contains(VEHICLE_EVENT) && !ours.stderr.contains(SENSOR_EVENT), "{}", ours.stderr);
    assert!(!ours.stderr.contains(PROBE_EVENT), "{}", ours.stderr);
}

#[test]
fn invalid_rust_log_variable_is_a_warning_hidden_by_quiet() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let warned = probe(&folder, Some("headrace=loud"), &[]);
    assert!(warned.stderr.contains("WARN") && warned.stderr.contains("RUST_LOG = \"headrace=loud\""));
    let quiet = probe(&folder, Some("headrace=loud"), &["--quiet"]);
    assert_eq!((quiet.stderr.as_str(), quiet.code), ("", warned.code));
}

#[test]
fn verbose_replay_logs_its_phases_and_leaves_the_report_unchanged() {
    let folder = Folder::with_dive();
    let silent = headrace(&folder, None, &["replay", "dive.mcap", "--json"]);
    assert_eq!(silent.stderr, "");
    let logged = headrace(&folder, None, &["replay", "dive.mcap", "--json", "-v"]);
    for event in [
        "headrace_replay::log::dive_log: log opened",
        "headrace::dive: loop armed sensors=9",
        "phase{name=\"replay\"}: headrace::phase: ended seconds=",
        "phase{name=\"report\"}: headrace::phase: ended seconds=",
    ] {
        assert!(logged.stderr.contains(event), "{event:?} is not in {}", logged.stderr);
    }
    assert!(!logged.stderr.contains(" TRACE "), "{}", logged.stderr);
    assert_eq!((logged.code, logged.stdout), (silent.code, silent.stdout));
    let traced = headrace(&folder, None, &["replay", "dive.mcap", "--json", "-vv"]);
    assert!(traced.stderr.contains("TRACE") && traced.stderr.contains("chunk read"), "{}", traced.stderr);
}

#[test]
fn verbose_run_logs_its_recording_and_verbose_replay_logs_damage() {
    let folder = Folder::with_dive();
    let run =
        ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "-v", "--record", "again.mcap"];
    let recorded = headrace(&folder, None, &run);
    let created = recorded.stderr.find("headrace_replay::log::storage: log created path=again.mcap");
    let finished = recorded.stderr.find("headrace_replay::log::worker: recording finished messages=");
    assert!(created.is_some() && created < finished, "{}", recorded.stderr);
    let whole = folder.read("again.mcap");
    folder.write("cut.mcap", &whole[..whole.len() / 2]);
    let cut = headrace(&folder, None, &["replay", "cut.mcap", "-v"]);
    assert!(cut.stderr.contains("headrace_replay::log::loss: log is damaged"), "{}", cut.stderr);
}
