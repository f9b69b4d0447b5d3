//! Validation: doubt in a foreign log reaches the replay, or is withheld, counted and named.

use headrace_tests::{Answer, Folder};
use serde_json::Value;

const VEHICLE: &str = r#"target_m = 1
[tunnel]
profile = "circle"
radius_m = 3
length_m = 100

[[sensors]]
id = "dvl"
plugin = "a50"

[[sensors]]
id = "ping"
plugin = "ping1d"

[[sensors]]
id = "depth"
plugin = "bar100"

[[sensors]]
id = "sonar"
plugin = "imagenex881"
mode = "fastest"
range_m = 10
"#;

/// A folder with the vehicle file and a mapping. Each column has its name, sensor, quantity, and other keys.
fn folder(columns: &[(&str, &str, &str, &str)]) -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    let head = "time_column = \"t\"\ntime_unit = \"iso8601\"\n".to_owned();
    let map = columns.iter().fold(head, |text, (column, sensor, quantity, further)| {
        format!("{text}[[columns]]\ncolumn = \"{column}\"\nsensor = \"{sensor}\"\nquantity = \"{quantity}\"\n{further}\n")
    });
    folder.write("map.toml", map);
    folder
}

fn import(folder: &Folder, further: &[&str]) -> Answer {
    let arguments = ["import", "--vehicle", "vehicle.toml", "-o", "out.mcap", "--json"];
    folder.headrace(&[&arguments[..], further].concat())
}

#[test]
fn doubtful_rows_of_a_table_are_withheld_by_the_import_or_by_the_replay() {
    let folder = folder(&[
        ("vx", "dvl", "velocity_x", "unit = \"m/s\""),
        ("vy", "dvl", "velocity_y", "unit = \"m/s\""),
        ("vz", "dvl", "velocity_z", "unit = \"m/s\""),
        ("ok", "dvl", "valid", ""),
        ("fom", "dvl", "sd", "unit = \"m/s\""),
        ("d", "depth", "depth", "unit = \"m\""),
        ("ok", "depth", "valid", ""),
        ("r", "ping", "range", "unit = \"m\"\nsound_speed_mps = 1500"),
        ("c", "ping", "confidence", "unit = \"percent\""),
    ]);
    folder.write(
        "table.csv",
        "t,vx,vy,vz,ok,fom,d,r,c\n\
         2026-05-04T12:00:00Z,0.1,0.01,0,true,0.01,5,2.5,100\n\
         2026-05-04T12:00:00.2Z,0.2,0.02,0,false,0.01,5,2.5,30\n\
         2026-05-04T12:00:00.4Z,0.3,0.03,0,true,5,5,2.5,49\n\
         2026-05-04T12:00:00.6Z,0.4,0.04,0,false,0.01,5,2.5,100\n",
    );
    let answer = import(&folder, &["table.csv", "--map", "map.toml"]);
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    let words = "headrace: lost: readings marked as invalid, withheld: the sensor's messages have no field for this: 2 times";
    assert!(answer.stderr.contains(words), "{}", answer.stderr);
    let shown: Value = serde_json::from_str(&answer.stdout).unwrap();
    // The other loss is the velocity whose figure of merit exceeds `velocity_sd_mps`.
    assert_eq!(shown["losses"].as_array().unwrap().len(), 2);
    assert_eq!((&shown["messages"]["dvl"], &shown["messages"]["ping"]), (&3.into(), &4.into()));
    let (_, report) = folder.replay("out.mcap", &[]);
    let sources = report["sources"].as_array().unwrap();
    let withheld = |id: &str| sources.iter().find(|source| source["id"] == id).unwrap()["withheld"].clone();
    // The replay withholds the two invalid velocities.
    assert_eq!((withheld("dvl"), withheld("depth")), (2.into(), 0.into()));
}

#[test]
fn table_with_the_points_of_echoes_is_refused_before_the_import() {
    let folder =
        folder(&[("a", "sonar", "angle", "unit = \"deg\""), ("r", "sonar", "range", "unit = \"m\"")]);
    let points = (1..400).fold(String::new(), |rows, bin| {
        format!("{rows}2026-05-04T12:00:00Z,30,{}\n", f64::from(bin) / 50.0)
    });
    folder.write("table.csv", format!("t,a,r\n{points}"));
    let answer = import(&folder, &["table.csv", "--map", "map.toml"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("the points of an echo, not ranges"), "{}", answer.stderr);
    assert!(!folder.path("out.mcap").exists());
}

/// A log of Ping Viewer with one message, for a type of sensor.
fn ping_log(sensor_type: u8) -> Vec<u8> {
    let text = |text: &str| {
        let units: Vec<u8> = text.encode_utf16().flat_map(u16::to_be_bytes).collect();
        [&u32::try_from(units.len()).unwrap().to_be_bytes()[..], &units].concat()
    };
    let frame = b"BR\x02\0\xEC\x03\x01\0abcd";
    [
        text("PingViewer sensor log file"),
        vec![0, 0, 0, 1],
        ["abc", "2024-01-01", "v2.4", "Linux", "12"].map(text).concat(),
        vec![0, 0, 0, 1, 0, 0, 0, sensor_type],
        text("00:00:01.500"),
        vec![0, 0, 0, 12],
        frame.to_vec(),
    ]
    .concat()
}

#[test]
fn ping_viewer_log_needs_a_ping_echosounder_and_has_the_local_time_of_its_name() {
    let folder = folder(&[]);
    let name = "20231114-221320250.bin";
    folder.write(name, ping_log(2));
    let answer = import(&folder, &[name]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    assert!(answer.stderr.contains("the log of a Ping360"), "{}", answer.stderr);
    assert!(!folder.path("out.mcap").exists());
    folder.write(name, ping_log(1));
    let answer = import(&folder, &[name]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let log = folder.read("out.mcap");
    let summary = mcap::Summary::read(&log).unwrap().unwrap();
    let index = summary.metadata_indexes.iter().find(|index| index.name == "headrace").unwrap();
    let metadata = mcap::read::metadata(&log, index).unwrap().metadata;
    assert_eq!(
        (metadata["import_clock"].as_str(), metadata["import_clock_first_ns"].as_str()),
        ("local", "1700000001750000000")
    );
}

#[test]
fn lines_of_an_a50_become_its_readings_with_their_validity() {
    let folder = folder(&[]);
    let line = |number: u32, valid: bool| {
        let (vx, at_us) = (f64::from(number) / 10.0, 1_700_000_000_000_000 + u64::from(number) * 200_000);
        format!(
            "{{\"vx\":{vx},\"vy\":0.01,\"vz\":0.0,\"fom\":0.002,\"altitude\":1.5,\"transducers\":[{{\"beam_valid\":true}},\
             {{\"beam_valid\":true}},{{\"beam_valid\":true}}],\"velocity_valid\":{valid},\"status\":0,\"type\":\"velocity\",\
             \"format\":\"json_v3.1\",\"time_of_validity\":{at_us},\"time_of_transmission\":{}}}\r\n",
            at_us + 100_000
        )
    };
    folder.write("dvl.jsonl", [line(1, true), line(2, false), line(3, true)].concat());
    let answer = import(&folder, &["dvl.jsonl"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let (_, report) = folder.replay("out.mcap", &[]);
    let source = &report["sources"][0];
    assert_eq!((&source["frames"], &source["withheld"]), (&3.into(), &1.into()), "{source}");
}
