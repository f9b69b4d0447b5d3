//! Data sent to viewers. A new viewer gets all results of the loop. A viewer that reconnects gets only the changes.

use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer};
use serde_json::{Value, json};

use crate::address::ANY;

/// Replays the short dive with a page. Playback pauses at the end of the log.
fn replayed(folder: &Folder) -> (Serving, Viewer) {
    replayed_with(folder, &[])
}

fn replayed_with(folder: &Folder, further: &[&str]) -> (Serving, Viewer) {
    let arguments = [&["replay", "dive.mcap", ANY, "--report", "report.json"], further].concat();
    let serving = Serving::start(folder, &arguments);
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_type("ready");
    // Playback pauses at the end of the log.
    viewer.until("the end of the log", |viewer| viewer.state["playback"]["paused"] == true);
    (serving, viewer)
}

/// First and last time of the log to which the viewer can seek, s.
fn span_s(viewer: &Viewer) -> [f64; 2] {
    ["from_s", "to_s"].map(|key| viewer.state["playback"][key].as_f64().unwrap())
}

fn end(serving: Serving, viewer: &mut Viewer) -> Value {
    viewer.send(&json!({"do": "play", "command": "end"}));
    let end = viewer.until_type("end");
    let (code, printed) = serving.end();
    assert_eq!(json!(code), end["exit"], "{printed}");
    end
}

#[test]
fn viewer_state_at_the_end_equals_the_report() {
    let folder = Folder::with_dive();
    let (serving, mut viewer) = replayed(&folder);
    let last = end(serving, &mut viewer);
    let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
    assert_eq!(last["digest"], report["digest"]);
    let section_m = viewer.hello["section_m"].as_f64().unwrap();
    let sections = report["sections"].as_array().unwrap();
    assert!(sections.len() > 10, "{}", sections.len());
    let mut metres = [0.0; 5];
    for section in sections {
        let start_m = section["start_m"].as_f64().unwrap();
        #[expect(clippy::cast_possible_truncation, reason = "a whole number")]
        let index = (start_m / section_m).round() as i32;
        let shown = viewer.sections[&index];
        let verdict = match section["verdict"].as_str().unwrap() {
            "open" if section["not_inspected"] == true => 4,
            "open" => 0,
            "pass" => 1,
            "fail" => 2,
            "cannot_say" => 3,
            other => panic!("{other}"),
        };
        assert_eq!(shown.verdict, verdict, "at {start_m}");
        metres[usize::from(shown.verdict)] += section_m;
        match section["hole_m"].as_f64() {
            Some(hole_m) => assert!((f64::from(shown.hole_m) - hole_m).abs() < 1e-6, "at {start_m}"),
            None => assert!(shown.hole_m.is_nan(), "at {start_m}"),
        }
        match section["cause"]["cause"].as_str() {
            Some(cause) => {
                assert_eq!(viewer.hello["causes"][usize::from(shown.cause)], cause, "at {start_m}");
            }
            None => assert_eq!(shown.cause, 255, "at {start_m}"),
        }
        if section["samples"].as_u64() > Some(200) {
            assert!(shown.seen.count_ones() > 32, "at {start_m}: {:b}", shown.seen);
        }
    }
    let summary = &report["summary"];
    let of = |key: &str| summary[key].as_f64().unwrap();
    for key in ["pass_m", "fail_m", "cannot_say_m", "not_inspected_m", "open_m"] {
        let shown_m = viewer.state["metres"][key].as_f64().unwrap();
        assert!((shown_m - of(key)).abs() < 1e-6, "{key} of the last state: {shown_m}, {summary}");
    }
    for (shown_m, reported_m) in [
        (metres[1], of("pass_m")),
        (metres[2], of("fail_m")),
        (metres[3], of("cannot_say_m")),
        (metres[4], of("not_inspected_m")),
        (metres[0], of("open_m")),
    ] {
        assert!((shown_m - reported_m).abs() < 1e-6, "{metres:?}, {summary}");
    }
}

/// Data that a viewer has received while the replay is paused: length of each verdict, missed stretches, verdicts of
/// the sections, and stretches to go back to.
fn seen(viewer: &Viewer) -> Value {
    let state = &viewer.state;
    let verdicts: Vec<_> = viewer.sections.iter().map(|(index, section)| (index, section.verdict)).collect();
    let back =
        viewer.others.iter().rfind(|message| message["type"] == "back").map(|back| back["legs"].clone());
    json!({"now_s": state["now_s"], "metres": state["metres"], "outstanding": state["outstanding"],
        "sections": verdicts, "legs": back.unwrap_or_else(|| json!([]))})
}

/// A new viewer of a paused replay, with all data of the present moment.
fn joining(serving: &Serving) -> Viewer {
    let mut viewer = Viewer::connect(serving, "", &[]).unwrap();
    viewer.until_type("ready");
    viewer.until("a state", |viewer| !viewer.state["now_s"].is_null());
    viewer
}

#[test]
fn replay_begun_in_the_middle_shows_the_same_as_one_from_the_beginning() {
    let folder = Folder::with_dive();
    let targets = ["--target", "0.25"];
    let (serving, mut whole) = replayed_with(&folder, &targets);
    let [from_s, to_s] = span_s(&whole);
    whole.send(&json!({"do": "play", "command": "pause"}));
    drop(whole);
    let mut missed = 0;
    for part in 1..20 {
        let at_s = f64::from(part) / 20.0 * (to_s - from_s);
        let from = format!("{at_s}s");
        let arguments =
            [&["replay", "dive.mcap", ANY, "--speed", "0.01x", "--from", &from][..], &targets].concat();
        let middle = Serving::start(&folder, &arguments);
        let mut viewer = Viewer::connect(&middle, "", &[]).unwrap();
        // The test sends no command to this replay, because the server sends all data again after a pause or a jump.
        viewer.until("the jump", |viewer| viewer.state["now_s"].as_f64() > Some(from_s + at_s - 0.1));
        let late = joining(&middle);
        let now_s = late.state["now_s"].clone();
        let mut other = joining(&serving);
        other.send(&json!({"do": "play", "command": "seek", "to_s": now_s}));
        other.until("the jump", |viewer| viewer.state["now_s"] == now_s);
        assert_eq!(seen(&late), seen(&joining(&serving)), "{at_s} s");
        missed += usize::from(!late.state["outstanding"].is_null());
        viewer.send(&json!({"do": "play", "command": "end"}));
        middle.end();
    }
    assert!(missed > 2, "{missed} times with missed sections");
    let mut last = joining(&serving);
    end(serving, &mut last);
}

#[test]
fn dive_is_compared_with_a_second_target() {
    let folder = Folder::with_dive();
    let (serving, mut viewer) = replayed_with(&folder, &["--target", "0.5,0.2"]);
    assert_eq!(viewer.hello["compared_m"], 0.2);
    // Sections behind a moving vehicle must be judged at once for the second target too, and not only at the end of the
    // dive.
    let judged =
        |viewer: &Viewer| viewer.sections.values().filter(|section| section.compared == Some(2)).count();
    assert!(judged(&viewer) > 3, "{:?}", viewer.sections);
    end(serving, &mut viewer);
    let report: Value = serde_json::from_slice(&folder.read("report.json")).unwrap();
    let section_m = viewer.hello["section_m"].as_f64().unwrap();
    let mut apart_m = 0.0;
    for (other, key) in [(0, "open_m"), (1, "pass_m"), (2, "fail_m"), (3, "cannot_say_m")] {
        // For the second target, the wall on the page shows sections as open if they aren't inspected.
        let with_not_inspected = |all: &Value| {
            let of = |key: &str| all[key].as_f64().unwrap();
            of(key) + if key == "open_m" { of("not_inspected_m") } else { 0.0 }
        };
        let reported_m = with_not_inspected(&report["other_targets"][1]);
        let sections = viewer.sections.values().filter(|section| section.compared == Some(other)).count();
        let shown_m = sections as f64 * section_m;
        let summed_m = with_not_inspected(&viewer.state["compared"]);
        assert!((shown_m - summed_m).abs() < 1e-6, "{key}: {shown_m}, {summed_m}");
        apart_m += (shown_m - reported_m).abs() / 2.0;
    }
    // For the second target, the page compares the holes of this dive with that target, but the report comes from
    // another replay of the dive. The results differ at the ends of the covered stretch.
    let way_m = report["coverage_extent"]["length_m"].as_f64().unwrap();
    assert!(
        apart_m <= 0.2 * way_m,
        "{apart_m} of {way_m} m: {}, {}",
        viewer.state["compared"],
        report["other_targets"]
    );
    assert!(report["other_targets"][1]["fail_m"].as_f64() > report["other_targets"][0]["fail_m"].as_f64());
    let not_inspected_m = viewer.state["compared"]["not_inspected_m"].as_f64().unwrap();
    assert!(not_inspected_m > 0.0, "{}", viewer.state["compared"]);
}

#[test]
fn resumed_viewer_shows_the_same_as_a_new_viewer() {
    let folder = Folder::with_dive();
    let (serving, mut lost) = replayed(&folder);
    // A seek back restarts the dive, whose number of sections is then smaller. After that, the viewer loses its
    // connection while the dive goes on.
    let [from_s, to_s] = span_s(&lost);
    // The seek leads to a late time in the dive, at which a part of the tunnel already has final verdicts.
    let middle_s = to_s - 0.1 * (to_s - from_s);
    lost.send(&json!({"do": "play", "command": "pause"}));
    lost.send(&json!({"do": "play", "command": "seek", "to_s": middle_s}));
    lost.until("the jump", |viewer| {
        viewer.hello["instance"].as_str().unwrap().contains('.')
            && viewer.others.last().unwrap()["type"] == "ready"
    });
    lost.until("a state", |viewer| viewer.state["now_s"].as_f64() < Some(middle_s + 0.1));
    let (resume, before) = (lost.resume(), lost.sections.clone());
    drop(lost.send_raw(tungstenite::Message::Close(None)));
    let mut other = Viewer::connect(&serving, "", &[]).unwrap();
    other.until_type("ready");
    other.send(&json!({"do": "play", "command": "go"}));
    other.until("the end again", |viewer| {
        viewer.state["playback"]["paused"] == true && viewer.state["now_s"].as_f64() > Some(to_s - 0.5)
    });
    let mut resumed = Viewer::connect(&serving, &resume, &[]).unwrap();
    resumed.until_type("ready");
    let sent = resumed.section_frames.1;
    let mut fresh = Viewer::connect(&serving, "", &[]).unwrap();
    fresh.until_type("ready");
    assert!(sent > 0 && sent < fresh.section_frames.1, "{sent} of {}", fresh.section_frames.1);
    let mut merged = before;
    merged.extend(&resumed.sections);
    let bits = |sections: &std::collections::BTreeMap<i32, headrace_tests::page_client::SeenSection>| {
        let of = |(index, section): (&i32, &headrace_tests::page_client::SeenSection)| {
            (*index, section.verdict, section.cause, section.hole_m.to_bits(), section.seen)
        };
        sections.iter().map(of).collect::<Vec<_>>()
    };
    assert_eq!(bits(&merged), bits(&fresh.sections));
    assert_eq!(bits(&other.sections), bits(&fresh.sections));
    end(serving, &mut fresh);
}

#[test]
fn sent_samples_are_those_before_the_time_of_a_seek() {
    let folder = Folder::with_dive();
    let (serving, mut viewer) = replayed(&folder);
    let count = || {
        let (status, answer) = serving.ask("GET", "/samples?from_m=-100&to_m=1000", &[], "");
        assert_eq!(status, 200);
        assert!(answer.to_lowercase().contains("headrace-one-of: 1\r\n"), "{answer}");
        let length = answer.to_lowercase().split("content-length: ").nth(1).unwrap().to_owned();
        (length.split('\r').next().unwrap().parse::<u64>().unwrap() - 16) / 20
    };
    let whole = count();
    assert!(whole > 1000, "{whole}");
    let [from_s, to_s] = span_s(&viewer);
    let middle_s = f64::midpoint(from_s, to_s);
    // Without the pause, playback goes on after the seek, and faster than the server sends states.
    viewer.send(&json!({"do": "play", "command": "pause"}));
    viewer.send(&json!({"do": "play", "command": "seek", "to_s": middle_s}));
    viewer.until("the jump back", |viewer| viewer.state["now_s"].as_f64() < Some(middle_s + 0.1));
    let part = count();
    assert!(part > 0 && part < whole, "{part} of {whole}");
    viewer.send(&json!({"do": "play", "command": "seek", "to_s": to_s + 1.0}));
    viewer.until("the jump to the end", |viewer| viewer.state["now_s"].as_f64() > Some(to_s - 1.0));
    assert_eq!(count(), whole);
    viewer.send(&json!({"do": "play", "command": "seek", "to_s": from_s}));
    viewer.until("the beginning", |viewer| viewer.state["now_s"].as_f64() < Some(from_s + 0.5));
    viewer.send(&json!({"do": "play", "command": "step_section"}));
    viewer.until("a section", |viewer| viewer.sections.values().any(|section| section.verdict != 0));
    viewer.until("playback pauses", |viewer| viewer.state["playback"]["paused"] == true);
    assert!(viewer.state["now_s"].as_f64() < Some(to_s - 1.0), "{}", viewer.state["now_s"]);
    end(serving, &mut viewer);
}

/// Fields of Cockpit's page "External Integrations" (May 2026). If a field is missing, null or of another type,
/// Cockpit discards the whole file.
fn is_what_cockpit_accepts(extras: &Value) {
    let texts = |of: &Value, keys: &[&str]| {
        for key in keys {
            assert!(of[key].is_string(), "{key} of {of}");
        }
    };
    let each = |of: &Value, key: &str| of[key].as_array().unwrap_or_else(|| panic!("{key} of {of}")).clone();
    texts(extras, &["targetCockpitApiVersion", "targetSystem"]);
    for widget in each(extras, "widgets") {
        texts(&widget, &["name", "iframeUrl", "iconUrl", "iframeIcon", "version"]);
        assert!(widget["useExtensionPathAsBaseUrl"].is_boolean(), "{widget}");
    }
    let actions = each(extras, "actions");
    for action in &actions {
        texts(action, &["id", "name", "version"]);
        assert_eq!(action["type"], "http-request");
        let config = &action["config"];
        texts(config, &["name", "url", "body"]);
        assert!(["GET", "POST", "PUT", "DELETE", "PATCH"].contains(&config["method"].as_str().unwrap()));
        for record in ["headers", "urlParams"] {
            assert!(config[record].as_object().unwrap().values().all(Value::is_string), "{action}");
        }
    }
    for group in each(extras, "joystickSuggestions") {
        texts(&group, &["id", "name", "description", "version"]);
        for button in each(&group, "buttonMappingSuggestions") {
            texts(&button, &["id", "actionName", "actionId", "description"]);
            assert_eq!(button["actionProtocol"], "cockpit-action");
            assert!(["regular", "shift"].contains(&button["modifierKey"].as_str().unwrap()), "{button}");
            assert!(button["button"].is_number(), "{button}");
            assert!(actions.iter().any(|action| action["id"] == button["actionId"]), "{button}");
        }
    }
}

#[test]
fn other_programs_can_read_widgets_state_schema_and_metrics() {
    let folder = Folder::with_dive();
    let (serving, mut viewer) = replayed(&folder);
    let (_, extras) = serving.ask("GET", "/cockpit_extras.json", &[], "");
    let extras: Value = serde_json::from_str(extras.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    is_what_cockpit_accepts(&extras);
    let icon = extras["widgets"][0]["iconUrl"].as_str().unwrap();
    let (status, picture) = serving.ask("GET", &icon[icon.find("/assets").unwrap()..], &[], "");
    assert!(status == 200 && picture.contains("<svg"), "{icon}: {status}");
    // The dive goes on while the test asks the server for its state, so this state may differ from the viewer's at
    // first. At the end of the log, both are the last state.
    loop {
        let (status, answer) = serving.ask("GET", "/state.json", &[], "");
        let body = answer.split("\r\n\r\n").nth(1).unwrap();
        let state: Value = serde_json::from_str(body).unwrap();
        assert_eq!(status, 200);
        viewer.until("a state that is as new", |viewer| {
            viewer.state["at_s"].as_f64() >= state["at_s"].as_f64()
        });
        if viewer.state["at_s"] == state["at_s"] {
            assert_eq!(viewer.state["position"], state["position"]);
            break;
        }
    }
    let (_, schema) = serving.ask("GET", "/schema.json", &[], "");
    let schema: Value = serde_json::from_str(schema.split("\r\n\r\n").nth(1).unwrap()).unwrap();
    assert_eq!(schema["title"], "headrace feed, version 3");
    let (_, figures) = serving.ask("GET", "/metrics", &[], "");
    assert!(figures.contains("\nheadrace_page_viewers 1\n"), "{figures}");
    assert!(figures.contains("\nheadrace_page_dropped_samples_total 0\n"), "{figures}");
    let (_, page) = serving.ask("GET", "/widget/speed", &[], "");
    assert!(page.to_lowercase().contains("<!doctype html>") && page.contains("nosniff"), "{page}");
    end(serving, &mut viewer);
}

#[test]
fn exported_file_holds_the_data_of_a_viewer() {
    use std::io::Read as _;
    let folder = Folder::with_dive();
    let answer = folder.headrace(&["export", "dive.mcap", "--html", "dive.html"]);
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.stderr);
    let page = String::from_utf8(folder.read("dive.html")).unwrap();
    assert!(!page.contains("src=\"/") && !page.contains("href=\"/"), "nothing is fetched");
    let begin = page.find("id=\"dive\">").unwrap() + 10;
    let text = &page[begin..begin + page[begin..].find("</script>").unwrap()];
    let mut bytes = Vec::new();
    flate2::read::DeflateDecoder::new(&*base64(text)).read_to_end(&mut bytes).unwrap();
    let (mut kinds, mut rest, mut frames) = (Vec::new(), bytes.as_slice(), Vec::new());
    while let [a, b, c, d, kind, after @ ..] = rest {
        let (body, after) = after.split_at(u32::from_le_bytes([*a, *b, *c, *d]) as usize);
        rest = after;
        if *kind == 0 {
            let value: Value = serde_json::from_slice(body).unwrap();
            kinds.push(value["type"].as_str().unwrap().to_owned());
            frames.push(value);
        } else {
            kinds.push(format!("binary {}", body[0]));
        }
    }
    assert_eq!(kinds[..3], ["hello", "binary 1", "binary 2"]);
    assert_eq!(kinds.last().unwrap(), "end");
    let (_, replayed) = folder.replay("dive.mcap", &[]);
    assert_eq!(frames.last().unwrap()["digest"], replayed["digest"]);
    let timeline = frames.iter().find(|frame| frame["type"] == "timeline").unwrap();
    let (times, states) = (timeline["t_s"].as_array().unwrap(), timeline["states"].as_array().unwrap());
    assert!(times.len() > 5 && times.len() == states.len(), "{} {}", times.len(), states.len());
    assert!(states.iter().skip(1).all(|state| state.get("version").is_none()), "constant parts occur once");
    let again = folder.headrace(&["export", "dive.mcap", "--html", "dive.html"]);
    assert!(matches!(again.code, Some(0 | 1)), "its own kind is overwritten: {}", again.stderr);
    assert_eq!(folder.read("dive.html"), page.as_bytes(), "byte for byte");
    folder.write("other.html", "<html>");
    assert_eq!(folder.headrace(&["export", "dive.mcap", "--html", "other.html"]).code, Some(2));
}

/// Base64 encoding. Source: RFC 4648, section 4.
fn base64(text: &str) -> Vec<u8> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut bytes, mut bits, mut count) = (Vec::new(), 0_u32, 0);
    for digit in text.bytes().filter(|digit| *digit != b'=') {
        let value = DIGITS.iter().position(|other| *other == digit).unwrap();
        (bits, count) = (bits << 6 | u32::try_from(value).unwrap(), count + 6);
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count & 255) as u8);
        }
    }
    bytes
}
