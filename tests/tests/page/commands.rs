//! Operator commands during a live dive reach all viewers, the log, and its replay.

use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer, acknowledge_all};
use serde_json::{Value, json};

use crate::address::ANY;

#[test]
fn acknowledgements_and_notes_reach_other_viewers_and_the_log() {
    let folder = Folder::new();
    let serving = Serving::start(&folder, &["demo", ANY, "--no-open", "--speed", "60x"]);
    let mut one = Viewer::connect(&serving, "", &[]).unwrap();
    let mut other = Viewer::connect(&serving, "", &[]).unwrap();
    one.until_type("ready");
    other.until_type("ready");
    assert_eq!(one.hello["may"], json!({"operate": true, "playback": false}));
    let needs = |viewer: &Viewer| viewer.alerts.values().any(|alert| alert["needs_acknowledgement"] == true);
    one.until("an alert that requires acknowledgement", needs);
    one.send(&acknowledge_all("AB"));
    one.send(&json!({"do": "note", "text": "rubble left", "by": "AB"}));
    let by = |viewer: &Viewer| viewer.alerts.values().any(|alert| alert["acknowledged"]["by"] == "AB");
    other.until("the acknowledgement", by);
    let note = other.until_type("note");
    assert_eq!(note["text"], "rubble left");
    let (status, _) = serving.ask("POST", "/actions/mark", &[], r#"{"by":"joystick"}"#);
    assert_eq!(status, 200);
    let mark = other.until_type("note");
    assert_eq!((&mark["by"], &mark["text"]), (&json!("joystick"), &json!("")));
    let mut late = Viewer::connect(&serving, "", &[]).unwrap();
    late.until_type("ready");
    assert!(by(&late), "{:#?}", late.alerts);
    assert_eq!(late.notes.len(), 2);
    serving.signal(rustix::process::Signal::INT);
    let end = other.until_type("end");
    serving.end();
    let (_, replayed) = folder.replay("headrace-demo/dive.mcap", &[]);
    assert_eq!(replayed["digest"], end["digest"]);
    let alerts: &Value = &replayed["alert_list"];
    assert!(alerts.as_array().unwrap().iter().any(|alert| alert["acknowledged"]["by"] == "AB"), "{alerts}");
    assert_eq!(replayed["notes"][0]["text"], "rubble left");
}
