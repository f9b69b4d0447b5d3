//! Runs the commands of docs/first-dive.md in order and in one folder.

use std::process::Stdio;
use std::time::Duration;

use headrace_tests::{Folder, program, root};

/// Options that the test adds to the tutorial's commands, by command. With these options, no browser opens and all
/// waiting is short.
const QUICK: [(&str, &[&str]); 2] =
    [("demo", &["--no-open", "--speed", "max"]), ("emulate", &["--linger", "60"])];
/// Duration of the rehearsal, s: the first value in the tutorial, the second in the test.
const REHEARSAL_S: [&str; 2] = ["300", "3"];

/// Interval at which the test looks for the rehearsal's vehicle file. The test looks up to `WAITS` times, which takes
/// one minute.
const WAIT: Duration = Duration::from_millis(50);
const WAITS: usize = 1200;

/// Lines of the console blocks in the tutorial page, without their prompts.
fn commands(page: &str) -> Vec<Vec<String>> {
    let blocks = page.split("```console\n").skip(1).map(|rest| rest.split("```").next().unwrap_or_default());
    let lines = blocks.flat_map(str::lines).filter_map(|line| line.strip_prefix("$ headrace "));
    lines.map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
}

/// Copies a folder with all its files and folders.
fn copy(from: &std::path::Path, to: &std::path::Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[test]
fn tutorial_commands_succeed_in_their_order() {
    let page = std::fs::read_to_string(root().join("docs/first-dive.md")).unwrap();
    let commands = commands(&page);
    assert!(commands.len() >= 8, "{commands:?}");
    let folder = Folder::new();
    copy(&root().join("deploy"), &folder.path("deploy"));
    let mut emulator = None;
    for command in &commands {
        let mut arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        let further =
            QUICK.iter().find(|(name, _)| *name == arguments[0]).map_or(&[][..], |(_, further)| further);
        arguments.extend(further);
        if let Some(time) = arguments.iter_mut().find(|argument| **argument == REHEARSAL_S[0]) {
            *time = REHEARSAL_S[1];
        }
        if arguments[0] == "emulate" {
            let started = program()
                .args(&arguments)
                .current_dir(folder.path(""))
                .stdin(Stdio::null())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn();
            emulator = Some(started.unwrap());
            let file = folder.path("rehearsal/vehicle.toml");
            let is_there = (0..WAITS).any(|_| {
                std::thread::sleep(WAIT);
                file.exists()
            });
            assert!(is_there, "no vehicle file of the rehearsal after a minute");
            continue;
        }
        let answer = folder.headrace(&arguments);
        // The rehearsal inspects nothing, because the vehicle is still stationary in its first three seconds.
        let is_allowed = answer.code == Some(0) || arguments[0] == "run" && answer.code == Some(1);
        assert!(is_allowed, "{arguments:?}: {:?}: {}", answer.code, answer.stderr);
    }
    let mut emulator = emulator.expect("the tutorial has a rehearsal");
    emulator.kill().unwrap();
    emulator.wait().unwrap();
}
