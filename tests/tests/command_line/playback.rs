//! `replay --interactive` with keys on a terminal and with commands from a pipe, and an interrupted demonstration.

use std::io::Write as _;
use std::process::Stdio;

use headrace_tests::json_schema::faults;
use headrace_tests::screen::Screen;
use headrace_tests::{Folder, program};
use rustix::process::Signal;
use serde_json::Value;

const PLAY: [&str; 5] = ["replay", "dive.mcap", "--interactive", "--speed", "0.5x"];

#[test]
fn keys_control_and_end_a_replay() {
    let folder = Folder::with_dive();
    let mut screen = Screen::run(&folder, &PLAY, 100, &[]);
    screen.until("q quit");
    assert!(!screen.is_in_order(), "keys come without a line end");
    screen.press(b"\x1b[C");
    screen.until("AT       0:00:10.");
    screen.press(b" ");
    screen.press(b".");
    screen.press(b"+");
    screen.until("SPEED    1x");
    screen.press(b"-");
    screen.press(b"-");
    screen.until("SPEED    0.25x");
    screen.press(b"\x1b[A");
    screen.until("END      left and down seek back, q quits");
    screen.press(b"\x1b[B");
    screen.until("AT       0:00:00.000");
    // The terminal doesn't echo typed characters.
    screen.press(b"xyzzy");
    screen.press(b"q");
    let (code, shown) = screen.end();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {shown}");
    assert!(!shown.contains("xyzzy"), "{shown}");
    assert!(shown.contains("NO COVERAGE"), "the summary at the dive's begin: {shown}");
    assert!(screen.is_in_order(), "the terminal is as before");
}

#[test]
fn ctrl_c_and_sigterm_restore_the_terminal() {
    let folder = Folder::with_dive();
    let mut screen = Screen::run(&folder, &PLAY, 100, &[]);
    screen.until("q quit");
    screen.press(b"\x03");
    assert!(screen.end().0.is_some(), "the replay doesn't end by itself");
    assert!(screen.is_in_order());
    let mut screen = Screen::run(&folder, &PLAY, 100, &[]);
    screen.until("q quit");
    screen.signal(Signal::TERM);
    assert!(screen.end().0.is_some());
    assert!(screen.is_in_order());
}

#[test]
fn piped_commands_control_and_end_a_replay() {
    let folder = Folder::with_dive();
    for leave in ["end", "quit"] {
        let mut command = program();
        command.args(PLAY).current_dir(folder.path("")).stdin(Stdio::piped());
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut words = child.stdin.take().unwrap();
        write!(words, "pause\nseek 10s\n{leave}\n").unwrap();
        // The input pipe stays open, so that only the piped command can end the replay.
        let status = child.wait().unwrap();
        drop(words);
        assert!(matches!(status.code(), Some(0 | 1)), "{leave}: {status:?}");
    }
}

#[test]
fn interrupted_demonstration_keeps_its_report_and_summary() {
    let folder = Folder::new();
    let mut screen = Screen::run(&folder, &["demo", "--speed", "20x", "--out", "demo"], 100, &[]);
    screen.until("m/s");
    // A wrapper such as `timeout` sends the signal twice: to the program, and then to its process group.
    screen.signal(Signal::INT);
    std::thread::sleep(std::time::Duration::from_millis(5));
    screen.signal(Signal::INT);
    let (code, shown) = screen.end();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {shown}");
    assert!(shown.contains("interrupted") && shown.contains("report demo/report.json"), "{shown}");
    let report: Value = serde_json::from_slice(&folder.read("demo/report.json")).unwrap();
    assert_eq!(faults(&super::report_schema::schema(), &report), Vec::<String>::new());
    let duration_s = report["dive"]["duration_s"].as_f64().unwrap();
    assert!(duration_s > 0.0);
    // A replay of the interrupted dive's log gives the same digest as the dive's report.
    let (_, replayed) = folder.replay("demo/dive.mcap", &[]);
    assert_eq!(replayed["digest"], report["digest"]);
}
