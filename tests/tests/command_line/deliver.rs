//! The report that `headrace deliver` writes: equal bytes, numbers of the JSON report, losses, and facts for the cover.

use std::collections::BTreeSet;

use headrace_tests::{Folder, root};
use serde_json::Value;

const FILES: [&str; 3] = ["report.html", "report.pdf", "report.json"];

/// A folder with a golden log as `dive.mcap`.
fn golden(name: &str) -> Folder {
    let folder = Folder::new();
    folder.write("dive.mcap", std::fs::read(root().join(format!("tests/golden/{name}.mcap"))).unwrap());
    folder
}

fn deliver(folder: &Folder, further: &[&str]) -> String {
    let answer = folder.headrace(&[&["deliver", "dive.mcap", "-o", "out"], further].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    String::from_utf8(folder.read("out/report.html")).unwrap()
}

/// Texts of the report's elements of one kind, such as the cells of its tables.
fn texts<'a>(page: &'a str, element: &str) -> Vec<&'a str> {
    let (begin, end) = (format!("<{element}"), format!("</{element}>"));
    let within = |rest: &'a str| rest.split_once('>').unwrap().1.split_once(&end).unwrap().0;
    page.split(&begin).skip(1).map(within).collect()
}

/// The report's text without its figures. Digests and checksums are left out.
fn plain(page: &str) -> String {
    let (_, body) = page.split_once("<body>").unwrap();
    let mut text = String::new();
    for (number, part) in body.split("<svg").enumerate() {
        let part = if number == 0 { part } else { part.split_once("</svg>").unwrap().1 };
        text.push_str(
            &part.replace("</td><td", " | <td").replace("</th><th", " | <th").replace("</dt><dd>", ": "),
        );
    }
    let mut lines = Vec::new();
    for line in text.lines() {
        let words = line.split('<').map(|piece| piece.split_once('>').map_or(piece, |(_, words)| words));
        let is_digest = |word: &str| word.len() >= 16 && word.chars().all(|c| c.is_ascii_hexdigit());
        let words = words.collect::<String>();
        let words = words.split(' ').map(|word| if is_digest(word) { "#" } else { word });
        lines.push(words.collect::<Vec<_>>().join(" "));
    }
    lines.retain(|line| !line.trim().is_empty());
    lines.join("\n")
}

fn numbers_of(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Number(number) => numbers.extend(number.as_f64()),
        Value::Array(values) => values.iter().for_each(|value| numbers_of(value, numbers)),
        Value::Object(values) => values.values().for_each(|value| numbers_of(value, numbers)),
        _ => {}
    }
}

/// A number as printed, in metres if it is a station.
fn printed(word: &str) -> Option<String> {
    // Words such as `sonar_0` and checksums aren't numbers.
    let word = word.trim_matches(|c: char| !c.is_ascii_alphanumeric() && c != '-');
    if !word.chars().all(|c| c.is_ascii_digit() || "+-.".contains(c)) {
        return None;
    }
    let number = match word.split_once('+') {
        Some((kilometres, metres)) => {
            let metres = 1000.0 * kilometres.parse::<f64>().ok()? + metres.parse::<f64>().ok()?;
            format!("{metres:.2}")
        }
        None => word.to_owned(),
    };
    number.parse::<f64>().is_ok().then_some(number)
}

#[test]
fn two_deliveries_have_identical_bytes() {
    let folder = golden("too-fast");
    deliver(&folder, &[]);
    let once = FILES.map(|name| folder.read(&format!("out/{name}")));
    deliver(&folder, &["--force", "--threads", "1"]);
    for (name, once) in FILES.iter().zip(once) {
        assert!(folder.read(&format!("out/{name}")) == once, "{name}");
    }
    assert!(folder.read("out/report.pdf").starts_with(b"%PDF-1.7"));
}

/// Every number in a table or beside a name must be a number of the JSON report, rounded to the digits that are
/// printed.
#[test]
fn numbers_of_the_report_are_those_of_the_json() {
    let mut compared = 0;
    for name in ["too-fast", "stalls", "steel"] {
        let folder = golden(name);
        let page = deliver(&folder, &[]);
        let json: Value = serde_json::from_slice(&folder.read("out/report.json")).unwrap();
        assert_eq!(json, {
            let mut replayed = folder.replay("dive.mcap", &[]).1;
            replayed["begun_utc"] = json["begun_utc"].clone();
            replayed
        });
        let mut values = Vec::new();
        numbers_of(&json, &mut values);
        // Shares are printed as percentages.
        let values: Vec<f64> = values.iter().flat_map(|value| [*value, 100.0 * value]).collect();
        let known: BTreeSet<String> = (0..=3)
            .flat_map(|decimals: usize| values.iter().map(move |value| format!("{value:.decimals$}")))
            .collect();
        for text in ["td", "dd"].iter().flat_map(|element| texts(&page, element)) {
            for number in text.split([' ', '/']).filter_map(printed) {
                assert!(known.contains(&number), "{name}: {number} of {text:?} isn't in report.json");
                compared += 1;
            }
        }
    }
    assert!(compared > 300, "{compared} numbers");
}

#[test]
fn report_states_missed_stretches_and_limits_of_the_inspection() {
    let folder = golden("too-fast");
    folder.write(
        "about.toml",
        "plant = \"Ceran\"\nclient = \"Owner & Sons\"\ndate = \"30 November 2026\"\ncrew = [\"A. Berg\", \"B. Dal\"]\n",
    );
    let page = deliver(&folder, &["--about", "about.toml", "--tunnel", "headrace", "--plant", "Monte"]);
    assert!(page.contains("<dd>A. Berg, B. Dal</dd>") && page.contains("<dd>Owner &amp; Sons</dd>"));
    assert!(page.contains("<dd>Monte</dd>") && !page.contains("Ceran"), "the option overrides the file");
    insta::assert_snapshot!(plain(&page));
}

#[test]
fn delivery_of_a_damaged_log_names_the_loss_and_exits_with_3() {
    let folder = golden("too-fast");
    let whole = folder.read("dive.mcap");
    folder.write("dive.mcap", &whole[..whole.len() / 2]);
    let answer = folder.headrace(&["deliver", "dive.mcap", "-o", "out"]);
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    let json: Value = serde_json::from_slice(&folder.read("out/report.json")).unwrap();
    let page = String::from_utf8(folder.read("out/report.html")).unwrap();
    let losses = json["log"]["losses"].as_array().unwrap();
    assert!(!losses.is_empty());
    for loss in losses.iter().map(|loss| loss.as_str().unwrap()) {
        assert!(answer.stdout.contains(&format!("LOST: {loss}")), "{}", answer.stdout);
        assert!(texts(&page, "li").contains(&loss), "{loss}");
    }
    assert!(page.contains("<p class=\"warning\">Data of this dive were lost"), "{page}");
}

#[test]
fn facts_that_nobody_states_are_left_out() {
    let page = deliver(&golden("murk"), &[]);
    let names = texts(&page, "dt");
    assert!(names.contains(&"Vehicle"), "{names:?}");
    for name in ["Plant", "Tunnel", "Client", "Date", "Crew"] {
        assert!(!names.contains(&name), "{name}");
    }
    assert!(page.contains("not stated in the log"), "the log of a simulation has no date");
}

#[test]
fn forced_delivery_leaves_no_file_of_the_earlier_one() {
    let folder = golden("murk");
    deliver(&folder, &[]);
    assert!(folder.path("out/map.png").exists());
    folder.headrace(&["trim", "dive.mcap", "--to", "1", "-o", "short.mcap"]);
    let answer = folder.headrace(&["deliver", "short.mcap", "-o", "out", "--force"]);
    assert_eq!(answer.code, Some(3), "the log states what was cut off: {}", answer.stderr);
    let mut names: Vec<_> =
        std::fs::read_dir(folder.path("out")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert!(
        names.len() > 10 && names.iter().all(|name| !name.to_string_lossy().starts_with("map.")),
        "{names:?}"
    );
    assert!(!folder.path("out/.unfinished").exists());
}

#[test]
fn refused_delivery_keeps_the_earlier_one() {
    let folder = golden("murk");
    let report = deliver(&folder, &[]);
    let answer = folder.headrace(&["deliver", "dive.mcap", "-o", "out", "--force", "--every", "0.001"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("--every"), "{}", answer.stderr);
    assert_eq!(folder.read("out/report.html"), report.as_bytes());
    assert!(!folder.path("out/.unfinished").exists());
}

#[test]
fn delivery_without_its_facts_or_an_empty_folder_is_refused() {
    let folder = golden("murk");
    let refused = |further: &[&str], word: &str| {
        let answer = folder.headrace(&[&["deliver", "dive.mcap", "-o", "out"], further].concat());
        assert_eq!(answer.code, Some(2), "{further:?}: {}", answer.stderr);
        assert!(answer.stderr.contains(word), "{further:?}: {}", answer.stderr);
    };
    refused(&["--about", "none.toml"], "none.toml");
    folder.write("about.toml", "plnat = \"Ceran\"\n");
    refused(&["--about", "about.toml"], "about.toml:1: plnat");
    for broken in [&b"plant = \"\xff\""[..], b"plant", b"crew = \"A. Berg\"", &[0; 100]] {
        folder.write("about.toml", broken);
        refused(&["--about", "about.toml"], "about.toml");
    }
    assert!(!folder.path("out").exists());
    std::fs::create_dir(folder.path("out")).unwrap();
    folder.write("out/other.txt", "mine");
    refused(&[], "--force");
    assert_eq!(std::fs::read_dir(folder.path("out")).unwrap().count(), 1);
}
