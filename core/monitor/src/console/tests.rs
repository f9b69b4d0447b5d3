use super::*;
use proptest::prelude::*;
use serde_json::json;

fn who(text: &str) -> Who {
    Who::new(text).unwrap()
}

#[test]
fn console_commands_are_parsed_as_documented() {
    let note = |text: &str| Command::Note { text: NoteText::new(text).unwrap(), by: who("AB") };
    for (json, command) in [
        (r#"{"do":"acknowledge","alert":12,"by":"AB"}"#, Command::Acknowledge { alert: 12, by: who("AB") }),
        (
            r#" { "by" : "AB" , "alert" : 0 , "do" : "acknowledge" } "#,
            Command::Acknowledge { alert: 0, by: who("AB") },
        ),
        (r#"{"do":"silence","by":""}"#, Command::Silence { by: who("") }),
        (r#"{"do":"note","text":"rubble left","by":"AB"}"#, note("rubble left")),
        (r#"{"do":"note","text":"\u00e9\ud83d\ude00 \"\\\/","by":"AB"}"#, note("\u{e9}\u{1f600} \"\\/")),
        (
            r#"{"do":"mark","by":"joystick"}"#,
            Command::Note { text: NoteText::default(), by: who("joystick") },
        ),
        (r#"{"do":"voice","id":4294967295,"by":"AB"}"#, Command::Voice { id: u32::MAX, by: who("AB") }),
        (r#"{"do":"voiced","id":7,"seconds":60}"#, Command::Voiced { id: 7, seconds: 60 }),
        (r#"{"do":"stalled","seconds":2}"#, Command::Stalled { seconds: 2 }),
        (r#"{"do":"recording","fails":true}"#, Command::Recording { fails: true }),
        (r#"{"do":"limits","battery_pct":63.5}"#, Command::Limits { battery_pct: 63.5 }),
        (r#"{"do":"time"}"#, Command::Time),
    ] {
        assert_eq!(Command::parse(json.as_bytes()), Ok(command), "{json}");
        assert_eq!(Command::parse(command.to_json().as_bytes()), Ok(command));
    }
}

#[test]
fn console_accepts_notes_until_the_report_is_full() {
    let waiting = Arc::new(ArrayQueue::new(MOST_WAITING));
    let port = ConsolePort { waiting: Arc::clone(&waiting), clock: None, notes: Arc::default() };
    let other = port.clone();
    let note = Command::Note { text: NoteText::default(), by: who("AB") };
    let voice = Command::Voice { id: 7, by: who("AB") };
    let mut taken = 0;
    for _ in 0..MOST_NOTES {
        taken +=
            [(&port, note), (&other, voice)].iter().filter(|(port, note)| port.send(note).is_ok()).count();
        while waiting.pop().is_some() {}
    }
    assert_eq!(taken, MOST_NOTES);
    assert_eq!(port.send(&note), Err(ConsoleError::MostNotes));
    assert_eq!(port.send(&Command::Silence { by: who("AB") }), Ok(()), "other commands are still accepted");
}

#[test]
fn note_refused_by_a_full_queue_is_not_counted() {
    let port = ConsolePort { waiting: Arc::new(ArrayQueue::new(1)), clock: None, notes: Arc::default() };
    let note = Command::Note { text: NoteText::default(), by: who("AB") };
    assert_eq!(port.send(&note), Ok(()));
    for _ in 0..2 * MOST_NOTES {
        assert_eq!(port.send(&note), Err(ConsoleError::Full));
    }
}

#[test]
fn error_for_an_invalid_command_gives_the_first_wrong_byte() {
    let long = format!(r#"{{"do":"note","text":"{}","by":"AB"}}"#, "x".repeat(241));
    let longest = format!(r#"{{"do":"time"{}}}"#, " ".repeat(500));
    for json in [
        "",
        "{}",
        "[]",
        "null",
        r#"{"do":"time"}x"#,
        r#"{"do":"time",}"#,
        r#"{"do":"time""#,
        "{'do':'time'}",
        r#"{"do":"dance","by":"AB"}"#,
        r#"{"do":"silence"}"#,
        r#"{"do":"silence","by":"AB","by":"AB"}"#,
        r#"{"do":"silence","by":"AB","at":3}"#,
        r#"{"do":"silence","by":"seventeen letters"}"#,
        r#"{"do":"silence","by":7}"#,
        r#"{"do":"acknowledge","alert":-1,"by":"AB"}"#,
        r#"{"do":"acknowledge","alert":1.5,"by":"AB"}"#,
        r#"{"do":"acknowledge","alert":4294967296,"by":"AB"}"#,
        r#"{"do":"acknowledge","alert":012,"by":"AB"}"#,
        r#"{"do":"acknowledge","alert":"1","by":"AB"}"#,
        r#"{"do":"limits","battery_pct":101}"#,
        r#"{"do":"limits","battery_pct":NaN}"#,
        r#"{"do":"limits","battery_pct":1e1}"#,
        r#"{"do":"recording","fails":1}"#,
        r#"{"do":"note","text":"","by":"AB"}"#,
        r#"{"do":"note","text":"a","by":"AB","id":7}"#,
        r#"{"do":"voice","id":0,"by":"AB"}"#,
        r#"{"do":"voice","id":4294967296,"by":"AB"}"#,
        r#"{"do":"voice","id":7}"#,
        r#"{"do":"voice","id":7,"by":"AB","seconds":1}"#,
        r#"{"do":"voice","id":7,"by":"AB","text":"a"}"#,
        r#"{"do":"voiced","id":7,"seconds":0}"#,
        r#"{"do":"voiced","id":7,"seconds":61}"#,
        r#"{"do":"voiced","id":7,"seconds":1,"by":"AB"}"#,
        r#"{"do":"voiceless","id":7,"seconds":1}"#,
        r#"{"do":"note","text":"a\nb","by":"AB"}"#,
        "{\"do\":\"note\",\"text\":\"\u{1b}[2J\",\"by\":\"AB\"}",
        r#"{"do":"note","text":"\ud83d","by":"AB"}"#,
        r#"{"do":"note","text":"\x","by":"AB"}"#,
        &long,
        &longest,
    ] {
        assert!(Command::parse(json.as_bytes()).is_err(), "{json}");
    }
    assert!(Command::parse(b"{\"do\":\"silence\",\"by\":\"\xff\"}").is_err());
    let error = Command::parse(br#"{"do":"silence","to":"AB"}"#).unwrap_err();
    insta::assert_snapshot!(error, @"reading a command, at byte 16: expected do, alert, by, text, fails, battery_pct, id or seconds");
}

proptest! {
    /// Every accepted command is valid JSON with the same values, as an independent JSON parser shows.
    #[test]
    fn accepted_command_is_valid_json(text in "\\PC{0,60}", by in "[ -~]{0,16}", cut in 0usize..90) {
        let written = json!({"do": "note", "text": text, "by": by}).to_string();
        let read = Command::parse(written.as_bytes());
        let fits = !text.is_empty() && text.len() <= MAX_NOTE_BYTES && written.len() <= MAX_COMMAND_BYTES;
        let has_control = text.chars().any(char::is_control);
        prop_assert_eq!(read.is_ok(), fits && !has_control, "{}", written);
        if let Ok(Command::Note { text: read, by: who }) = read {
            prop_assert_eq!((read.as_str(), who.as_str()), (text.as_str(), by.as_str()));
        }
        let bytes = &written.as_bytes()[..cut.min(written.len() - 1)];
        prop_assert!(Command::parse(bytes).is_err());
    }

    #[test]
    fn accepted_random_packet_is_valid_json(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        if Command::parse(&bytes).is_ok() {
            prop_assert!(serde_json::from_slice::<serde_json::Value>(&bytes).is_ok());
        }
    }
}
