//! Checks several kinds of reports against docs/reference/report.schema.json. The schema must describe each key with
//! its unit.
//!
//! `headrace_tests::json_schema` checks the small part of JSON Schema (2020-12) that this schema uses.

use headrace_tests::Folder;
use headrace_tests::json_schema::faults;
use serde_json::Value;

pub(crate) fn schema() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/reference/report.schema.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn reports_of_all_kinds_match_the_schema() {
    let schema = schema();
    let folder = Folder::with_dive();
    let check = |what: &str, report: &Value| {
        let faults = faults(&schema, report);
        assert!(faults.is_empty(), "{what}: {faults:#?}");
    };

    let (_, whole) = folder.replay("dive.mcap", &[]);
    check("a dive", &whole);

    let (_, strict) = folder.replay("dive.mcap", &["--target", "0.3"]);
    assert!(strict["sections"].as_array().unwrap().iter().any(|section| section["verdict"] == "fail"));
    check("a dive that fails", &strict);

    let (_, smoothed) = folder.replay("dive.mcap", &["--smooth"]);
    assert!(smoothed["smoothing"].is_object());
    check("a smoothed dive", &smoothed);

    let answer =
        folder.headrace(&["run", "vehicle.toml", "--source", "dive.mcap", "--speed", "max", "--json"]);
    check("a live dive", &serde_json::from_str(&answer.stdout).unwrap());

    let dive = folder.read("dive.mcap");
    folder.write("cut.mcap", &dive[..dive.len() / 5]);
    let (_, cut) = folder.replay("cut.mcap", &[]);
    assert!(!cut["log"]["losses"].as_array().unwrap().is_empty());
    check("part of a dive", &cut);

    let messages = headrace_tests::raw_messages(&dive);
    let vehicle = Some(headrace_tests::VEHICLE);
    for (what, topic) in
        [("without sonar", "/raw/sonar"), ("without attitude", "/raw/imu"), ("nothing", "/raw/")]
    {
        let rest: Vec<_> = messages.iter().filter(|m| !m.channel.topic.starts_with(topic)).cloned().collect();
        headrace_tests::write_log(&folder.path("part.mcap"), mcap::WriteOptions::new(), vehicle, &rest);
        check(what, &folder.replay("part.mcap", &[]).1);
    }
}

#[test]
fn golden_reports_match_the_schema() {
    let schema = schema();
    let folder = Folder::with_dive();
    let bless = || {
        folder.headrace(&["replay", "dive.mcap", "--expect", "golden.json", "--bless"]);
        serde_json::from_slice::<Value>(&folder.read("golden.json")).unwrap()
    };
    let mut golden = bless();
    assert_eq!(faults(&schema, &golden), Vec::<String>::new());
    assert_eq!(golden["log"], Value::Null);
    // If a golden report is renewed, its tolerances stay, and keys that earlier versions of the program didn't write
    // are added.
    golden["tolerances"] = serde_json::json!({"/summary/hole/max_m": 0.1});
    golden.as_object_mut().unwrap().remove("log");
    folder.write("golden.json", golden.to_string());
    let again = bless();
    assert_eq!(faults(&schema, &again), Vec::<String>::new());
    assert_eq!((&again["log"], &again["tolerances"]), (&Value::Null, &golden["tolerances"]));
}

#[test]
fn wrong_report_violates_the_schema() {
    let schema = schema();
    let folder = Folder::with_dive();
    let (_, report) = folder.replay("dive.mcap", &[]);
    let wrong = |place: &str, value: Value| {
        let mut report = report.clone();
        *report.pointer_mut(place).unwrap() = value;
        faults(&schema, &report).len()
    };
    assert_eq!(wrong("/target_m", 0.5.into()), 0);
    assert_eq!(wrong("/log", Value::Null), 0);
    assert_eq!(wrong("/target_m", "0.5".into()), 1);
    assert_eq!(wrong("/target_m", (-0.5).into()), 1);
    assert_eq!(wrong("/report_version", 2.into()), 1);
    assert_eq!(wrong("/log/messages", 0.5.into()), 1);
    assert_eq!(wrong("/sections/0/verdict", "perhaps".into()), 1);
    assert_eq!(wrong("/sections/0/start_m", Value::Null), 1);
    assert_eq!(wrong("/sources/0", Value::Null), 1);

    let mut more = report.clone();
    more["dive"]["colour"] = "red".into();
    assert_eq!(faults(&schema, &more), ["/dive/colour: unknown"]);
    let mut less = report;
    less["dive"].as_object_mut().unwrap().remove("sonar");
    assert_eq!(faults(&schema, &less).len(), 1);
}

/// Suffixes of report keys, each with its unit. The schema's description of a key with such a suffix must contain the
/// unit.
const UNITS: [(&str, &str); 13] = [
    ("_ratio", "without unit"),
    ("nis", "without unit"),
    // The next two keys have the same names as in the vehicle file.
    ("clock_from", "hours"),
    ("clock_to", "hours"),
    ("_deg", "degrees"),
    ("_h", "Hours"),
    ("_m", "metres"),
    ("_s", "seconds"),
    ("_mps", "metres per second"),
    ("_hz", "per second"),
    ("_perm2", "square metre"),
    ("_share", "0 to 1"),
    ("_ppm", "parts per million"),
];

#[test]
fn every_key_is_required_and_described_with_its_unit() {
    let schema = schema();
    let objects = schema["$defs"].as_object().unwrap().values().chain([&schema]);
    for object in objects {
        assert_eq!(object["additionalProperties"], false);
        let properties = object["properties"].as_object().unwrap();
        let mut required: Vec<_> =
            object["required"].as_array().unwrap().iter().map(|key| key.as_str().unwrap()).collect();
        required.sort_unstable();
        let mut keys: Vec<_> = properties.keys().map(String::as_str).collect();
        // Only golden reports may have the key `tolerances`.
        keys.retain(|key| *key != "tolerances");
        keys.sort_unstable();
        assert_eq!(required, keys);
        for (key, property) in properties {
            let words =
                property["description"].as_str().unwrap_or_else(|| panic!("{key} has no description"));
            assert!(words.ends_with('.'), "{key}: {words:?} isn't a sentence");
            let unit = UNITS.iter().find(|(ending, _)| key.ends_with(ending)).map(|(_, unit)| *unit);
            let number = property["type"] == "number" || property["type"][0] == "number";
            assert_eq!(unit.is_some(), number, "{key}: the key of a number must end in its unit");
            if let Some(unit) = unit {
                assert!(words.contains(unit), "{key}: {words:?} doesn't say {unit:?}");
            }
            if property["type"] == "integer" {
                assert!(words.contains("count"), "{key}: {words:?} doesn't say that it is a count");
            }
        }
    }
}
