//! A dive that is killed and resumed at random moments: one recording in many parts, with one report.
//!
//! `HEADRACE_RESTARTS` sets the number of restarts.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use headrace_tests::Folder;
use serde_json::Value;

use crate::rehearsal::{emulate, headrace, interrupt, report, scene};

/// Number of restarts, unless the environment sets another one.
const RESTARTS: u64 = 6;
/// Longest allowed time from the start of the program until the dive goes on. It is long, because the machine may be
/// busy.
const RESUMED_WITHIN: Duration = Duration::from_secs(30);

#[expect(clippy::disallowed_methods, reason = "how long a restart takes is wall time")]
fn wall_clock() -> Instant {
    Instant::now()
}

/// The pseudorandom number `n` of a fixed sequence.
fn random(n: u64) -> u64 {
    let word = (n + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    word ^ (word >> 27)
}

/// Starts the dive. As soon as the program's output shows that the dive has begun or goes on, returns the process and
/// the time that the start took.
fn start(folder: &Folder, vehicle: &str, (how, logs): (&str, &[&str])) -> (Child, Duration) {
    let begun = wall_clock();
    let mut run = headrace()
        .args(["run", vehicle, how, "--no-page", "--json-lines", "--report", "live.json", "--force"])
        .args(logs.iter().flat_map(|log| ["--record", log]))
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(run.stdout.take().unwrap()).lines().map_while(Result::ok);
    let wanted = if how == "--resume" { "\"resumed\"" } else { "\"state\"" };
    assert!(lines.any(|line| line.contains(wanted)), "{how}: the dive didn't begin");
    let took = begun.elapsed();
    std::thread::spawn(move || lines.count());
    (run, took)
}

/// Start chainages of the sections with the verdict `verdict`.
fn with_verdict(report: &Value, verdict: &str) -> BTreeSet<String> {
    let sections = report["sections"].as_array().unwrap().iter();
    let these = sections.filter(|section| section["verdict"] == verdict);
    these.map(|section| format!("{:9.3}", section["start_m"].as_f64().unwrap())).collect()
}

/// Kills and resumes a dive that is recorded to the logs `logs`. Checks that the dive's report equals the report of a
/// replay, and returns the folder.
fn killed_and_resumed(restarts: u64, logs: &[&str]) -> Folder {
    let folder = Folder::new();
    folder.write("scene.toml", scene(20.0 + restarts as f64));
    let (_emulate, _said, vehicle) = emulate(&folder, &folder.path("scene.toml"));
    let (mut run, _) = start(&folder, &vehicle, ("--new", logs));
    std::thread::sleep(Duration::from_secs(12));
    let (mut slowest, mut dead) = (Duration::ZERO, Duration::ZERO);
    for number in 0..restarts {
        std::thread::sleep(Duration::from_millis(500 + random(number) % 5000));
        let killed = wall_clock();
        run.kill().unwrap();
        run.wait().unwrap();
        std::thread::sleep(Duration::from_millis(random(number + 1000) % 1500));
        let (next, took) = start(&folder, &vehicle, ("--resume", logs));
        run = next;
        (slowest, dead) = (slowest.max(took), dead + killed.elapsed());
        assert!(took < RESUMED_WITHIN, "restart {number} took {took:?}");
    }
    std::thread::sleep(Duration::from_secs(8));
    interrupt(&run);
    let status = run.wait().unwrap();
    assert_eq!(status.code(), Some(3), "data of the gaps is lost");
    let live = report(&folder.path("live.json"));
    let losses = live["log"]["losses"].as_array().unwrap();
    // The report belongs to one recording, and lists every interruption of this recording. Of each other recording, it
    // lists only the last interruption.
    assert_eq!(
        losses.len() as u64 + 1,
        restarts + logs.len() as u64,
        "each interruption is a loss: {losses:#?}"
    );
    assert!(
        losses.iter().all(|loss| loss.as_str().unwrap().contains("the program was stopped")),
        "{losses:#?}"
    );
    assert_eq!(live["log"]["parts"].as_array().unwrap().len() as u64, restarts + 1);

    // A kill may leave one recording longer than the other. The report belongs to the longer recording.
    let recording = live["log"]["path"].as_str().unwrap();
    let answer = folder.headrace(&["replay", recording, "--report", "replayed.json"]);
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    let replayed = report(&folder.path("replayed.json"));
    for key in ["digest", "sections", "summary", "coverage_extent", "runs", "not_inspected"] {
        assert_eq!(live[key], replayed[key], "{key}");
    }
    for key in ["sha256", "messages", "parts"] {
        assert_eq!(live["log"][key], replayed["log"][key], "log.{key}");
    }
    for log in logs {
        let (code, report) = folder.replay(log, &[]);
        let losses = report["log"]["losses"].as_array().unwrap().len() as u64;
        assert_eq!((code, losses), (Some(3), restarts), "{log}");
    }
    let passed = with_verdict(&live, "pass").len();
    eprintln!(
        "{restarts} restarts: {passed} sections passed, {} failed, {} of {:.0} s without data, slowest restart {:.1} s",
        with_verdict(&live, "fail").len(),
        dead.as_secs(),
        live["dive"]["duration_s"].as_f64().unwrap_or(f64::NAN),
        slowest.as_secs_f64()
    );
    assert!(!folder.path("dive.mcap.state").exists(), "a dive that ended leaves no state behind");
    folder
}

#[ignore = "takes a minute or more at real speed; .ci/run runs it beside other tests"]
#[test]
fn dive_that_is_killed_many_times_is_one_dive_with_named_gaps() {
    let restarts = std::env::var("HEADRACE_RESTARTS").map_or(RESTARTS, |text| text.parse().unwrap());
    let folder = killed_and_resumed(restarts, &["dive.mcap"]);
    let verified = folder.headrace(&["verify", "dive.mcap"]);
    assert_eq!(verified.code, Some(3), "{}{}", verified.stdout, verified.stderr);
}

/// A kill may leave one recording longer than the other, and the dive then goes on from the longer one. Results of the
/// resumed dive may therefore differ from results of a replay of the shorter recording.
#[ignore = "takes a minute at real speed; .ci/run runs it beside other tests"]
#[test]
fn dive_with_two_recordings_goes_on_in_both() {
    killed_and_resumed(3, &["dive.mcap", "second.mcap"]);
}

#[ignore = "needs the time of .ci/run's rehearsal step"]
#[test]
fn run_refuses_to_begin_beside_an_unfinished_dive_without_resume_or_new() {
    let folder = Folder::new();
    folder.write("vehicle.toml", headrace_tests::VEHICLE);
    let run = |further: &[&str]| {
        let fixed = ["run", "vehicle.toml", "--no-page", "--for", "1", "--report", "report.json", "--force"];
        folder.headrace(&[&fixed[..], further].concat())
    };
    let mut first = headrace()
        .args(["run", "vehicle.toml", "--no-page", "--record", "first.mcap"])
        .current_dir(folder.path(""))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_secs(3));
    first.kill().unwrap();
    first.wait().unwrap();
    let offered = run(&["--record", "second.mcap"]);
    assert_eq!(offered.code, Some(2), "{}", offered.stdout);
    insta::assert_snapshot!(offered.stderr, @"headrace: run: the last dive, first.mcap, did not end in order; --resume continues it in a further part, --new begins another dive");
    assert!(!folder.path("second.mcap").exists());
    // No device sends data, so nothing is inspected and the exit code is 1.
    assert_eq!(run(&["--record", "second.mcap", "--new"]).code, Some(1));
    // The second dive ended in order, so there is nothing to resume. --resume therefore begins a new dive.
    assert_eq!(run(&["--record", "third.mcap", "--resume"]).code, Some(1));
    assert!(folder.path("third.mcap").exists());
    let named = run(&["--record", "fourth.mcap", "--resume=second.mcap"]);
    assert_eq!(named.code, Some(2));
    insta::assert_snapshot!(named.stderr, @"headrace: run --resume: second.mcap can't be continued: it ended in order, has no data, or another program is recording to it; begin another dive with --new");
    let absent = run(&["--record", "fourth.mcap", "--resume=absent.mcap"]);
    assert_eq!(absent.code, Some(2));
    insta::assert_snapshot!(absent.stderr, @"headrace: run --resume: absent.mcap can't be continued: there is no such file; begin another dive with --new");
}
