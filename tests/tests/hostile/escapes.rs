//! Names from outside the program may contain terminal control codes. The program escapes these codes on the display,
//! so that each name stays on a single line.

use headrace_tests::{Folder, VEHICLE, raw_messages, write_log};
use mcap::WriteOptions;

use crate::records::{attachment, channel, log, message, metadata};
use crate::run::run;

/// Control codes that hostile names contain. They clear the screen, set the window title, ring the bell, return the
/// carriage, change the text direction, and begin a new line.
const EVIL: &str = "a\x1b[2J\x1b]0;t\x07\rb\u{9b}31m\u{202e}c\u{2066}\ndigest 0000000000000000";

#[track_caller]
fn is_plain(what: &str, text: &str) {
    let wrong = text.chars().find(|c| (c.is_control() && *c != '\n') || matches!(c, '\u{202e}' | '\u{2066}'));
    assert_eq!(wrong, None, "{what}: {text:?}");
    assert!(!text.lines().any(|line| line.starts_with("digest 0000")), "{what}: {text}");
}

#[test]
fn control_codes_in_log_names_are_escaped() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let entry = |key: &str| std::iter::once((key.to_owned(), EVIL.to_owned()));
    let stated = std::iter::once(("000000".to_owned(), format!("- - {EVIL}")));
    let mut torn = attachment(EVIL, b"data");
    let last = torn.len() - 1;
    torn[last] = 1;
    let records = [
        metadata(EVIL, entry(EVIL)),
        metadata("headrace.losses", stated),
        metadata("headrace", entry("version")),
        torn,
        channel(1, &format!("/raw/{EVIL}"), &[0; 4]),
        channel(2, &format!("/raw/{EVIL}"), &[0; 4]),
        channel(3, &format!("/result/{EVIL}"), &[0; 4]),
        message(1, 5, b"a"),
        message(3, 5, b"a"),
    ];
    folder.write("evil.mcap", log(&records));
    for arguments in [
        &["replay", "evil.mcap", "--vehicle", "vehicle.toml"][..],
        &["replay", "evil.mcap", "--vehicle", "vehicle.toml", "--json"],
        &["replay", "evil.mcap", "--vehicle", "vehicle.toml", "--json-lines"],
        &["verify", "evil.mcap", "--vehicle", "vehicle.toml"],
        &["verify", "evil.mcap", "--vehicle", "vehicle.toml", "--json"],
        &["recover", "evil.mcap", "-o", "x.mcap", "--force"],
        &["recover", "evil.mcap", "-o", "x.mcap", "--force", "--json"],
        &["replay", "evil.mcap", "--vehicle", "vehicle.toml", "-vv"],
    ] {
        let ran = run(&folder, arguments);
        is_plain(&format!("{arguments:?}"), &ran.stdout);
        is_plain(&format!("{arguments:?}"), &ran.log);
        let shown = arguments.contains(&"--json-lines") || ran.stdout.contains("\\u001b");
        assert!(shown, "{arguments:?}: the name isn't shown: {}", ran.stdout);
        if arguments.contains(&"--json") {
            let value: serde_json::Value = serde_json::from_str(&ran.stdout).unwrap();
            assert!(value.to_string().contains("digest 0000"), "JSON has the name as it is");
        }
    }
}

#[test]
fn control_codes_in_file_names_and_contents_are_escaped() {
    let folder = Folder::with_dive();
    let dive = folder.read("dive.mcap");
    let vehicle = VEHICLE.replacen("name = ", "name = \"a\\u001b[2J\" # ", 1);
    write_log(
        &folder.path("evil\x1b[2J\n\u{202e}.mcap"),
        WriteOptions::new(),
        Some(&vehicle),
        &raw_messages(&dive),
    );
    folder.write(
        "evil\x1b[2J.toml",
        format!("{VEHICLE}\"k\\u001b[2J\\u0007\\ndigest 0000\" = 1\n\"\u{202e}\" = 2\n"),
    );
    folder.write("broken.toml", "a = \"\u{202e}\u{9b}\n");
    for arguments in [
        &["replay", "evil\x1b[2J\n\u{202e}.mcap"][..],
        &["replay", "evil\x1b[2J\n\u{202e}.mcap", "--vehicle", "vehicle.toml"],
        &["recover", "evil\x1b[2J\n\u{202e}.mcap", "-o", "x\x1b[2J.mcap"],
        &["trim", "evil\x1b[2J\n\u{202e}.mcap", "-o", "y\x1b[2J.mcap", "--from", "1s"],
        &["check", "evil\x1b[2J.toml"],
        &["check", "broken.toml"],
        &["check", "not\x1b[2J\nthere.toml"],
        &["import", "not\x1b[2J.tlog", "--source", "a=mavlink", "-o", "z.mcap"],
    ] {
        let ran = run(&folder, arguments);
        is_plain(&format!("{arguments:?}"), &ran.stdout);
        is_plain(&format!("{arguments:?}"), &ran.log);
    }
    // Names in a vehicle file may not contain control codes.
    folder.write("evil.toml", &vehicle);
    let ran = run(&folder, &["check", "evil.toml"]);
    assert_eq!(ran.code, Some(2));
    assert!(ran.stderr.contains("must be without control characters"), "{}", ran.stderr);
}
