//! Access control of the page: hosts, origins, tokens, and invalid messages.

use headrace_tests::Folder;
use headrace_tests::page_client::{Serving, Viewer};
use headrace_tests::random::Random;
use serde_json::json;
use tungstenite::Message;

use crate::address::ANY;

const TOKENS: &str = "operator = operator-0123456789abcdef\nviewer = viewer-0123456789abcdef\n";

#[test]
fn requests_to_undeclared_hosts_or_from_undeclared_origins_are_refused() {
    let folder = Folder::with_dive();
    let serving = Serving::start(&folder, &["replay", "dive.mcap", ANY]);
    let status = |method, path, headers: &[&str]| serving.ask(method, path, headers, "").0;
    assert_eq!(status("GET", "/", &[]), 200);
    for path in ["/", "/feed", "/state.json", "/samples?from_m=0&to_m=1", "/register_service"] {
        assert_eq!(status("GET", path, &["Host: evil.example"]), 421, "{path}");
        assert_eq!(status("GET", path, &["Host: 127.0.0.1.evil.example:80"]), 421, "{path}");
    }
    let evil = "Origin: http://evil.example";
    assert_eq!(status("POST", "/actions/mark", &[evil]), 403);
    assert_eq!(status("GET", "/feed", &[evil]), 403);
    assert!(Viewer::connect(&serving, "", &[("Origin", "http://evil.example")]).is_err());
    let own = format!("http://{}", serving.address);
    assert!(Viewer::connect(&serving, "", &[("Origin", &own)]).is_ok());
    assert_eq!(status("POST", "/actions/mark", &[]), 403, "a replay accepts no commands");
}

#[test]
fn client_without_a_token_gets_nothing_of_the_dive() {
    let folder = Folder::with_dive();
    folder.write("tokens", TOKENS);
    let serving = Serving::start(&folder, &["replay", "dive.mcap", ANY, "--page-token-file", "tokens"]);
    for path in ["/feed", "/feed.jsonl", "/state.json", "/samples?from_m=0&to_m=1", "/metrics"] {
        let (status, answer) =
            serving.ask("GET", path, &["Authorization: Bearer operator-0123456789abcdee"], "");
        assert_eq!(status, 401, "{path}");
        assert!(!answer.contains("dive"), "{answer}");
    }
    assert_eq!(serving.ask("POST", "/actions/mark", &[], "").0, 401);
    assert_eq!(serving.ask("GET", "/widget/assets/page.js", &[], "").0, 200);
    for path in ["/", "/widget/alerts", "/register_service", "/cockpit_extras.json"] {
        let (status, answer) = serving.ask("GET", path, &[], "");
        assert_eq!(status, 200, "{path}");
        assert!(!answer.contains("short") && !answer.contains("0123456789"), "{answer}");
    }
    assert!(Viewer::connect(&serving, "", &[]).is_err());
    assert_eq!(serving.ask("GET", "/login?token=wrong", &[], "").0, 401);
    let (status, answer) = serving.ask("GET", "/login?token=viewer-0123456789abcdef", &[], "");
    assert_eq!(status, 303);
    let cookie = answer.lines().find(|line| line.to_lowercase().starts_with("set-cookie: ")).unwrap();
    assert!(cookie.contains("HttpOnly") && cookie.contains("SameSite=Strict"), "{cookie}");
    let cookie = cookie["set-cookie: ".len()..].split(';').next().unwrap();
    let mut viewer = Viewer::connect(&serving, "", &[("Cookie", cookie)]).unwrap();
    viewer.until_type("ready");
    assert_eq!(viewer.hello["may"], json!({"operate": false, "playback": false}));
    viewer.send(&json!({"do": "play", "command": "end"}));
    viewer.until_type("refused");
    let mut operator = Viewer::connect(&serving, "?token=operator-0123456789abcdef", &[]).unwrap();
    operator.until_begun();
    assert_eq!(operator.hello["may"]["playback"], true);
    operator.send(&json!({"do": "play", "command": "end"}));
    operator.until_type("end");
    let (_, printed) = serving.end();
    assert!(!printed.contains("0123456789"), "tokens are never printed: {printed}");
}

#[test]
fn invalid_messages_are_refused_and_the_page_goes_on() {
    let folder = Folder::with_dive();
    let serving = Serving::start(&folder, &["replay", "dive.mcap", ANY]);
    let closes = |message: Message| {
        let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
        viewer.until_type("ready");
        viewer.send_raw(message).unwrap();
        viewer.until_type("refused");
        assert_eq!(viewer.until_closed().map(|(code, _)| code), Some(1008));
    };
    closes(Message::Text("rubbish".into()));
    closes(Message::Text("[1,2]".into()));
    closes(Message::Binary(vec![1, 2, 3].into()));
    closes(Message::Text(format!("{{\"do\":\"{}\"}}", "x".repeat(5000)).into()));
    // This viewer sends valid messages, but too many per second.
    let mut flood = Viewer::connect(&serving, "", &[]).unwrap();
    flood.until_type("ready");
    let mut sent = 0;
    while sent < 1000 && flood.send_raw(Message::Text(r#"{"do":"rate","hz":5}"#.into())).is_ok() {
        sent += 1;
    }
    assert!(!matches!(flood.until_closed(), Some((1000, _))));
    let mut random = Random(7);
    for _ in 0..200 {
        let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
        let length = random.below(300);
        let bytes: Vec<u8> = (0..length).map(|_| random.byte()).collect();
        let commands = [
            r#"{"do":"play","command":"seek","to_s":-1e400}"#,
            r#"{"do":"acknowledge","alert":99999999999}"#,
            "{}",
            "",
        ];
        let message = match random.below(4) {
            0 => Message::Binary(bytes.into()),
            1 => Message::Text(String::from_utf8_lossy(&bytes).into_owned().into()),
            2 => Message::Ping(bytes.into_iter().take(100).collect::<Vec<_>>().into()),
            _ => Message::Text(commands[random.below(4)].into()),
        };
        drop(viewer.send_raw(message));
    }
    let mut viewer = Viewer::connect(&serving, "", &[]).unwrap();
    viewer.until_begun();
    viewer.send(&json!({"do": "play", "command": "end"}));
    viewer.until_type("end");
    let (code, printed) = serving.end();
    assert!(matches!(code, Some(0 | 1)), "{code:?}: {printed}");
}
