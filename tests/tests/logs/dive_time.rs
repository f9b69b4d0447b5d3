//! Dive time: all outputs and arguments count from the first sensor packet.

use std::io::Write as _;
use std::process::Stdio;
use std::sync::Arc;

use headrace_monitor::console::CONSOLE_ID;
use headrace_tests::{Folder, VEHICLE, program, raw_messages, write_log};
use mcap::{Channel, Message, WriteOptions};
use serde_json::{Value, json};

/// Dive times of the notes, s. The first one comes before the first sensor packet.
const NOTES_S: [f64; 3] = [-5.0, 3.0, 20.25];

/// Writes `notes.mcap`: the short dive with the notes [`NOTES_S`], shifted in time on the log's clock.
fn with_notes(folder: &Folder) -> u64 {
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    let begun = messages[0].log_time + 7_000_000_000_000;
    for message in &mut messages {
        message.log_time += 7_000_000_000_000;
    }
    let channel = Channel { id: 99, topic: format!("/raw/{CONSOLE_ID}"), ..(*messages[0].channel).clone() };
    let channel = Arc::new(channel);
    for (number, note_s) in (1..).zip(NOTES_S) {
        let data = json!({"do": "note", "text": format!("{note_s} s"), "by": "AB"}).to_string().into_bytes();
        #[expect(clippy::cast_possible_truncation, reason = "whole milliseconds")]
        let at = begun.saturating_add_signed((note_s * 1e9) as i64);
        let (channel, data) = (Arc::clone(&channel), data.into());
        messages.push(Message { channel, sequence: number, log_time: at, publish_time: at, data });
    }
    messages.sort_by_key(|message| message.log_time);
    write_log(&folder.path("notes.mcap"), WriteOptions::new(), Some(VEHICLE), &messages);
    begun
}

fn times_s(notes: &Value) -> Vec<f64> {
    notes.as_array().unwrap().iter().map(|note| note["at_s"].as_f64().unwrap()).collect()
}

#[test]
fn notes_have_the_same_dive_times_in_all_outputs() {
    let folder = Folder::with_dive();
    with_notes(&folder);
    let shown: Vec<f64> = NOTES_S.iter().map(|note_s| note_s.max(0.0)).collect();
    let (_, report) = folder.replay("notes.mcap", &[]);
    assert_eq!(times_s(&report["notes"]), shown, "report");
    let answer = folder.headrace(&["notes", "notes.mcap", "--json"]);
    let notes: Value = serde_json::from_str(&answer.stdout).unwrap();
    assert_eq!(times_s(&notes["notes"]), shown, "headrace notes");
    let answer = folder.headrace(&["notes", "notes.mcap"]);
    assert!(answer.stdout.contains("  20.2 s  note: 20.25 s"), "{}", answer.stdout);
    let answer = folder.headrace(&["replay", "notes.mcap", "--json-lines"]);
    let lines: Vec<Value> = answer.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let lines: Value = lines.into_iter().filter(|line| line["type"] == "note").collect();
    assert_eq!(times_s(&lines), shown, "JSON lines");
    for (line, shown_s) in lines.as_array().unwrap().iter().zip(&shown) {
        assert_eq!(line["t_s"].as_f64(), Some(*shown_s), "{line}");
    }
}

#[test]
fn times_in_arguments_count_from_the_first_sensor_packet() {
    let folder = Folder::with_dive();
    let begun = with_notes(&folder);
    let answer = folder.headrace(&["trim", "notes.mcap", "-o", "part.mcap", "--from", "10s", "--to", "21s"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let part = folder.read("part.mcap");
    let first = raw_messages(&part)[0].log_time;
    assert!((10_000_000_000..10_100_000_000).contains(&(first - begun)), "{} ns", first - begun);
    assert!(answer.stdout.contains("messages, 10.0"), "{}", answer.stdout);
    // The extract is a dive of its own, so its dive time begins with the first sensor packet of the extract.
    let (_, report) = folder.replay("part.mcap", &[]);
    let note_s = times_s(&report["notes"])[0];
    assert!((note_s - (20.25 - (first - begun) as f64 * 1e-9)).abs() < 1e-6, "{note_s}");
    let mut replay = program();
    replay.args(["replay", "notes.mcap", "--json-lines", "--interactive", "--from", "12.5s"]);
    replay.current_dir(folder.path("")).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut replay = replay.spawn().unwrap();
    writeln!(replay.stdin.take().unwrap(), "pause\nseek 12.5s\nstep\nend").unwrap();
    let output = String::from_utf8(replay.wait_with_output().unwrap().stdout).unwrap();
    let state = output.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let times: Vec<f64> =
        state.filter(|line| line["type"] == "state").map(|line| line["t_s"].as_f64().unwrap()).collect();
    assert!(times.iter().any(|time_s| (12.5..12.6).contains(time_s)), "{times:?}");
}
