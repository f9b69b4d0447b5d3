//! Trimmed logs. If nothing is cut off, a trimmed log contains the same dive. Otherwise it keeps the verdicts of the
//! stretch that is left. Anonymous logs contain no names.

use headrace_tests::{Folder, SCENE, VEHICLE, raw_messages, write_log};
use mcap::WriteOptions;
use serde_json::Value;

/// The dive takes two minutes at a steady speed, so that it has sections that aren't affected by its ends.
const LONG: &str = r#"name = "long dive"
vehicle = "vehicle.toml"

[trajectory]
start_m = 3

[[trajectory.legs]]
distance_m = 24
speed_mps = 0.2
"#;

fn recorded(scene: &str, vehicle: &str) -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", vehicle);
    folder.write("scene.toml", scene);
    folder.simulate("scene.toml", "dive.mcap");
    folder.record("dive.mcap", "live.mcap", &[]);
    folder
}

fn trim(folder: &Folder, output: &str, further: &[&str]) -> Value {
    let answer = folder.headrace(&[&["trim", "live.mcap", "--json", "-o", output], further].concat());
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    serde_json::from_str(&answer.stdout).unwrap()
}

/// Start chainage and verdict of each section that starts between two chainages.
fn within(report: &Value, from_m: f64, to_m: f64) -> Vec<(f64, String)> {
    let sections = report["sections"].as_array().unwrap().iter();
    let inside = sections.filter_map(|section| {
        let start_m = section["start_m"].as_f64().unwrap();
        let verdict = section["verdict"].as_str().unwrap().to_owned();
        (from_m..to_m).contains(&start_m).then_some((start_m, verdict))
    });
    inside.collect()
}

#[test]
fn trim_without_a_cut_keeps_the_dive_and_its_results() {
    let folder = recorded(headrace_tests::SCENE, VEHICLE);
    let digest = folder.digest("live.mcap", &[]);
    for (name, further) in
        [("copy.mcap", &[][..]), ("echoless.mcap", &["--drop-echoes"]), ("public.mcap", &["--anonymise"])]
    {
        let report = trim(&folder, name, further);
        // Alerts contain people's names, so an anonymous log leaves them out.
        let leaves_out = report["results_left_out"].as_u64().unwrap() > 0;
        assert_eq!((report["cut"].as_u64(), leaves_out), (Some(0), name == "public.mcap"), "{report}");
        assert_eq!(folder.digest(name, &[]), digest, "{name}");
        let answer = folder.headrace(&["verify", name]);
        assert_eq!(answer.code, Some(0), "{name}: {}", answer.stdout);
    }
    let answer = folder.headrace(&["trim", "live.mcap", "-o", "dive.mcap"]);
    assert!(answer.code == Some(2) && answer.stderr.contains("exists"), "{}", answer.stderr);
}

#[test]
fn trimmed_log_states_the_cut_and_keeps_the_verdicts_inside() {
    let folder = recorded(LONG, VEHICLE);
    let (_, whole) = folder.replay("live.mcap", &[]);
    let expected = within(&whole, 12.0, 19.0);
    assert_eq!(expected.len(), 28);
    for (name, further) in
        [("time.mcap", &["--from", "20s", "--to", "1.75min"][..]), ("place.mcap", &["--chainage", "7..24"])]
    {
        let report = trim(&folder, name, further);
        assert!(report["cut"].as_u64().unwrap() > 100, "{report}");
        assert!(report["results_left_out"].as_u64().unwrap() > 10, "{report}");
        assert_eq!(report["spans"].as_array().unwrap().len(), 1, "{report}");
        let (code, report) = folder.replay(name, &[]);
        let losses = report["log"]["losses"].to_string();
        assert_eq!(code, Some(3), "{name}: {losses}");
        assert!(losses.contains("earlier data was cut off by headrace trim (before "), "{losses}");
        assert!(losses.contains("later data was cut off by headrace trim (after "), "{losses}");
        assert_eq!(within(&report, 12.0, 19.0), expected, "{name}");
        let answer = folder.headrace(&["verify", name]);
        assert_eq!(answer.code, Some(1), "{}", answer.stdout);
        assert!(answer.stdout.contains("this log is an extract"), "{}", answer.stdout);
    }
    // A trimmed log states a cut at its start or end only if data was removed there.
    for (name, further, said, unsaid) in [
        ("later.mcap", ["--from", "20s"], "earlier data was cut off", "later data was cut off"),
        ("earlier.mcap", ["--to", "20s"], "later data was cut off", "earlier data was cut off"),
    ] {
        trim(&folder, name, &further);
        let losses = folder.replay(name, &[]).1["log"]["losses"].to_string();
        assert!(losses.contains(said) && !losses.contains(unsaid), "{losses}");
    }
    let answer = folder.headrace(&["trim", "live.mcap", "-o", "none.mcap", "--chainage", "60..70"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
    assert!(answer.stderr.contains("was never between 60 and 70 m"), "{}", answer.stderr);
    assert!(!folder.path("none.mcap").exists());
}

#[test]
fn trim_removes_echoes_and_keeps_ranges() {
    // The heads' messages are replaced by longer ones, which have the echo (252 bytes) with each range.
    let folder = recorded(headrace_tests::SCENE, VEHICLE);
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for message in &mut messages {
        if message.data.starts_with(b"IPX") && message.data.len() == 13 {
            let mut long = message.data.to_vec();
            (long[1], long[10], long[11]) = (b'M', 0x7C, 0x01);
            long.pop();
            long.extend(std::iter::repeat_n(0x5A, 252));
            long.push(0xFC);
            message.data = long.into();
        }
    }
    write_log(&folder.path("live.mcap"), WriteOptions::new().compression(None), Some(VEHICLE), &messages);
    let digest = folder.digest("live.mcap", &[]);
    let report = trim(&folder, "echoless.mcap", &["--drop-echoes"]);
    assert!(report["changed"].as_u64().unwrap() > 1000, "{report}");
    let bytes = |key: &str| report[key].as_u64().unwrap();
    assert!(bytes("sensor_bytes") * 2 < bytes("sensor_bytes_before"), "{report}");
    assert_eq!(folder.digest("echoless.mcap", &[]), digest);
    assert!(folder.read("echoless.mcap").len() * 2 < folder.read("live.mcap").len());
}

#[test]
fn anonymous_log_has_no_name_address_comment_or_time_of_day() {
    let vehicle = VEHICLE
        .replace("name = \"test vehicle\"", "name = \"VITA of Upperplant\" # bought by Anna")
        .replace("profile = \"circle\"\nradius_m = 3", "profile = \"polyline\"\nfile = \"upperplant.csv\"");
    let folder = Folder::new();
    folder.write("upperplant.csv", "y_m,z_m\n-2.6,0\n2.6,0\n2.6,5.2\n-2.6,5.2\n");
    folder.write("vehicle.toml", &vehicle);
    folder.write("scene.toml", headrace_tests::SCENE);
    folder.simulate("scene.toml", "plain.mcap");
    folder.record("plain.mcap", "live.mcap", &[]);
    let report = trim(&folder, "public.mcap", &["--anonymise"]);
    // Attachments and metadata aren't compressed, so their text is searched in the file's bytes. Messages are searched
    // after decompression.
    let answer = folder.headrace(&["recover", "public.mcap", "-o", "again.mcap"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let log = folder.read("public.mcap");
    let messages = raw_messages(&log).into_iter();
    let unpacked: Vec<u8> = messages.flat_map(|m| [m.channel.topic.as_bytes(), &m.data].concat()).collect();
    let text = String::from_utf8_lossy(&[log, unpacked].concat()).to_lowercase();
    for word in ["upperplant", "anna", "192.168", "vita", "clock_anchor", "live.mcap"] {
        assert!(!text.contains(word), "{word}");
    }
    assert!(text.contains("file1.csv") && text.contains("192.0.2."));
    assert_eq!(folder.digest("public.mcap", &[]), folder.digest("live.mcap", &[]));
    let left = report["done"].to_string();
    assert!(
        left.contains("the sensors' ids (sonar_0") && left.contains("content of the attached files"),
        "{left}"
    );
    let answer = folder.headrace(&["trim", "live.mcap", "-o", "more.mcap", "--from", "5s", "--to", "5s"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stdout);
}

#[test]
fn times_outside_the_dive_are_refused_without_changing_files() {
    let folder = recorded(SCENE, VEHICLE);
    trim(&folder, "part.mcap", &["--to", "5s"]);
    let before = folder.read("part.mcap");
    let times_s =
        raw_messages(&folder.read("dive.mcap")).iter().map(|m| m.log_time as f64 * 1e-9).collect::<Vec<_>>();
    let span_s = times_s[times_s.len() - 1] - times_s[0];
    for log in ["dive.mcap", "live.mcap"] {
        for (from, output) in [("20min", "part.mcap"), ("99h", "new.mcap")] {
            let answer = folder.headrace(&["trim", log, "-o", output, "--from", from]);
            assert_eq!((answer.code, answer.stdout.as_str()), (Some(2), ""), "{}", answer.stderr);
            let (_, report) = answer.stderr.split_once("the dive lasts from 0 s to ").unwrap();
            let stated_s: f64 = report.split_whitespace().next().unwrap().parse().unwrap();
            assert!((stated_s - span_s).abs() < 1.0, "{span_s}: {}", answer.stderr);
        }
    }
    assert!(folder.read("part.mcap") == before && !folder.path("new.mcap").exists());
}
