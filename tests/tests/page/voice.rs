//! Voice notes. The loop keeps the note, and the log keeps the note's sound recording. A note works without its
//! recording, and a recording without its note.

use std::fs::File;
use std::io::BufWriter;

use headrace_replay::log::{DiveLog, MessageKind, Trim, trim};
use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer};
use headrace_tests::random::Random;
use serde_json::{Value, json};

use crate::address::ANY;

const TOKENS: &str = "operator = operator-0123456789abcdef\nviewer = viewer-0123456789abcdef\n";
const OPERATOR: &str = "Authorization: Bearer operator-0123456789abcdef";
const WEBM: &str = "Content-Type: audio/webm;codecs=opus";
const LOG: &str = "headrace-demo/dive.mcap";

/// Returns a sound recording. It has all the properties of a browser's recording that the program checks. Its content
/// is random, so it can't be compressed.
fn webm(seed: u64, bytes: usize) -> Vec<u8> {
    let mut random = Random(seed);
    let noise = (4..bytes).map(|_| random.byte());
    [0x1a, 0x45, 0xdf, 0xa3].into_iter().chain(noise).collect()
}

/// Starts a demonstration dive that runs until the test stops it.
fn demo(folder: &Folder, further: &[&str]) -> Serving {
    Serving::start(folder, &[&["demo", ANY, "--no-open", "--speed", "30x"], further].concat())
}

/// Begins a voice note and waits until the server of the page has confirmed it.
fn begin(viewer: &mut Viewer, id: u32) {
    viewer.send(&json!({"do": "voice", "id": id, "by": "AB"}));
    viewer.until("confirmation of the voice note", |viewer| {
        viewer.others.iter().any(|other| other["type"] == "done" && other["do"] == "voice")
    });
}

fn upload(serving: &Serving, id: u32, headers: &[&str], audio: &[u8]) -> (u16, String) {
    serving.ask("POST", &format!("/voice/{id}?seconds=12"), &[&[WEBM], headers].concat(), audio)
}

/// The note with this voice id in the viewer's list.
fn note(viewer: &Viewer, id: u32) -> Option<&Value> {
    let notes = viewer.others.iter().rev().filter(|other| other["type"] == "note");
    notes.chain(&viewer.notes).find(|note| note["voice"]["id"] == id)
}

fn interrupt(serving: Serving, viewer: &mut Viewer) -> Value {
    serving.signal(rustix::process::Signal::INT);
    let end = viewer.until_type("end");
    serving.end();
    end
}

/// Voice recordings in logs, each with the id of its note and the bytes after its header.
fn recordings(folder: &Folder, logs: &[&str]) -> Vec<(u32, Vec<u8>)> {
    let files: Vec<_> = logs.iter().map(|log| folder.path(log)).collect();
    let mut log = DiveLog::open(&files).unwrap();
    let mut found = Vec::new();
    while let Some(message) = log.next().unwrap() {
        if message.kind == MessageKind::Voice {
            let id = u32::from_le_bytes(message.data[..4].try_into().unwrap());
            let head = 10 + usize::from(u16::from_le_bytes([message.data[8], message.data[9]]));
            found.push((id, message.data[head..].to_vec()));
        }
    }
    found
}

/// Whether any message of a log contains the text `words` after decompression.
fn mentions(folder: &Folder, log: &str, words: &str) -> bool {
    let mut log = DiveLog::open(&[folder.path(log)]).unwrap();
    let mut is_found = false;
    while let Some(message) = log.next().unwrap() {
        is_found |= message.data.windows(words.len()).any(|part| part == words.as_bytes());
    }
    is_found
}

/// Copies a log without its voice recordings.
fn without_voices(folder: &Folder, from: &str, to: &str) {
    let files = [folder.path(from)];
    let mut keep_all = |_: u16, _: &[u8], _: &mut Vec<u8>| false;
    let mut work = Trim {
        spans: Vec::new(),
        words: "without voices".to_owned(),
        header: &|_, header| header,
        change: &mut keep_all,
        voices: false,
        results: &|_| true,
    };
    let output = BufWriter::new(File::create(folder.path(to)).unwrap());
    trim(&mut || DiveLog::open(&files), output, &mut work, &[]).unwrap();
}

#[test]
fn voice_note_has_its_start_time_and_its_bytes_in_the_log() {
    let folder = Folder::new();
    let serving = demo(&folder, &[]);
    let mut one = Viewer::connect(&serving, "", &[]).unwrap();
    let mut other = Viewer::connect(&serving, "", &[]).unwrap();
    one.until("a place", |viewer| viewer.state["position"]["chainage_m"].is_number());
    begin(&mut one, 7);
    let begun = other.until_type("note");
    assert_eq!((&begun["voice"], &begun["text"]), (&json!({"id": 7, "seconds": null}), &json!("")));
    assert!(begun["chainage_m"].is_number() && begun["by"] == "AB", "{begun}");
    assert_eq!(serving.ask("GET", "/voice/7", &[], "").0, 404, "nothing has been sent yet");
    // The dive goes on while the operator speaks.
    let at_s = begun["at_s"].as_f64().unwrap();
    one.until("time", |viewer| viewer.state["at_s"].as_f64().unwrap() > at_s + 5.0);
    let audio = webm(1, 180_000);
    assert_eq!(upload(&serving, 7, &[], &audio).0, 200);
    other.until("its length", |viewer| note(viewer, 7).unwrap()["voice"]["seconds"] == 12);
    let ended = note(&other, 7).unwrap().clone();
    for key in ["number", "at_s", "chainage_m", "station", "by"] {
        assert_eq!(ended[key], begun[key], "{key}");
    }
    assert_eq!(serving.get("/voice/7"), audio);
    assert_eq!(upload(&serving, 7, &[], &audio).0, 200, "sent again, because the answer was lost");
    let mut late = Viewer::connect(&serving, "", &[]).unwrap();
    late.until_type("ready");
    assert_eq!(
        late.notes,
        [json!({"number": 1, "at_s": at_s, "by": "AB", "text": "", "voice": {"id": 7, "seconds": 12},
        "chainage_m": begun["chainage_m"], "station": begun["station"]})]
    );
    let end = interrupt(serving, &mut other);

    assert_eq!(recordings(&folder, &[LOG]), [(7, audio.clone())]);
    let (_, replayed) = folder.replay(LOG, &[]);
    assert_eq!(replayed["digest"], end["digest"]);
    assert_eq!(replayed["notes"], json!(late.notes));
    without_voices(&folder, LOG, "silent.mcap");
    assert_eq!(recordings(&folder, &["silent.mcap"]), []);
    assert_eq!(folder.replay("silent.mcap", &[]).1["digest"], end["digest"]);
    assert_eq!(folder.headrace(&["verify", LOG]).code, Some(0));
    let summary = folder.headrace(&["replay", LOG]).stdout;
    let words = format!("  1 at {}: voice, 12 s (AB)", begun["station"].as_str().unwrap());
    assert!(summary.contains(&words), "{words:?} isn't in {summary}");
    assert_eq!(folder.headrace(&["recover", LOG, "-o", "recovered.mcap"]).code, Some(0));
    assert_eq!(recordings(&folder, &["recovered.mcap"]), [(7, audio.clone())]);
    assert_eq!(folder.headrace(&["trim", LOG, "--anonymise", "-o", "public.mcap"]).code, Some(0));
    assert_eq!(recordings(&folder, &["public.mcap"]), [], "a voice identifies its speaker, so it is removed");
    assert!(!mentions(&folder, "public.mcap", "\"AB\""), "names of note takers are removed");
    assert!(mentions(&folder, LOG, "\"AB\""), "otherwise the check above proves nothing");

    let replay = Serving::start(&folder, &["replay", LOG, ANY]);
    let mut viewer = Viewer::connect(&replay, "", &[]).unwrap();
    viewer.until("the note", |viewer| note(viewer, 7).is_some_and(|note| note["voice"]["seconds"] == 12));
    assert_eq!(replay.get("/voice/7"), audio);
    assert_eq!(replay.ask("GET", "/voice/8", &[], "").0, 404);
    assert_eq!(upload(&replay, 7, &[], &audio).0, 403, "a replay accepts no voice note");

    let exported = folder.headrace(&["export", LOG, "--html", "dive.html"]);
    assert!(!exported.stdout.contains("left out"), "{}", exported.stdout);
    let (spoken, silent) = (folder.read("dive.html").len(), {
        folder.headrace(&["export", "silent.mcap", "--html", "silent.html"]);
        folder.read("silent.html").len()
    });
    // In the exported page, the voice recording is encoded as base64, then compressed, and then encoded as base64
    // again.
    assert!(spoken > silent + audio.len(), "{spoken} and {silent} bytes: the page doesn't contain the voice");
}

#[test]
fn notes_command_writes_voice_files_and_overwrites_nothing() {
    let folder = Folder::new();
    let serving = demo(&folder, &[]);
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until("a place", |viewer| viewer.state["position"]["chainage_m"].is_number());
    viewer.send(&json!({"do": "note", "text": "rubble left", "by": "AB"}));
    begin(&mut viewer, 7);
    let audio = webm(2, 40_000);
    assert_eq!(upload(&serving, 7, &[], &audio).0, 200);
    viewer.until("its length", |viewer| note(viewer, 7).is_some_and(|note| note["voice"]["seconds"] == 12));
    begin(&mut viewer, 8);
    viewer.until("the next", |viewer| note(viewer, 8).is_some());
    let place = note(&viewer, 7).unwrap()["station"].as_str().unwrap().to_owned();
    interrupt(serving, &mut viewer);

    let answer = folder.headrace(&["notes", LOG, "--out", "voices"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    assert_eq!(folder.read("voices/note-2.webm"), audio);
    let lines: Vec<&str> = answer.stdout.lines().collect();
    assert!(lines[0].starts_with("   1  ") && lines[0].ends_with("note: rubble left (AB)"), "{lines:#?}");
    assert!(lines[1].contains(&place), "{lines:#?}");
    assert!(lines[1].ends_with("voice, 12 s (AB): voices/note-2.webm"), "{lines:#?}");
    assert!(lines[2].ends_with("  voice (AB)"), "{lines:#?}");
    assert_eq!(lines[3], "3 notes, 1 with a recording");
    folder.write("voices/note-2.webm", "mine");
    let refused = folder.headrace(&["notes", LOG, "--out", "voices"]);
    assert_eq!(refused.code, Some(2));
    assert!(refused.stderr.contains("voices/note-2.webm: it exists"), "{}", refused.stderr);
    assert_eq!(folder.read("voices/note-2.webm"), b"mine");
    let forced = folder.headrace(&["notes", LOG, "--out", "voices", "--force", "--json"]);
    assert_eq!(folder.read("voices/note-2.webm"), audio);
    let report: Value = serde_json::from_str(&forced.stdout).unwrap();
    let recording =
        json!({"seconds": 12, "media_type": "audio/webm", "bytes": 40_000, "file": "voices/note-2.webm"});
    assert_eq!(report["notes"][1]["recording"], recording);
    assert_eq!((&report["notes"][2]["recording"], &report["lost"]), (&Value::Null, &json!([])));
    without_voices(&folder, LOG, "silent.mcap");
    let silent = folder.headrace(&["notes", "silent.mcap"]);
    assert_eq!(silent.code, Some(3));
    assert!(silent.stdout.contains("lost  note 2: its recording isn't in the log"), "{}", silent.stdout);
}

#[test]
fn voice_recording_needs_an_operator_and_a_begun_note() {
    let folder = Folder::new();
    folder.write("tokens", TOKENS);
    let serving = demo(&folder, &["--page-token-file", "tokens"]);
    let mut viewer = Viewer::connect(&serving, "?token=operator-0123456789abcdef", &[]).unwrap();
    viewer.until_begun();
    let audio = webm(3, 2000);
    let viewers = "Authorization: Bearer viewer-0123456789abcdef";
    assert_eq!(upload(&serving, 9, &[OPERATOR], &audio).0, 409, "not begun");
    begin(&mut viewer, 9);
    for (headers, status) in [
        (&[][..], 401),
        (&["Authorization: Bearer operator-0123456789abcdee"], 401),
        (&[viewers], 403),
        (&[OPERATOR, "Origin: http://evil.example"], 403),
        (&[OPERATOR, "Host: evil.example"], 421),
        (&[OPERATOR, "Content-Length: 524289"], 413),
    ] {
        assert_eq!(upload(&serving, 9, headers, &[]).0, status, "{headers:?}");
    }
    let post = |path: &str, kind: &str, body: &[u8]| {
        let (status, answer) = serving.ask("POST", path, &[OPERATOR, kind], body);
        (status, answer.split("\r\n\r\n").nth(1).unwrap_or_default().to_owned())
    };
    for (path, kind, status, words) in [
        ("/voice/9?seconds=12", "Content-Type: text/html", 415, "of type \\\"text/html\\\""),
        ("/voice/9?seconds=12", "Accept: */*", 415, "expected audio/webm, audio/ogg or audio/mp4"),
        ("/voice/9", WEBM, 400, "needs seconds"),
        ("/voice/nine?seconds=12", WEBM, 400, "no id of a voice note"),
        ("/voice/9?seconds=61", WEBM, 400, "of 61 s; expected 1 to 60 s"),
    ] {
        let (found, answer) = post(path, kind, &audio);
        assert!(found == status && answer.contains(words), "{path} {kind}: {found} {answer}");
    }
    let (status, answer) = post("/voice/9?seconds=12", WEBM, b"<script>alert(1)</script>");
    assert!(status == 415 && answer.contains("aren't audio/webm"), "{answer}");
    let chunked = [b"80001\r\n".to_vec(), webm(4, 0x8_0001), b"\r\n".to_vec()].concat();
    let headers = [OPERATOR, WEBM, "Transfer-Encoding: chunked"];
    assert_eq!(serving.ask("POST", "/voice/9?seconds=12", &headers, chunked).0, 413);
    assert_eq!(upload(&serving, 9, &[OPERATOR], &audio).0, 200, "no refused recording replaced the note");
    assert_eq!(upload(&serving, 9, &[OPERATOR], &webm(5, 2000)).0, 409, "it has its recording");
    assert_eq!(serving.ask("GET", "/voice/9", &[], "").0, 401);
    viewer.until("its length", |viewer| note(viewer, 9).is_some_and(|note| note["voice"]["seconds"] == 12));
    let (status, answer) = serving.ask("GET", "/voice/9", &[viewers], "");
    assert!(status == 200 && answer.contains("content-type: audio/webm"), "{answer}");
    let page = serving.ask("GET", "/", &[], "").1;
    assert!(page.contains("permissions-policy: microphone=(self)"), "{page}");
    let flood: Vec<u16> = (0..20).map(|id| upload(&serving, 100 + id, &[OPERATOR], &audio).0).collect();
    assert_eq!(flood.last(), Some(&429));
    viewer.send(&json!({"do": "mark", "by": "AB"}));
    viewer.until("the page goes on", |viewer| viewer.others.iter().any(|other| other["do"] == "mark"));
    interrupt(serving, &mut viewer);
    assert_eq!(recordings(&folder, &[LOG]), [(9, audio)]);
}

#[test]
fn voice_note_of_an_unrecorded_dive_is_refused() {
    let folder = Folder::with_dive();
    let serving = Serving::start(&folder, &["run", "vehicle.toml", "--no-record", ANY]);
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_type("ready");
    begin(&mut viewer, 7);
    let (status, answer) = upload(&serving, 7, &[], &webm(1, 2000));
    assert!(status == 409 && answer.contains("this dive isn't recorded"), "{answer}");
}

#[test]
fn damaged_voice_note_loses_only_itself() {
    let folder = Folder::new();
    let serving = demo(&folder, &[]);
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_begun();
    begin(&mut viewer, 7);
    let audio = webm(6, 100_000);
    assert_eq!(upload(&serving, 7, &[], &audio).0, 200);
    viewer.until("its length", |viewer| note(viewer, 7).is_some_and(|note| note["voice"]["seconds"] == 12));
    let end = interrupt(serving, &mut viewer);
    let mut log = folder.read(LOG);
    let piece = &audio[50_000..50_032];
    let at = log.windows(32).position(|window| window == piece).expect("noise is stored uncompressed");
    log[at] ^= 1;
    folder.write("damaged.mcap", log);
    let (code, replayed) = folder.replay("damaged.mcap", &[]);
    assert_eq!((code, &replayed["digest"]), (Some(3), &end["digest"]), "{}", replayed["log"]["losses"]);
    assert_eq!(replayed["notes"][0]["voice"]["seconds"], 12);
    let answer = folder.headrace(&["notes", "damaged.mcap", "--out", "voices"]);
    assert_eq!(answer.code, Some(3));
    assert!(answer.stdout.contains("note 1: its recording isn't in the log"), "{}", answer.stdout);
    let replay = Serving::start(&folder, &["replay", "damaged.mcap", ANY]);
    let mut viewer = Viewer::connect(&replay, "", &[]).unwrap();
    viewer.until("the note", |viewer| note(viewer, 7).is_some_and(|note| note["voice"]["seconds"] == 12));
    assert_eq!(replay.ask("GET", "/voice/7", &[], "").0, 404);
}

#[test]
fn voice_note_is_in_the_log_part_of_its_time() {
    let folder = Folder::with_dive();
    std::fs::create_dir(folder.path("parts")).unwrap();
    let arguments = ["run", "vehicle.toml", ANY, "--record", "parts/dive.mcap", "--rotate", "1s"];
    let serving = Serving::start(&folder, &arguments);
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_type("ready");
    let mut speak = |id: u32, audio: &[u8]| {
        begin(&mut viewer, id);
        assert_eq!(upload(&serving, id, &[], audio).0, 200);
        viewer.until("its length", |viewer| {
            note(viewer, id).is_some_and(|note| note["voice"]["seconds"] == 12)
        });
        viewer.others.clear();
    };
    let audio = [webm(1, 90_000), webm(2, 90_000)];
    speak(7, &audio[0]);
    // No device is connected, so the dive records nothing but operator commands.
    while !folder.path("parts/dive.part002.mcap").exists() {
        // The commands make the log grow. They are sent as fast as the page allows an operator to send them.
        let (status, answer) = serving.ask("POST", "/actions/silence", &[], "{}");
        assert!([200, 429].contains(&status), "{answer}");
    }
    speak(8, &audio[1]);
    let end = interrupt(serving, &mut viewer);
    let [first, second] = audio;
    assert_eq!(recordings(&folder, &["parts/dive.part001.mcap"]), [(7, first.clone())]);
    let parts = std::fs::read_dir(folder.path("parts")).unwrap().count();
    let names: Vec<String> = (1..=parts).map(|part| format!("parts/dive.part{part:03}.mcap")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    assert_eq!(recordings(&folder, &names), [(7, first), (8, second.clone())]);
    assert_eq!(folder.replay("parts", &[]).1["digest"], end["digest"]);
    assert_eq!(folder.headrace(&["notes", "parts", "--out", "voices"]).code, Some(0));
    assert_eq!(folder.read("voices/note-2.webm"), second);
    let replay = Serving::start(&folder, &["replay", "parts", ANY]);
    let mut viewer = Viewer::connect(&replay, "", &[]).unwrap();
    viewer.until("the note", |viewer| note(viewer, 8).is_some_and(|note| note["voice"]["seconds"] == 12));
    assert_eq!(replay.get("/voice/8"), second);
}
