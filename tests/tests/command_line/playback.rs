//! `replay --interactive` with keys on a terminal and with commands from a pipe; the command `demo` on a terminal.

use std::io::Write as _;
use std::process::Stdio;

use headrace_tests::json_schema::faults;
use headrace_tests::page_client::Viewer;
use headrace_tests::screen::Screen;
use headrace_tests::{Folder, program};
use rustix::process::Signal;
use serde_json::{Value, json};

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
    assert!(shown.contains("NO COVERAGE"), "the summary at the beginning of the dive: {shown}");
    assert!(screen.is_in_order(), "the terminal is as before");
}

#[test]
fn ctrl_c_and_sigterm_restore_the_terminal() {
    let folder = Folder::with_dive();
    let mut screen = Screen::run(&folder, &PLAY, 100, &[]);
    screen.until("q quit");
    screen.press(b"\x03");
    assert!(screen.end().0.is_some(), "Ctrl-C ends the replay with an exit code");
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
    // The test sends the signal twice, because a wrapper such as `timeout` does so: to the program, and then to its
    // process group.
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

/// Address of the operator's page, as printed in the program's output.
fn page_address(screen: &Screen) -> String {
    let shown = screen.until("m/s");
    let (_, rest) = shown.split_once("page   http://").unwrap();
    rest.split_whitespace().next().unwrap().to_owned()
}

#[test]
fn finished_demonstration_is_replayed_on_its_open_page_until_q() {
    let folder = Folder::new();
    let arguments = ["demo", "--speed", "max", "--no-open", "--page=127.0.0.1:0", "--out", "demo"];
    let mut screen = Screen::run(&folder, &arguments, 100, &[]);
    let mut viewer = Viewer::connect_to(&page_address(&screen), "", &[]).unwrap();
    viewer.until("the result", |viewer| viewer.state["ended"] == true && !viewer.state["playback"].is_null());
    let end_s = viewer.state["playback"]["at_s"].as_f64().unwrap();
    assert_eq!(
        (&viewer.state["playback"]["paused"], viewer.state["now_s"].as_f64()),
        (&true.into(), Some(end_s))
    );
    viewer.send(&json!({"do": "play", "command": "pause"}));
    viewer.send(&json!({"do": "play", "command": "seek", "to_s": end_s - 300.0}));
    viewer.until("the jump", |viewer| viewer.state["now_s"].as_f64().unwrap() < end_s - 299.0);
    assert_eq!((&viewer.state["ended"], &viewer.state["playback"]["paused"]), (&false.into(), &true.into()));
    viewer.send(&json!({"do": "note", "text": "too late", "by": "test"}));
    let refused = viewer.until_type("refused");
    assert!(refused["why"].as_str().unwrap().contains("this dive has ended"), "{refused}");
    viewer.send(&json!({"do": "play", "command": "seek", "to_s": end_s}));
    viewer.until("the end", |viewer| viewer.state["now_s"].as_f64() == Some(end_s));
    // If playback is at the end of the log, `go` plays the dive from its beginning.
    viewer.send(&json!({"do": "play", "command": "go"}));
    viewer.until("the beginning", |viewer| viewer.state["now_s"].as_f64().unwrap() < end_s - 300.0);
    screen.press(b"q");
    let (code, shown) = screen.end();
    assert_eq!(code, Some(0), "{shown}");
    assert!(screen.is_in_order(), "the terminal is as before");
    assert_eq!(shown.matches("0+001.25 to 0+024.75: 23.50 m").count(), 1, "one summary: {shown}");
    assert_eq!(viewer.until_closed(), Some((1001, "ended".to_owned())));
    let results = viewer.others.iter().filter(|message| message["type"] == "end").count();
    assert_eq!(results, 1, "a replay that was left early has no result");
}

#[test]
fn demonstration_ends_by_itself_with_exit_option_or_without_page() {
    for option in ["--exit", "--no-page"] {
        let folder = Folder::new();
        let arguments = ["demo", "--speed", "max", "--no-open", "--out", "demo", option];
        let (code, shown) = Screen::run(&folder, &arguments, 100, &[]).end();
        assert_eq!(code, Some(0), "{option}: {shown}");
        assert!(shown.contains("log    demo/dive.mcap") && !shown.contains("q quit"), "{option}: {shown}");
    }
}
