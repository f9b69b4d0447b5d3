//! Tests the screen after all devices have died during a dive. The displayed age of the data grows.

use std::io::{BufRead as _, BufReader};
use std::process::Stdio;

use headrace_tests::Folder;
use headrace_tests::pty::{OnTerminal, shown_lines};

use crate::rehearsal::{Running, headrace, scene};

#[test]
fn screen_shows_growing_age_after_all_devices_die() {
    let folder = Folder::new();
    folder.write("scene.toml", scene(30.0));
    let emulate = headrace()
        .args(["emulate", "--stand", "0", "--out"])
        .arg(folder.path("rehearsal"))
        .arg(folder.path("scene.toml"))
        .stdout(Stdio::piped())
        .spawn();
    let mut emulate = Running(emulate.unwrap());
    let mut said = BufReader::new(emulate.0.stdout.take().unwrap()).lines().map(Result::unwrap);
    let vehicle = said.find_map(|line| line.strip_prefix("vehicle ").map(str::to_owned)).unwrap();
    let mut run = headrace_tests::program();
    run.args(["run", &vehicle, "--no-record", "--no-page"]);
    let mut run = OnTerminal::start(run, 60);
    let before = run.wait_for(" m/s", 0);
    emulate.0.kill().unwrap();
    let old = run.wait_for("OLD ", before);
    run.wait_for("OLD 6 s: nothing from any sensor", old);
    let written = run.so_far();
    let of_old: Vec<&str> = written.split("\r\x1b[K").filter(|status| status.contains("OLD ")).collect();
    assert!(of_old.iter().all(|status| status.starts_with("\x1b[1;31m")), "in red: {of_old:#?}");
    let last = written.split("\r\x1b[K").last().unwrap();
    assert!(!last.contains("ok up to"), "{last}");
    // A line of a single long word, such as the path of a serial port, may be wider, because it can't be broken.
    let is_wide = |line: &String| line.chars().count() >= 60 && line.trim().contains(' ');
    let wide: Vec<_> = shown_lines(&written).into_iter().filter(is_wide).collect();
    assert!(wide.is_empty(), "{wide:#?}");
}
