//! Compares tables with the reports that `headrace replay` made of the same logs, and with
//! `docs/reference/dive-tables.csv`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by them")]

use std::path::{Path, PathBuf};

use headrace_tables::arrow_array::cast::AsArray as _;
use headrace_tables::arrow_array::types::{Float64Type, Int64Type};
use headrace_tables::arrow_array::{Array as _, RecordBatch};
use headrace_tables::{Parameters, TABLES, Tables, described, dive_key, log_digest, replay, schema, unread};
use serde_json::{Value, json};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/golden").join(name)
}

fn report(name: &str) -> Value {
    serde_json::from_str(&std::fs::read_to_string(golden(&format!("{name}.json"))).unwrap()).unwrap()
}

fn tables(name: &str) -> Tables {
    replay(&[golden(&format!("{name}.mcap"))], &Parameters::default()).unwrap()
}

/// Converts a value of a table to JSON.
fn value(batch: &RecordBatch, column: &str, row: usize) -> Value {
    let array = batch.column_by_name(column).unwrap_or_else(|| panic!("no column {column}"));
    if array.is_null(row) {
        return Value::Null;
    }
    if let Some(numbers) = array.as_primitive_opt::<Float64Type>() {
        return json!(numbers.value(row));
    }
    if let Some(counts) = array.as_primitive_opt::<Int64Type>() {
        return json!(counts.value(row));
    }
    if let Some(truths) = array.as_boolean_opt() {
        return json!(truths.value(row));
    }
    json!(array.as_string::<i32>().value(row))
}

/// Asserts that rows of a table equal objects of a report, for pairs of a column and a path in the object.
fn same(batch: &RecordBatch, objects: &Value, pairs: &[(&str, &str)]) {
    let objects = objects.as_array().unwrap();
    assert_eq!(batch.num_rows(), objects.len());
    for (row, object) in objects.iter().enumerate() {
        for (column, path) in pairs {
            let expected = object.pointer(path).cloned().unwrap_or(Value::Null);
            assert_eq!(value(batch, column, row), expected, "row {row}, {column}, {object}");
        }
    }
}

const SECTIONS: [(&str, &str); 24] = [
    ("chainage_m", "/start_m"),
    ("end_m", "/end_m"),
    ("verdict", "/verdict"),
    ("cannot_say", "/cannot_say"),
    ("cause", "/cause/cause"),
    ("not_inspected", "/not_inspected"),
    ("d_m", "/hole_m"),
    ("d_least_m", "/hole_least_m"),
    ("d_most_m", "/hole_most_m"),
    ("t_x_mean_m", "/t_x/mean_m"),
    ("t_x_most_m", "/t_x/max_m"),
    ("t_y_mean_m", "/t_y/mean_m"),
    ("t_y_most_m", "/t_y/max_m"),
    ("t_mean_m", "/t/mean_m"),
    ("t_most_m", "/t/max_m"),
    ("samples", "/samples"),
    ("density_perm2", "/density_perm2"),
    ("doubtful_returns", "/doubtful_returns"),
    ("suspect", "/suspect"),
    ("masked_share", "/masked_share"),
    ("deviation_mean_m", "/deviation/mean_m"),
    ("contradicts", "/deviation/contradicts"),
    ("flagged_s", "/flagged_s"),
    ("cleared_s", "/cleared_s"),
];

const ALERTS: [(&str, &str); 8] = [
    ("number", "/number"),
    ("kind", "/kind"),
    ("text", "/text"),
    ("state", "/state"),
    ("occurrences", "/occurrences"),
    ("first_m", "/first_m"),
    ("worst_m", "/worst_m"),
    ("setting", "/setting/what"),
];

#[test]
fn tables_match_reports() {
    for name in ["too-fast", "stalls", "slipping-cable", "wrong-bytes", "murk"] {
        let (tables, report) = (tables(name), report(name));
        same(&tables.sections, &report["sections"], &SECTIONS);
        same(
            &tables.sources,
            &report["sources"],
            &[
                ("source", "/id"),
                ("packets", "/packets"),
                ("readings", "/readings"),
                ("bad_frames", "/bad_frames"),
                ("nav_used", "/navigation/used"),
                ("nis", "/navigation/nis"),
                ("drift_ppm", "/device_clock/drift_ppm"),
            ],
        );
        same(
            &tables.runs,
            &report["runs"],
            &[
                ("run", "/id"),
                ("cause", "/cause"),
                ("chainage_m", "/start_m"),
                ("d_m", "/hole_m"),
                ("cleared_s", "/cleared_s"),
            ],
        );
        same(&tables.alerts, &report["alert_list"], &ALERTS);
        same(
            &tables.dives,
            &json!([report]),
            &[
                ("digest", "/digest"),
                ("target_m", "/target_m"),
                ("way_m", "/coverage_extent/length_m"),
                ("pass_m", "/summary/pass_m"),
                ("fail_m", "/summary/fail_m"),
                ("cannot_say_m", "/summary/cannot_say_m"),
                ("flags_raised", "/summary/flags_raised"),
                ("samples", "/dive/samples_valid"),
                ("duration_s", "/dive/duration_s"),
                ("d_most_m", "/summary/hole/max_m"),
            ],
        );
        let flagged: Vec<Value> = report["sections"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|section| !section["flagged_s"].is_null())
            .cloned()
            .collect();
        same(
            &tables.flags,
            &Value::Array(flagged),
            &[("chainage_m", "/start_m"), ("raised_s", "/flagged_s")],
        );
        // `holes` contains every section's hole, and no other hole.
        let mut places: Vec<(u64, u64)> = Vec::new();
        for section in report["sections"].as_array().unwrap().iter().filter(|of| !of["hole_m"].is_null()) {
            let bits = |key: &str| section[key].as_f64().unwrap().to_bits();
            let place = (bits("hole_x_m"), bits("hole_m"));
            if places.last() != Some(&place) {
                places.push(place);
            }
        }
        let found: Vec<(u64, u64)> = (0..tables.holes.num_rows())
            .map(|row| {
                ["chainage_m", "d_m"].map(|of| value(&tables.holes, of, row).as_f64().unwrap().to_bits())
            })
            .map(|[x, d]| (x, d))
            .collect();
        assert_eq!(found, places, "{name}");
        let dive = dive_key(&log_digest(&[golden(&format!("{name}.mcap"))]).unwrap()).to_owned();
        for table in TABLES {
            let batch = tables.get(table).unwrap();
            assert_eq!(batch.schema(), schema(table).unwrap());
            assert!((0..batch.num_rows()).all(|row| value(batch, "dive", row) == json!(dive)), "{table}");
        }
    }
    assert!(schema("section").is_none() && tables("steel").get("").is_none());
}

#[test]
fn parameters_apply_to_the_replay() {
    let log = [golden("too-fast.mcap")];
    let of = |parameters: &Parameters| replay(&log, parameters).unwrap();
    let asked = Parameters {
        target_m: Some(0.6),
        section_m: Some(0.5),
        sound_speed_mps: Some(1450.0),
        ..Parameters::default()
    };
    let tables = of(&asked);
    assert_eq!(value(&tables.dives, "target_m", 0), json!(0.6));
    assert_eq!(value(&tables.dives, "section_m", 0), json!(0.5));
    assert_eq!(value(&tables.dives, "sound_speed_least_mps", 0), json!(1450.0));
    assert_eq!(value(&tables.dives, "parameters", 0), json!(asked.digest()));
    let plain = of(&Parameters::default());
    assert!(plain.sections.num_rows() > tables.sections.num_rows());
    assert_eq!(plain, of(&Parameters::default()), "a replay gives the same tables again");
    assert_ne!(of(&Parameters { smooth: true, ..Parameters::default() }).sections, plain.sections);
    let vehicle = Parameters { vehicle: Some("name = 1".to_owned()), ..Parameters::default() };
    let error = replay(&log, &vehicle).unwrap_err().to_string();
    assert!(error.starts_with("vehicle:1: name = 1"), "{error}");
}

#[test]
fn losses_and_unreadable_logs_appear_as_rows() {
    let folder = tempfile::tempdir().unwrap();
    let cut = folder.path().join("cut.mcap");
    let whole = std::fs::read(golden("stalls.mcap")).unwrap();
    std::fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    let halved = replay(&[cut], &Parameters::default()).unwrap();
    assert_eq!(value(&halved.dives, "exit_code", 0), json!(3));
    let lost = value(&halved.dives, "lost", 0);
    assert!(value(&halved.dives, "losses", 0).as_i64().unwrap() >= 1 && !lost.is_null(), "{lost}");
    assert_eq!(value(&tables("stalls").dives, "losses", 0), json!(0));

    let none = folder.path().join("none.mcap");
    std::fs::write(&none, "no log").unwrap();
    let error = replay(std::slice::from_ref(&none), &Parameters::default()).unwrap_err().to_string();
    let tables = unread("none.mcap", "00112233445566778899", &Parameters::default(), &error).unwrap();
    assert_eq!(value(&tables.dives, "error", 0), json!(error));
    assert_eq!(value(&tables.dives, "exit_code", 0), json!(2));
    assert_eq!(value(&tables.dives, "dive", 0), json!("0011223344556677"));
    assert_eq!(tables.sections.num_rows(), 0);
}

/// The file must describe the tables as the code defines them. `RENEW=1 cargo test -p headrace_tables` rewrites it.
#[test]
fn dive_tables_csv_lists_every_column() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/reference/dive-tables.csv");
    if std::env::var_os("RENEW").is_some() {
        std::fs::write(&path, described()).unwrap();
    }
    let there = std::fs::read_to_string(&path).unwrap();
    assert!(
        there == described(),
        "docs/reference/dive-tables.csv differs from the code: RENEW=1 writes it anew"
    );
}
