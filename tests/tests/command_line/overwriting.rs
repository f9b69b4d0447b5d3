//! Existing files are only overwritten with `--force`. Outputs are checked before the work begins.

use std::collections::BTreeMap;
use std::ffi::OsString;

use headrace_tests::{Folder, SCENE, VEHICLE, program, root, skipped};

/// Checks that a command refuses to overwrite the file `there` and leaves it unchanged.
#[track_caller]
fn refuses(folder: &Folder, command: &[&str], there: &str) {
    let before = folder.read(there);
    let answer = folder.headrace(command);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{command:?}: {}", answer.stderr);
    assert!(answer.stderr.contains(there) && answer.stderr.contains("--force"), "{}", answer.stderr);
    assert_eq!(folder.read(there), before, "{command:?}");
}

/// Checks that a command refuses to overwrite its own input, even with `--force`. The folder stays unchanged.
#[track_caller]
fn never(folder: &Folder, command: &[&str]) {
    let before = content(folder);
    for further in [&[][..], &["--force"]] {
        let command = [command, further].concat();
        let answer = folder.headrace(&command);
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{command:?}: {}", answer.stderr);
        assert!(answer.stderr.contains("it is read by this command"), "{command:?}: {}", answer.stderr);
        assert!(content(folder) == before, "{command:?}: the folder's files have changed");
    }
}

/// Checks that a command refuses to write two outputs to one file. The message names both outputs, and the folder
/// stays unchanged.
#[track_caller]
fn two_files(folder: &Folder, command: &[&str], named: &[&str]) {
    let before = content(folder);
    let command = [command, &["--force"]].concat();
    let answer = folder.headrace(&command);
    assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{command:?}: {}", answer.stderr);
    for name in named {
        assert!(answer.stderr.contains(name), "{command:?}: no {name:?} in {}", answer.stderr);
    }
    assert!(content(folder) == before, "{command:?}: the folder's files have changed");
}

/// Names and content of the files in a folder.
fn content(folder: &Folder) -> BTreeMap<OsString, Option<Vec<u8>>> {
    let entries = std::fs::read_dir(folder.path("")).unwrap().map(|entry| entry.unwrap());
    entries.map(|entry| (entry.file_name(), std::fs::read(entry.path()).ok())).collect()
}

#[track_caller]
fn accepts(folder: &Folder, command: &[&str], there: &str) {
    let answer = folder.headrace(command);
    assert!(matches!(answer.code, Some(0 | 1)), "{command:?}: {:?} {}", answer.code, answer.stderr);
    assert!(folder.path(there).exists(), "{command:?}");
}

#[test]
fn simulation_overwrites_only_simulations() {
    let folder = Folder::with_dive();
    let simulate = ["simulate", "scene.toml", "-o"];
    let to = |log: &'static str| [&simulate[..], &[log]].concat();
    accepts(&folder, &to("dive.mcap"), "dive.mcap");
    folder.record("dive.mcap", "live.mcap", &[]);
    refuses(&folder, &to("live.mcap"), "live.mcap");
    folder.write("other.toml", VEHICLE);
    refuses(&folder, &to("other.toml"), "other.toml");
    refuses(&folder, &[&to("new.mcap")[..], &["--truth", "other.toml"]].concat(), "other.toml");
    assert!(!folder.path("new.mcap").exists());
    accepts(&folder, &[&to("live.mcap")[..], &["--force"]].concat(), "live.mcap");
    for _ in 0..2 {
        accepts(&folder, &[&to("new.mcap")[..], &["--truth", "truth.csv"]].concat(), "truth.csv");
    }
}

#[test]
fn report_overwrites_only_reports() {
    let folder = Folder::with_dive();
    let replay = ["replay", "dive.mcap", "--report"];
    let to = |report: &'static str| [&replay[..], &[report]].concat();
    for _ in 0..2 {
        accepts(&folder, &to("report.json"), "report.json");
    }
    folder.write("other.json", "{\"version\": 1}");
    folder.record("dive.mcap", "live.mcap", &[]);
    std::fs::rename(folder.path("live.mcap"), folder.path("live.json")).unwrap();
    folder.write("other", VEHICLE);
    for there in ["other", "other.json", "live.json"] {
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
    // Even with `--force`, a report can't replace its own log.
    let before = folder.read("live.json");
    let answer = folder.headrace(&["replay", "live.json", "--report", "live.json", "--force"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert_eq!(folder.read("live.json"), before);
}

/// A report name with the extension of another format is refused before anything is read. Here the log doesn't even
/// exist.
#[test]
fn report_with_another_extension_is_refused_before_the_dive_is_read() {
    let folder = Folder::with_dive();
    for command in [&["replay", "none.mcap"][..], &["run", "none.toml", "--source", "none.mcap"]] {
        for report in ["out.csv", "out.html", "out.json.txt", "folder/OUT.CSV"] {
            let answer = folder.headrace(&[command, &["--report", report, "--force"]].concat());
            assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{report}: {}", answer.stderr);
            for words in [report, "--report", "must end in .json", "headrace campaign DIR"] {
                assert!(answer.stderr.contains(words), "{report}: no {words:?} in {}", answer.stderr);
            }
            assert!(!folder.path(report).exists(), "{report}");
        }
    }
    for report in ["out.json", "OUT.JSON", "out"] {
        accepts(&folder, &["replay", "dive.mcap", "--report", report], report);
        assert!(folder.read(report).starts_with(b"{\n  \"report_version\":"), "{report}");
    }
}

#[test]
fn recordings_and_derived_logs_overwrite_no_other_log() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    folder.record("dive.mcap", "live_2.mcap", &[]);
    let record = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--record"];
    folder.write("other.toml", VEHICLE);
    for there in ["live.mcap", "other.toml"] {
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
    assert_eq!(answer.code, Some(2), "an input was accepted as output: {}", answer.stderr);
}

#[test]
fn imports_rehearsals_and_pictures_overwrite_only_their_own_kind() {
    let folder = Folder::with_dive();
    folder.write("candump.log", "(1700000000.000000) can0 020#0001\n(1700000000.010000) can0 020#0002\n");
    let import = ["import", "candump.log", "--source", "imu=can0", "--vehicle", "vehicle.toml", "-o"];
    refuses(&folder, &[&import[..], &["dive.mcap"]].concat(), "dive.mcap");
    for _ in 0..2 {
        accepts(&folder, &[&import[..], &["imported.mcap"]].concat(), "imported.mcap");
    }
    std::fs::create_dir(folder.path("rehearsal")).unwrap();
    folder.write("rehearsal/vehicle.toml", VEHICLE);
    refuses(&folder, &["emulate", "scene.toml", "--out", "rehearsal"], "rehearsal/vehicle.toml");
    never(&folder, &["emulate", "scene.toml", "--out", "."]);
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
fn demonstration_leaves_a_folder_with_another_dive_unchanged() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    std::fs::rename(folder.path("live.mcap"), folder.path("dive.mcap")).unwrap();
    refuses(&folder, &["demo", "--speed", "max", "--out", "."], "dive.mcap");
}

#[test]
fn outputs_are_checked_before_the_work_begins() {
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
            // Stdout is empty, which proves that no dive was shown and no work was done.
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
fn only_regular_files_are_ever_replaced() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("out")).unwrap();
    let link = folder.path("out/dive.mcap");
    std::os::unix::fs::symlink("/dev/null", &link).unwrap();
    for force in [&["--force"][..], &[]] {
        let arguments = [&["demo", "--speed", "max", "--out", "out"], force].concat();
        let answer = folder.headrace(&arguments);
        assert_ne!(answer.code, Some(0), "{}", answer.stderr);
        assert!(link.symlink_metadata().unwrap().is_symlink(), "{force:?}: the link is gone");
    }
}

#[test]
fn command_never_writes_its_own_input() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    folder.write("candump.log", "(1700000000.000000) can0 020#0001\n");
    let run = ["run", "vehicle.toml", "--source", "live.mcap", "--speed", "max"];
    for further in [["--record", "vehicle.toml"], ["--record", "live.mcap"]] {
        never(&folder, &[&run[..], &further].concat());
    }
    // A vehicle file may have any name, even one that looks like the name of a report.
    folder.write("vehicle.json", VEHICLE);
    never(&folder, &["run", "vehicle.json", "--source", "live.mcap", "--report", "./vehicle.json"]);
    let import = ["import", "candump.log", "--source", "imu=can0", "--vehicle", "vehicle.toml", "-o"];
    for command in [
        &["run", "vehicle.toml", "--record", "vehicle.toml"][..],
        &["run", "vehicle.json", "--report", "vehicle.json"],
        &["simulate", "scene.toml", "-o", "scene.toml"],
        &["simulate", "scene.toml", "-o", "vehicle.toml"],
        &["simulate", "scene.toml", "-o", "new.mcap", "--truth", "scene.toml"],
        &["replay", "live.mcap", "--vehicle", "vehicle.json", "--report", "vehicle.json"],
        &["export", "live.mcap", "--vehicle", "vehicle.toml", "--html", "vehicle.toml"],
        &["trim", "live.mcap", "--chainage", "0..9", "--vehicle", "vehicle.toml", "-o", "vehicle.toml"],
        &[&import[..], &["vehicle.toml"]].concat(),
        &[&import[..], &["candump.log"]].concat(),
    ] {
        never(&folder, command);
    }
}

#[cfg(unix)]
#[test]
fn output_that_links_to_an_input_is_refused() {
    use std::os::unix::fs::symlink;
    let folder = Folder::with_dive();
    std::fs::hard_link(folder.path("dive.mcap"), folder.path("hard.mcap")).unwrap();
    symlink("dive.mcap", folder.path("soft.mcap")).unwrap();
    for (read, written) in
        [("hard.mcap", "dive.mcap"), ("soft.mcap", "dive.mcap"), ("dive.mcap", "soft.mcap")]
    {
        never(&folder, &["recover", read, "-o", written]);
    }
    std::fs::hard_link(folder.path("dive.mcap"), folder.path("hard.json")).unwrap();
    symlink("dive.mcap", folder.path("soft.json")).unwrap();
    for written in ["hard.json", "soft.json"] {
        never(&folder, &["replay", "dive.mcap", "--report", written]);
    }
    let golden = folder.headrace(&["replay", "dive.mcap", "--report", "golden.json"]);
    assert_eq!(golden.code, Some(0), "{}", golden.stderr);
    std::fs::hard_link(folder.path("golden.json"), folder.path("again.json")).unwrap();
    never(&folder, &["replay", "dive.mcap", "--expect", "golden.json", "--report", "again.json"]);
    let bless = ["replay", "dive.mcap", "--expect", "golden.json", "--bless", "--report", "again.json"];
    two_files(&folder, &bless, &["--report again.json", "golden.json (--expect)"]);
    let twice = ["simulate", "scene.toml", "-o", "again.json", "--truth", "golden.json"];
    two_files(&folder, &twice, &["-o again.json", "golden.json (--truth)"]);
}

#[test]
fn two_outputs_of_a_command_must_differ() {
    let folder = Folder::with_dive();
    // The recording gets the extension `.json`, because a report must have it and both must name the same file.
    let run = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--record", "x.json"];
    let live = ["run", "vehicle.toml", "--for", "1", "--record", "x.json"];
    for run in [&run[..], &live] {
        for report in ["x.json", "./x.json", "x.part002.json", "x.part001.json"] {
            for rotate in [&[][..], &["--rotate", "5s"]] {
                let command = [run, &["--report", report], rotate].concat();
                two_files(&folder, &command, &["--record", "--report", report]);
            }
        }
        for second in ["x.json", "./x.json"] {
            two_files(&folder, &[run, &["--record", second]].concat(), &["--record", second, "given twice"]);
        }
        let part = [run, &["--record", "x.part002.json"]].concat();
        two_files(&folder, &part, &["--record x.json", "x.part002.json", "name of a part"]);
    }
    let simulate = ["simulate", "scene.toml", "-o", "new.mcap", "--truth", "./new.mcap"];
    two_files(&folder, &simulate, &["-o new.mcap", "./new.mcap (--truth)"]);
    // Two outputs may name the same device file, because it has no content to lose.
    #[cfg(unix)]
    accepts(&folder, &["simulate", "scene.toml", "-o", "/dev/null", "--truth", "/dev/null"], "vehicle.toml");
}

#[test]
fn recording_that_cannot_begin_keeps_the_existing_dive() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    folder.record("dive.mcap", "other.mcap", &[]);
    std::fs::rename(folder.path("other.mcap"), folder.path("live.part002.mcap")).unwrap();
    let before = content(&folder);
    let record = ["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--record", "live.mcap"];
    let answer = folder.headrace(&[&record[..], &["--force"]].concat());
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("live.part002.mcap exists"), "{}", answer.stderr);
    assert!(content(&folder) == before, "the dive is gone");
}

#[test]
fn expected_report_is_read_before_the_replay_and_not_replaced() {
    let folder = Folder::with_dive();
    let golden = ["replay", "dive.mcap", "--report", "golden.json"];
    accepts(&folder, &golden, "golden.json");
    never(&folder, &["replay", "dive.mcap", "--expect", "golden.json", "--report", "golden.json"]);
    folder.write("broken.json", "{");
    for expected in ["none.json", "broken.json", "dive.mcap"] {
        let answer = folder.headrace(&["replay", "dive.mcap", "--expect", expected]);
        // Stdout is empty, which proves that nothing was replayed.
        assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{expected}: {}", answer.stderr);
        assert!(answer.stderr.contains(expected), "{}", answer.stderr);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn existing_file_stays_if_the_new_one_cannot_be_written() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    let commands: [&[&str]; 5] = [
        &["replay", "live.mcap", "--report", "report.json"],
        &["export", "live.mcap", "--html", "page.html"],
        &["trim", "live.mcap", "--to", "9s", "-o", "part.mcap"],
        &["recover", "live.mcap", "-o", "whole.mcap"],
        &["simulate", "scene.toml", "-o", "new.mcap", "--truth", "truth.csv"],
    ];
    let full = |command: &[&str]| {
        let mut strace = std::process::Command::new("strace");
        strace.args(["-f", "-qq", "-o", "/dev/null", "-e", "trace=fsync", "-e", "inject=fsync:error=ENOSPC"]);
        strace.arg(program().get_program()).args(command).current_dir(folder.path("")).output()
    };
    if !full(&["--version"]).is_ok_and(|output| output.status.success()) {
        return skipped("strace isn't there, or not allowed");
    }
    for there in [false, true] {
        for command in commands {
            if there {
                accepts(&folder, command, "vehicle.toml");
            }
            let before = content(&folder);
            let output = full(command).unwrap();
            let said = String::from_utf8(output.stderr).unwrap();
            assert_eq!(output.status.code(), Some(1), "{command:?}: {said}");
            let is_reported = said.contains("No space left on device") && said.contains("writing ");
            assert!(is_reported, "{command:?}: {said}");
            assert!(content(&folder) == before, "{command:?}: the folder's files have changed");
        }
    }
}

/// Until the simulation is complete, it writes to a file without a name. The test needs a file system that has unnamed
/// files.
#[cfg(target_os = "linux")]
#[test]
fn killed_simulation_leaves_no_file() {
    let folder = Folder::with_dive();
    folder.write("long.toml", SCENE.replace("speed_mps = 0.2", "speed_mps = 0.001"));
    let before = content(&folder);
    let mut command = program();
    command.args(["simulate", "long.toml", "-o", "long.mcap"]).current_dir(folder.path(""));
    let mut child = command.spawn().unwrap();
    let number = child.id();
    let opened = || {
        let files = std::fs::read_dir(format!("/proc/{number}/fd")).into_iter().flatten().flatten();
        let mut targets = files.filter_map(|file| std::fs::read_link(file.path()).ok());
        let is_new = |name: &std::ffi::OsStr| !before.contains_key(name);
        targets.find(|to| to.starts_with(folder.path("")) && to.file_name().is_some_and(is_new))
    };
    let begun = loop {
        if let Some(file) = opened() {
            break file;
        }
        assert_eq!(child.try_wait().unwrap(), None, "the simulation ended before the kill");
        std::thread::sleep(std::time::Duration::from_millis(10));
    };
    child.kill().unwrap();
    child.wait().unwrap();
    if begun.to_string_lossy().ends_with("(deleted)") {
        assert!(content(&folder) == before, "{begun:?}: {:?}", content(&folder).keys());
    } else {
        skipped("a simulation that is killed: this file system knows no files without a name");
    }
}
