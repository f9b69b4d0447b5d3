//! The same bytes in the same order give the same digest.
//!
//! The digest is the same live and in replay, for any tick length, at any replay speed, and with idle or busy cores.
//! (.ci/run compares debug and release builds.)

use std::sync::atomic::{AtomicBool, Ordering};

use headrace_tests::Folder;

const TICKS_MS: [&str; 6] = ["1", "5", "20", "100", "777", "60000"];

/// Runs `work` while `threads` threads keep the cores busy.
fn while_busy<T>(threads: usize, work: impl FnOnce() -> T) -> T {
    /// Ends the threads that keep the cores busy when this value is dropped, even if `work` panics.
    struct Stop<'a>(&'a AtomicBool);
    impl Drop for Stop<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _stop = Stop(&done);
        for _ in 0..threads {
            scope.spawn(|| {
                while !done.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        work()
    })
}

#[test]
fn live_dive_and_its_replay_have_the_same_digest() {
    let folder = Folder::new();
    let answer = folder.headrace(&["demo", "--speed", "max", "--out", "demo"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let live: serde_json::Value = serde_json::from_slice(&folder.read("demo/report.json")).unwrap();
    let (code, replayed) = folder.replay("demo/dive.mcap", &["--expect", "demo/report.json"]);
    assert_eq!(code, Some(0), "the replay differs from the live report");
    assert_eq!(live["digest"], replayed["digest"]);
    assert_eq!(live["log"]["sha256"], replayed["log"]["sha256"]);
    assert_eq!(live["log"]["messages"], replayed["log"]["messages"]);
    let missed = live["runs"].as_array().unwrap();
    assert!(
        missed.iter().any(|run| run["cleared_s"].is_number()),
        "the demonstration misses a stretch and clears it"
    );
}

/// The dive of this test has fails that become final, flags that later passes clear, and verdicts that depend on
/// earlier verdicts.
#[test]
fn tick_length_does_not_change_failed_and_cleared_sections() {
    let folder = Folder::new();
    let vehicle = include_str!("../../../deploy/vehicles/vita2-4.toml");
    folder.write("vehicle.toml", vehicle.replace("planned_speed_mps = 0.10", "planned_speed_mps = 0.197"));
    let leg = |distance_m: f64, speed_mps: f64| {
        format!("[[trajectory.legs]]\ndistance_m = {distance_m}\nspeed_mps = {speed_mps}\n")
    };
    let legs = leg(10.0, 0.197) + &leg(6.0, 0.35) + &leg(9.0, -0.3) + &leg(12.0, 0.197);
    folder.write("scene.toml", format!("vehicle = \"vehicle.toml\"\n[trajectory]\n{legs}"));
    assert_eq!(folder.headrace(&["simulate", "scene.toml", "-o", "dive.mcap"]).code, Some(0));
    let report = |ticks: &str| folder.replay("dive.mcap", &["--tick-ms", ticks]).1;
    let expected = report(TICKS_MS[0]);
    assert!(expected["summary"]["flags_cleared"].as_u64().unwrap() > 10, "{}", expected["summary"]);
    for ticks in &TICKS_MS[1..] {
        let got = report(ticks);
        assert_eq!(got["digest"], expected["digest"], "ticks of {ticks} ms");
        assert_eq!(got["sections"], expected["sections"], "ticks of {ticks} ms");
    }
}

#[test]
fn each_difference_from_the_expected_report_is_named() {
    let folder = Folder::with_dive();
    let (_, mut report) = folder.replay("dive.mcap", &["--report", "golden.json"]);
    assert_eq!(folder.replay("dive.mcap", &["--expect", "golden.json"]).0, Some(0));

    // A different file name of the log is the only difference that is allowed. Any change of a hole's diameter counts
    // as a difference.
    report["log"]["path"] = "elsewhere.mcap".into();
    folder.write("golden.json", report.to_string());
    assert_eq!(folder.replay("dive.mcap", &["--expect", "golden.json"]).0, Some(0));
    let hole_m = report["sections"][3]["hole_m"].as_f64().unwrap();
    report["sections"][3]["hole_m"] = hole_m.next_up().into();
    report["digest"] = "0123456789abcdef".into();
    folder.write("golden.json", report.to_string());
    let answer = folder.headrace(&["replay", "dive.mcap", "--expect", "golden.json"]);
    assert_eq!(answer.code, Some(1));
    let places: Vec<_> = answer.stderr.lines().map(|line| line.split_whitespace().nth(1).unwrap()).collect();
    let of = |key: &str| report["sections"][3][key].as_f64().unwrap();
    let section = format!("/sections/3[{}..{}m]/hole_m:", of("start_m"), of("end_m"));
    assert_eq!(places, ["/digest:", &section]);
}

/// A value may differ from the golden report only within a tolerance that the golden report states for it.
#[test]
fn golden_report_may_state_tolerances() {
    let folder = Folder::with_dive();
    let (_, report) = folder.replay("dive.mcap", &[]);
    let meets = |tolerances: serde_json::Value, change: &dyn Fn(&mut serde_json::Value)| {
        let mut golden = report.clone();
        change(&mut golden);
        golden["tolerances"] = tolerances;
        folder.write("golden.json", golden.to_string());
        folder.headrace(&["replay", "dive.mcap", "--expect", "golden.json"]).code.unwrap()
    };
    let hole_m = report["sections"][3]["hole_m"].as_f64().unwrap();
    let other = |golden: &mut serde_json::Value| {
        golden["sections"][3]["hole_m"] = (hole_m + 0.004).into();
        golden["digest"] = "0123456789abcdef".into();
    };
    let same = |_: &mut serde_json::Value| {};
    assert_eq!(meets(serde_json::json!({}), &same), 0);
    assert_eq!(meets(serde_json::json!({}), &other), 1);
    assert_eq!(meets(serde_json::json!({"/sections/*/hole_m": 0.005}), &other), 1, "the digest isn't stated");
    assert_eq!(meets(serde_json::json!({"/sections/*/hole_m": 0.005, "/digest": "any"}), &other), 0);
    assert_eq!(
        meets(serde_json::json!({"/sections/*/hole_m": 0.003, "/digest": "any"}), &other),
        1,
        "too far apart"
    );
    assert_eq!(meets(serde_json::json!({"/sections/3/hole_m": 0.005, "/digest": "any"}), &other), 0);
    assert_eq!(
        meets(serde_json::json!({"/sections/4/hole_m": 0.005, "/digest": "any"}), &other),
        1,
        "another section"
    );
    assert_eq!(meets(serde_json::json!({"/sections": "any", "/digest": "any"}), &other), 0);
    assert_eq!(meets(serde_json::json!({"/sections": -1}), &same), 2);
    let answer = folder.headrace(&["replay", "dive.mcap", "--expect", "golden.json"]);
    assert!(answer.stderr.contains("tolerances of \"/sections\" is -1"), "{}", answer.stderr);
    // A renewed golden report keeps its tolerances.
    meets(serde_json::json!({"/digest": "any"}), &other);
    folder.replay("dive.mcap", &["--expect", "golden.json", "--bless"]);
    let golden: serde_json::Value = serde_json::from_slice(&folder.read("golden.json")).unwrap();
    assert_eq!((&golden["digest"], &golden["tolerances"]["/digest"]), (&report["digest"], &"any".into()));
}

#[test]
fn renewing_a_golden_report_prints_the_changes() {
    let folder = Folder::with_dive();
    let bless = |further: &[&str]| {
        let arguments = ["replay", "dive.mcap", "--expect", "golden.json", "--bless"];
        let answer = folder.headrace(&[&arguments[..], further].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        answer.stderr
    };
    assert!(bless(&[]).contains("new golden report"));
    assert!(bless(&[]).contains("unchanged"));
    assert_eq!(folder.replay("dive.mcap", &["--expect", "golden.json"]).0, Some(0));
    assert_eq!(folder.replay("dive.mcap", &["--expect", "golden.json", "--target", "0.4"]).0, Some(1));
    assert!(bless(&["--target", "0.4"]).contains("/target_m: 0.4, expected 1.2"));
    assert_eq!(folder.replay("dive.mcap", &["--expect", "golden.json", "--target", "0.4"]).0, Some(0));
    let golden: serde_json::Value = serde_json::from_slice(&folder.read("golden.json")).unwrap();
    assert!(golden["log"].is_null() && golden["target_m"] == 0.4, "the report names a file of this machine");
    let answer = folder.headrace(&["replay", "dive.mcap", "--bless"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
}

#[test]
fn dive_recorded_again_has_the_same_digest() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    for (speed, again) in [("max", "max.mcap"), ("40x", "40x.mcap")] {
        let arguments = ["--source", "dive.mcap", "--record", again, "--speed", speed, "--json"];
        let answer = folder.headrace(&[&["run", "vehicle.toml"], &arguments[..]].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        let live: serde_json::Value = serde_json::from_str(&answer.stdout).unwrap();
        assert_eq!(live["digest"], expected, "live, {speed}");
        assert_eq!(folder.digest(again, &[]), expected, "recorded, {speed}");
    }
}

#[test]
fn simulation_of_a_scene_is_repeatable() {
    let folder = Folder::with_dive();
    folder.simulate("scene.toml", "again.mcap");
    assert!(folder.read("dive.mcap") == folder.read("again.mcap"), "two logs of one scene differ");
}

#[test]
fn tick_length_does_not_change_the_report() {
    let folder = Folder::with_dive();
    let (_, expected) = folder.replay("dive.mcap", &[]);
    for tick in TICKS_MS {
        let (code, report) = folder.replay("dive.mcap", &["--tick-ms", tick]);
        assert_eq!(code, Some(0));
        assert_eq!(report, expected, "ticks of {tick} ms");
    }
}

#[test]
fn replay_speed_does_not_change_the_result() {
    let folder = Folder::with_dive();
    assert_eq!(folder.digest("dive.mcap", &["--speed", "20x"]), folder.digest("dive.mcap", &[]));
}

#[test]
fn repeated_replays_give_the_same_digest() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    for repetition in 0..20 {
        let tick = TICKS_MS[repetition % 4];
        assert_eq!(folder.digest("dive.mcap", &["--tick-ms", tick]), expected, "{repetition}");
    }
}

#[test]
fn busy_cores_do_not_change_the_digest() {
    let folder = Folder::with_dive();
    let expected = folder.digest("dive.mcap", &[]);
    let cores = std::thread::available_parallelism().map_or(2, usize::from);
    while_busy(cores.clamp(2, 8), || {
        for tick in TICKS_MS {
            assert_eq!(folder.digest("dive.mcap", &["--tick-ms", tick]), expected, "ticks of {tick} ms");
        }
        let arguments =
            ["run", "vehicle.toml", "--source", "dive.mcap", "--record", "busy.mcap", "--speed", "20x"];
        let answer = folder.headrace(&arguments);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        assert_eq!(folder.digest("busy.mcap", &[]), expected, "recorded");
    });
}
