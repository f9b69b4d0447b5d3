//! Viewers don't influence the dive. The results are the same with a stalled viewer, with a flooding viewer, and
//! without viewers.

use std::net::TcpListener;

use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer};
use serde_json::Value;
use tungstenite::Message;

use crate::address::ANY;

#[test]
fn stalled_and_flooding_viewers_do_not_change_results() {
    let folder = Folder::new();
    let bare = folder.headrace(&["demo", "--speed", "max", "--out", "bare"]);
    assert_eq!(bare.code, Some(0), "{}", bare.stderr);
    let serving = Serving::start(&folder, &["demo", ANY, "--no-open", "--speed", "400x", "--out", "watched"]);
    // These viewers are connected, but never read.
    let _stalled: Vec<Viewer> = (0..8).map(|_| Viewer::connect(&serving, "", &[]).unwrap()).collect();
    let mut flooding = Viewer::connect(&serving, "", &[]).unwrap();
    while flooding.send_raw(Message::Text("x".repeat(4000).into())).is_ok() {}
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    let end = viewer.until_type("end");
    let (code, printed) = serving.end();
    assert_eq!(code, bare.code, "{printed}");
    let digest = |name: &str| serde_json::from_slice::<Value>(&folder.read(name)).unwrap()["digest"].clone();
    assert_eq!(digest("bare/report.json"), digest("watched/report.json"));
    assert_eq!(end["digest"], digest("bare/report.json"));
}

#[test]
fn stalled_viewer_is_dropped_while_others_are_served() {
    let folder = Folder::with_dive();
    let serving = Serving::start(&folder, &["replay", "dive.mcap", ANY]);
    // This viewer is connected, but never reads.
    let _stalled = Viewer::connect(&serving, "", &[]).unwrap();
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until("the end of the log", |viewer| viewer.state["playback"]["paused"] == true);
    viewer.send(&serde_json::json!({"do": "play", "command": "pause"}));
    let figure = |name: &str| {
        let (_, figures) = serving.ask("GET", "/metrics", &[], "");
        let line = figures.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.unwrap().parse::<u64>().unwrap()
    };
    // After each seek, the server sends the whole dive again. This fills the socket buffer of the stalled viewer. Ten
    // seconds after that, the server drops the viewer.
    let to_s = viewer.state["playback"]["to_s"].as_f64().unwrap();
    for jump in 0..600 {
        let to_s = to_s - f64::from(jump % 2) * 2.0;
        viewer.send(&serde_json::json!({"do": "play", "command": "seek", "to_s": to_s}));
        viewer.until_type("ready");
        std::thread::sleep(std::time::Duration::from_millis(60));
        if jump % 20 == 19 && figure("headrace_page_stalled_total") > 0 {
            break;
        }
    }
    assert_eq!((figure("headrace_page_stalled_total"), figure("headrace_page_viewers")), (1, 1));
    viewer.send(&serde_json::json!({"do": "play", "command": "end"}));
    viewer.until_type("end");
    serving.end();
}

#[test]
fn taken_port_is_reported_and_the_next_one_used() {
    let folder = Folder::with_dive();
    let (taken, port) = loop {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        if port < 65_000 {
            break (listener, port);
        }
    };
    let page = format!("--page=127.0.0.1:{port}");
    let serving = Serving::start(&folder, &["replay", "dive.mcap", &page]);
    assert_ne!(serving.address, format!("127.0.0.1:{port}"));
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_begun();
    viewer.send(&serde_json::json!({"do": "play", "command": "end"}));
    viewer.until_type("end");
    serving.end();
    drop(taken);
    let wrong = ["--page", "--page-cert", "none.pem", "--page-key", "none.pem"];
    let answer = folder.headrace(&[&["replay", "dive.mcap"], wrong.as_slice()].concat());
    assert!(matches!(answer.code, Some(0 | 1)), "{}", answer.stderr);
    assert!(
        answer.stderr.contains("none.pem") && answer.stderr.contains("goes on without the page"),
        "{}",
        answer.stderr
    );
}

#[test]
fn page_is_off_by_default_without_a_terminal() {
    let folder = Folder::with_dive();
    let answer = folder.headrace(&["replay", "dive.mcap", "--speed", "50x"]);
    assert!(!answer.stdout.contains("http://") && !answer.stderr.contains("http://"));
}
