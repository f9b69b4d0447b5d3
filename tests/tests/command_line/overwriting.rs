//! What is there already isn't overwritten unasked, and outputs are tried before the work begins.

use headrace_tests::{Folder, VEHICLE, root};

/// A command that must refuse to write over a file, which stays as it is; and which does with `--force`, if it may.
#[track_caller]
fn refuses(folder: &Folder, command: &[&str], there: &str) {
    let before = folder.read(there);
    let answer = folder.headrace(command);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{command:?}: {}", answer.stderr);
    assert!(answer.stderr.contains(there) && answer.stderr.contains("--force"), "{}", answer.stderr);
    assert_eq!(folder.read(there), before, "{command:?}");
}

#[track_caller]
fn accepts(folder: &Folder, command: &[&str], there: &str) {
    let answer = folder.headrace(command);
    assert!(matches!(answer.code, Some(0 | 1)), "{command:?}: {:?} {}", answer.code, answer.stderr);
    assert!(folder.path(there).exists(), "{command:?}");
}

#[test]
fn a_simulation_overwrites_simulations_only() {
    let folder = Folder::with_dive();
    let simulate = ["simulate", "scene.toml", "-o"];
    let to = |log: &'static str| [&simulate[..], &[log]].concat();
    accepts(&folder, &to("dive.mcap"), "dive.mcap");
    folder.record("dive.mcap", "live.mcap", &[]);
    refuses(&folder, &to("live.mcap"), "live.mcap");
    refuses(&folder, &to("vehicle.toml"), "vehicle.toml");
    refuses(&folder, &[&to("new.mcap")[..], &["--truth", "vehicle.toml"]].concat(), "vehicle.toml");
    assert!(!folder.path("new.mcap").exists());
    accepts(&folder, &[&to("live.mcap")[..], &["--force"]].concat(), "live.mcap");
    for _ in 0..2 {
        accepts(&folder, &[&to("new.mcap")[..], &["--truth", "truth.csv"]].concat(), "truth.csv");
    }
}

#[test]
fn a_report_overwrites_reports_only() {
    let folder = Folder::with_dive();
    let replay = ["replay", "dive.mcap", "--report"];
    let to = |report: &'static str| [&replay[..], &[report]].concat();
    for _ in 0..2 {
        accepts(&folder, &to("report.json"), "report.json");
    }
    folder.write("other.json", "{\"version\": 1}");
    folder.record("dive.mcap", "live.mcap", &[]);
    for there in ["vehicle.toml", "other.json", "live.mcap"] {
        refuses(&folder, &to(there), there);
        refuses(
            &folder,
            &["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--report", there],
            there,
        );
    }
    refuses(&folder, &["replay", "dive.mcap", "--expect", "other.json", "--bless"], "other.json");
    accepts(&folder, &[&to("other.json")[..], &["--force"]].concat(), "other.json");
    assert!(folder.read("other.json").starts_with(b"{\n  \"report_version\":"));
    // Not even then.
    let before = folder.read("dive.mcap");
    let answer = folder.headrace(&[&to("dive.mcap")[..], &["--force"]].concat());
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert_eq!(folder.read("dive.mcap"), before);
}

#[test]
fn recordings_and_what_is_made_of_them_overwrite_no_other_log() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    folder.record("dive.mcap", "live_2.mcap", &[]);
    let record = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--record"];
    for there in ["live.mcap", "dive.mcap", "vehicle.toml"] {
        refuses(&folder, &[&record[..], &[there]].concat(), there);
    }
    let trim = ["trim", "live.mcap", "--to", "5s", "-o"];
    refuses(&folder, &[&trim[..], &["live_2.mcap"]].concat(), "live_2.mcap");
    let recover = ["recover", "live.mcap", "-o"];
    refuses(&folder, &[&recover[..], &["live_2.mcap"]].concat(), "live_2.mcap");
    for _ in 0..2 {
        accepts(&folder, &[&trim[..], &["part.mcap"]].concat(), "part.mcap");
        accepts(&folder, &[&recover[..], &["whole.mcap"]].concat(), "whole.mcap");
    }
    accepts(&folder, &[&trim[..], &["live_2.mcap", "--force"]].concat(), "live_2.mcap");
    accepts(&folder, &[&record[..], &["live_2.mcap", "--force"]].concat(), "live_2.mcap");
    let answer = folder.headrace(&[&recover[..], &["live.mcap", "--force"]].concat());
    assert_eq!(answer.code, Some(2), "an input is no output: {}", answer.stderr);
}

#[test]
fn imports_rehearsals_and_pictures_overwrite_their_own_only() {
    let folder = Folder::with_dive();
    folder.write("candump.log", "(1700000000.000000) can0 020#0001\n(1700000000.010000) can0 020#0002\n");
    let import = ["import", "candump.log", "--source", "imu=can0", "--vehicle", "vehicle.toml", "-o"];
    refuses(&folder, &[&import[..], &["dive.mcap"]].concat(), "dive.mcap");
    for _ in 0..2 {
        accepts(&folder, &[&import[..], &["imported.mcap"]].concat(), "imported.mcap");
    }
    refuses(&folder, &["emulate", "scene.toml", "--out", "."], "vehicle.toml");
    std::fs::create_dir(folder.path("pictures")).unwrap();
    folder.write("pictures/hours.svg", "<svg/>");
    let file = root().join("deploy/vehicles/vita1.toml");
    let plan = ["plan", "--vehicle", file.to_str().unwrap(), "--svg", "pictures"];
    refuses(&folder, &plan, "pictures/hours.svg");
    std::fs::remove_file(folder.path("pictures/hours.svg")).unwrap();
    for _ in 0..2 {
        accepts(&folder, &plan, "pictures/hours.svg");
    }
}

#[test]
fn a_demonstration_leaves_a_folder_with_another_dive_alone() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    std::fs::rename(folder.path("live.mcap"), folder.path("dive.mcap")).unwrap();
    refuses(&folder, &["demo", "--speed", "max", "--out", "."], "dive.mcap");
}

#[test]
fn outputs_are_tried_before_the_work() {
    let folder = Folder::with_dive();
    folder.write("file", "");
    for wrong in ["missing/report.json", "file/report.json", "."] {
        for command in [
            &["replay", "dive.mcap", "--report", wrong][..],
            &["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--report", wrong],
            &["run", "vehicle.toml", "--report", wrong],
            &["run", "vehicle.toml", "--record", wrong],
            &["replay", "dive.mcap", "--expect", wrong, "--bless"],
            &["simulate", "scene.toml", "-o", wrong],
            &["trim", "dive.mcap", "--chainage", "3..4", "-o", wrong],
            &["recover", "dive.mcap", "-o", wrong],
        ] {
            let answer = folder.headrace(command);
            // Nothing on stdout: no dive was shown, and nothing was done.
            assert_eq!(
                (answer.code, answer.stdout.as_str()),
                (Some(2), ""),
                "{command:?}: {}",
                answer.stderr
            );
            assert!(answer.stderr.contains(wrong), "{command:?}: {}", answer.stderr);
        }
    }
    assert_eq!(folder.read("vehicle.toml"), VEHICLE.as_bytes());
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_never_removed_to_make_way() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("out")).unwrap();
    let link = folder.path("out/dive.mcap");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    for force in [&["--force"][..], &[]] {
        let arguments = [&["demo", "--speed", "max", "--out", "out"], force].concat();
        let answer = folder.headrace(&arguments);
        assert_ne!(answer.code, Some(0), "{}", answer.stderr);
        assert!(link.symlink_metadata().unwrap().is_symlink(), "{force:?}: it is gone");
    }
}
