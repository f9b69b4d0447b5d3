//! Checks `--tui` on terminals of several sizes with a separate terminal emulator.
//!
//! The tests cover the pages of golden dives at fixed times and the keys. They also check that the terminal is restored
//! after every kind of exit.

use headrace_tests::screen::Screen;
use headrace_tests::{Folder, root};
use rustix::process::Signal;

const UNICODE: (&str, &str) = ("LANG", "C.UTF-8");

/// Plays a golden dive on a terminal to its end, where playback pauses.
fn ended(log: &str, size: (u16, u16), variables: &[(&str, &str)]) -> (Folder, Screen) {
    let folder = Folder::new();
    let log = root().join(format!("tests/golden/{log}.mcap"));
    let arguments = ["replay", log.to_str().unwrap(), "--tui", "--speed", "max"];
    let mut screen = Screen::sized(&folder, &arguments, size, variables);
    screen.until_page(" END ");
    screen.press(b" ");
    (folder, screen)
}

/// The displayed page at the dive's time `time`. The page is reached by `back` key presses from the end of the dive.
/// Each key press goes back to a multiple of ten seconds.
fn at(screen: &mut Screen, back: usize, time: &str) -> String {
    screen.until_page(" END ");
    for _ in 0..back {
        screen.press(b"\x1b[D");
    }
    screen.until_page(&format!(" PAUSED  {time}"))
}

#[test]
fn golden_dives_match_snapshots_on_three_terminal_sizes() {
    for size in [(60, 20), (80, 24), (120, 40)] {
        let (_folder, mut screen) = ended("too-fast", size, &[UNICODE]);
        let page = at(&mut screen, 5, "0:00:31");
        insta::assert_snapshot!(format!("too_fast_{}x{}", size.0, size.1), page);
    }
}

#[test]
fn tui_shows_problems_first() {
    for log in ["stalls", "adrift", "slipping-cable", "murk"] {
        let (_folder, screen) = ended(log, (80, 24), &[UNICODE]);
        let page = screen.until_page(" END ");
        insta::assert_snapshot!(log, page);
    }
}

#[test]
fn words_and_shapes_remain_on_a_terminal_without_colours_and_unicode() {
    let (_folder, mut screen) = ended("too-fast", (80, 24), &[("NO_COLOR", "1"), ("LC_ALL", "C")]);
    let page = at(&mut screen, 5, "0:00:31");
    assert!(page.is_ascii(), "{page}");
    insta::assert_snapshot!("plain", page);
    let terminal = screen.terminal();
    for row in 0..24 {
        for column in 0..80 {
            let cell = terminal.screen().cell(row, column).unwrap();
            let colours = [cell.fgcolor(), cell.bgcolor()];
            assert_eq!(colours, [vt100::Color::Default; 2], "row {row}, column {column}");
        }
    }
}

#[test]
fn keys_seek_in_a_replay_and_end_it() {
    let (_folder, mut screen) = ended("too-fast", (100, 30), &[UNICODE]);
    assert!(!screen.is_in_order(), "keys arrive without a line end");
    at(&mut screen, 1, "0:01:11");
    screen.press(b"\x1b[B");
    screen.until_page(" PAUSED  0:00:11");
    screen.press(b"-");
    screen.until_page(" 1024x PAUSED");
    screen.press(b"w");
    screen.until_page("WALL seen so far");
    screen.press(b"w");
    screen.until_page("WALL whole tunnel");
    screen.press(b"?");
    screen.until_page("acknowledge the alert on top");
    screen.press(b"?");
    screen.resize((60, 20));
    let small = screen.until_page("REPLAY 1024x PAUSED  0:00:11");
    assert!(small.lines().all(|line| line.chars().count() <= 60) && !small.contains("on top"), "{small}");
    screen.press(b"\x1b[A\x1b[A");
    screen.until_page(" END ");
    screen.press(b"q");
    let (code, shown) = screen.end();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {shown}");
    assert!(screen.is_in_order());
    let last = screen.page();
    assert!(
        last.contains(" samples, ") && !last.contains("ALERTS"),
        "the first page, with the summary: {last}"
    );
    assert!(!screen.terminal().screen().hide_cursor() && !screen.terminal().screen().alternate_screen());
}

/// A way to end the program: its name, its action, and whether the program then ends regularly.
type Way<'a> = (&'a str, &'a dyn Fn(&mut Screen), bool);

#[test]
fn every_exit_restores_the_terminal() {
    let folder = Folder::with_dive();
    let play = ["replay", "dive.mcap", "--tui", "--speed", "0.5x"];
    let demo = ["demo", "--tui", "--speed", "1x", "--out", "demo", "--force"];
    let ways: [Way<'_>; 4] = [
        ("ctrl-c", &|screen| screen.press(b"\x03"), true),
        ("SIGTERM", &|screen| screen.signal(Signal::TERM), true),
        ("SIGHUP", &|screen| screen.signal(Signal::HUP), true),
        ("ctrl-c twice within a second", &|screen| screen.press(b"\x03\x03"), true),
    ];
    for arguments in [&play[..], &demo] {
        for (way, leave, in_good_order) in ways {
            let mut screen = Screen::run(&folder, arguments, 80, &[]);
            screen.until("ALERTS");
            leave(&mut screen);
            let (code, shown) = screen.end();
            let page = screen.page();
            assert!(screen.is_in_order(), "{way}: {shown}");
            let terminal = screen.terminal();
            assert!(!terminal.screen().alternate_screen() && !terminal.screen().hide_cursor(), "{way}");
            let has_summary = [" samples, ", "NO VERDICTS", "NO COVERAGE", "NO INSPECTION"]
                .iter()
                .any(|words| page.contains(words));
            assert!(has_summary || !in_good_order, "{way}: {code:?}: {page}");
        }
    }
}

#[test]
fn tui_without_a_terminal_is_refused_with_the_requirements() {
    let folder = Folder::with_dive();
    let answer = folder.headrace(&["replay", "dive.mcap", "--tui"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("--tui needs a terminal"), "{}", answer.stderr);
}

#[test]
fn log_messages_are_held_until_the_terminal_is_restored() {
    let folder = Folder::with_dive();
    let mut screen =
        Screen::run(&folder, &["replay", "dive.mcap", "--tui", "--speed", "max", "-v"], 100, &[UNICODE]);
    let page = screen.until_page(" END ");
    for line in page.lines() {
        let torn = line.contains("INFO") && !line.starts_with("LOG");
        assert!(!torn, "{page}");
    }
    screen.press(b"q");
    let (_, shown) = screen.end();
    let (_, after) = shown.rsplit_once("\x1b[?1049l").unwrap();
    assert!(after.contains("loop armed") || after.contains("memory at the most"), "{after}");
}

#[test]
fn acknowledgements_and_notes_by_key_are_logged() {
    let folder = Folder::new();
    let mut screen =
        Screen::sized(&folder, &["demo", "--tui", "--speed", "20x", "--out", "demo"], (100, 30), &[UNICODE]);
    screen.until("MISSED");
    screen.press(b"A");
    screen.until("all acknowledged");
    screen.press(b"nrubble, left\r");
    screen.until("noted: rubble, left");
    screen.press(b"\x03");
    let (code, shown) = screen.end();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {shown}");
    let messages = mcap::MessageStream::new(&folder.read("demo/dive.mcap"))
        .unwrap()
        .map(Result::unwrap)
        .filter(|message| message.channel.topic == "/raw/console")
        .map(|message| String::from_utf8(message.data.to_vec()).unwrap())
        .collect::<Vec<_>>();
    let has = |text: &str| messages.iter().any(|message| message.contains(text));
    assert!(has(r#""do":"acknowledge","alert":0,"by":"terminal""#), "{messages:?}");
    assert!(has(r#""do":"note","text":"rubble, left","by":"terminal""#), "{messages:?}");
}
