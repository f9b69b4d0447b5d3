//! Validation: foreign logs are imported as headrace logs, and the ordinary decoders read them.
//!
//! `recordings/` has trimmed recordings made by others. If `HEADRACE_RECORDINGS` is set, these recordings are also read
//! at full length.

use std::fmt::Write as _;
use std::path::Path;

use headrace_tests::recordings;
use headrace_tests::{Answer, Folder, VEHICLE, raw_messages};
use serde_json::Value;

const TELEMETRY: &str = "bluerov2_ardusub_logs/small.tlog";

const TUNNEL: &str = r#"name = "BlueROV2"
target_m = 1
[tunnel]
profile = "circle"
radius_m = 3
length_m = 100
"#;

const AUTOPILOT: &str = r#"
[[sensors]]
id = "attitude"
plugin = "mavlink"
part = "imu"
system_id = 1
component_id = 1

[[sensors]]
id = "depth"
plugin = "mavlink"
part = "pressure"
system_id = 1
"#;

const HEAD: &str = r#"
[[sensors]]
id = "sonar_0"
plugin = "imagenex881"
mode = "fastest"
range_m = 10
"#;

fn json(answer: &Answer) -> Value {
    serde_json::from_str(&answer.stdout).unwrap_or_else(|error| panic!("{error}: {}", answer.stderr))
}

#[track_caller]
fn refused(folder: &Folder, arguments: &[&str], words: &[&str]) {
    let answer = folder.headrace(&[&["import"], arguments].concat());
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    for word in words {
        assert!(answer.stderr.contains(word), "{word:?} is not in {}", answer.stderr);
    }
    assert!(!folder.path("out.mcap").exists(), "a refused file leaves no log");
}

/// Expected counts for a telemetry log: number of intact entries, and numbers of messages for the vehicle's sensors.
struct Telemetry {
    entries: u64,
    attitude: u64,
    depth: u64,
}

#[test]
fn bluerov_telemetry_becomes_a_log_that_replays() {
    // The counts come from `oracles/tlog.py`. `attitude` is the number of ATTITUDE and RAW_IMU messages, and `depth`
    // the number of SCALED_PRESSURE2 messages.
    let trimmed = Telemetry { entries: 6499 - 4, attitude: 776 + 81, depth: 188 };
    let full_length = Telemetry { entries: 35_916 - 4, attitude: 5245 + 528, depth: 635 };
    for (path, wanted) in recordings::both(TELEMETRY, trimmed, full_length) {
        check_telemetry(path.to_str().unwrap(), &wanted);
    }
}

fn check_telemetry(file: &str, wanted: &Telemetry) {
    let folder = Folder::new();
    folder.write("vehicle.toml", format!("{TUNNEL}{AUTOPILOT}"));
    let answer = folder.headrace(&["import", file, "--vehicle", "vehicle.toml", "-o", "out.mcap", "--json"]);
    // Four frames of a camera have checksums that match no message definition. They are lost, so the exit code is 3.
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    let shown = json(&answer);
    assert!(answer.stderr.contains("4 times"), "{}", answer.stderr);
    let &Telemetry { entries, attitude, depth } = wanted;
    assert_eq!(shown["messages"], serde_json::json!({"attitude": attitude, "depth": depth}));
    assert_eq!(shown["entries"], entries);
    assert_eq!(shown["passed_over"], entries - attitude - depth);
    let (code, report) = folder.replay("out.mcap", &[]);
    assert_eq!(code, Some(1), "a dive without sonar");
    assert_eq!(report["log"]["losses"], serde_json::json!([]));
    for (source, frames) in report["sources"].as_array().unwrap().iter().zip([attitude, depth]) {
        assert_eq!((&source["frames"], &source["bad_frames"]), (&frames.into(), &0.into()), "{source}");
    }
    let log = folder.read("out.mcap");
    let summary = mcap::Summary::read(&log).unwrap().unwrap();
    let first = raw_messages(&log).first().unwrap().log_time;
    assert!((1_000_000_000..2_000_000_000).contains(&first), "{first}");
    let metadata = summary.metadata_indexes.iter().find(|index| index.name == "headrace").unwrap();
    let metadata = mcap::read::metadata(&log, metadata).unwrap().metadata;
    assert_eq!((metadata["import_format"].as_str(), metadata["import_clock"].as_str()), ("tlog", "utc"));
    assert_eq!(metadata["clock_anchor_monotonic_ns"], "1000000000");
    let utc_ns: u64 = metadata["clock_anchor_utc_ns"].parse().unwrap();
    let bytes = std::fs::read(file).unwrap();
    assert_eq!(utc_ns, u64::from_be_bytes(bytes[..8].try_into().unwrap()) * 1000);
}

#[test]
fn dataflash_log_is_recognised_and_refused() {
    let folder = Folder::new();
    folder.write("00000012.BIN", [b"\xA3\x95\x80".as_slice(), &[7; 500]].concat());
    let dataflash = ["not a Ping Viewer log", "a dataflash log of ArduPilot", ".tlog"];
    refused(&folder, &["00000012.BIN", "-o", "out.mcap"], &dataflash);
}

#[test]
fn truncated_telemetry_log_keeps_whole_entries_and_reports_the_loss() {
    let folder = Folder::new();
    folder.write("vehicle.toml", format!("{TUNNEL}{AUTOPILOT}"));
    folder.write("cut.tlog", &std::fs::read(recordings::trimmed(TELEMETRY)).unwrap()[..100_005]);
    let answer = folder.headrace(&["import", "cut.tlog", "--vehicle", "vehicle.toml", "-o", "out.mcap"]);
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    assert!(answer.stderr.contains("cut off"), "{}", answer.stderr);
    assert_eq!(folder.replay("out.mcap", &[]).0, Some(1));
}

#[test]
fn candump_import_keeps_bytes_and_times_of_the_dive() {
    let folder = Folder::with_dive();
    let vehicle =
        VEHICLE.replace("preset = \"xsens_mti600\"", "connect = \"can:can3\"\npreset = \"xsens_mti600\"");
    folder.write("can.toml", vehicle);
    let dive = folder.read("dive.mcap");
    let messages = raw_messages(&dive);
    let frames: Vec<_> = messages.iter().filter(|message| message.channel.topic == "/raw/imu").collect();
    assert!(frames.len() > 1000);
    let mut text = String::new();
    for message in &frames {
        let (id, len) =
            (u32::from_le_bytes(message.data[..4].try_into().unwrap()), usize::from(message.data[4]));
        let id = if id >> 31 == 1 { format!("{:08X}", id & 0x1FFF_FFFF) } else { format!("{id:03X}") };
        let data =
            message.data[8..8 + len].iter().fold(String::new(), |data, byte| format!("{data}{byte:02X}"));
        let (seconds, rest) = (message.log_time / 1_000_000_000, message.log_time % 1_000_000_000);
        writeln!(text, "({}.{rest:09}) can3 {id}#{data}", 1_700_000_000 + seconds).unwrap();
        writeln!(text, "({}.{rest:09}) can4 001#00", 1_700_000_000 + seconds).unwrap();
    }
    folder.write("dive.log", text);
    for further in [&[][..], &["--source", "imu=can3"]] {
        let arguments = ["import", "dive.log", "--vehicle", "can.toml", "-o", "out.mcap"];
        let answer = folder.headrace(&[&arguments[..], further].concat());
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        assert!(
            answer.stdout.contains(&format!("{} frames belong to no sensor", frames.len())),
            "{}",
            answer.stdout
        );
        let log = folder.read("out.mcap");
        let got = raw_messages(&log);
        assert_eq!(got.len(), frames.len());
        let shift = frames[0].log_time - got[0].log_time;
        for (got, wanted) in got.iter().zip(&frames) {
            assert_eq!(got.channel.topic, "/raw/imu");
            assert_eq!((&got.data, got.log_time + shift), (&wanted.data, wanted.log_time));
        }
    }
}

#[test]
fn imagenex_file_keeps_its_returns_and_times() {
    for (path, shots) in recordings::both("imagenex852_cidco/19_26_51-2016_11_18-sonar.852", 300, 917) {
        check_shots(&path, shots);
    }
}

fn check_shots(path: &Path, shots: usize) {
    let file = path.to_str().unwrap();
    let folder = Folder::new();
    folder.write("vehicle.toml", format!("{TUNNEL}{HEAD}"));
    let answer = folder.headrace(&["import", file, "--vehicle", "vehicle.toml", "-o", "out.mcap"]);
    assert_eq!(answer.code, Some(0), "{}", answer.stderr);
    let log = folder.read("out.mcap");
    let got = raw_messages(&log);
    assert_eq!(got.len(), shots);
    let bytes = std::fs::read(path).unwrap();
    for (message, shot) in got.iter().zip(bytes.chunks(640)) {
        let len = usize::from(u16::from_be_bytes([shot[6], shot[7]]));
        assert_eq!(message.data[..], shot[100..100 + len]);
    }
    assert!(got.iter().zip(&got[1..]).all(|(one, next)| one.log_time <= next.log_time));
}

#[test]
fn imagenex_file_without_times_is_refused() {
    let trimmed = ["there is no shot in its 32000 bytes", "no date and time: 50 times, 32000 bytes"];
    let full_length = ["there is no shot in its 113280 bytes", "no date and time: 177 times, 113280 bytes"];
    for (path, words) in recordings::both("imagenex852_cidco/hydroball.852", trimmed, full_length) {
        let folder = Folder::new();
        folder.write("vehicle.toml", format!("{TUNNEL}{HEAD}"));
        refused(&folder, &[path.to_str().unwrap(), "--vehicle", "vehicle.toml", "-o", "out.mcap"], &words);
    }
}

#[test]
fn ping_frames_without_times_are_refused() {
    let real = "ping360_tank_rgu/Uniform_Pipe__50__1N__2024-03-12_11-31-02Gain_1.bin";
    let made_up = recordings::trimmed("ping360_made_up/frames.bin");
    for path in [made_up].into_iter().chain(recordings::full_length(real)) {
        refused(
            &Folder::new(),
            &[path.to_str().unwrap(), "--source", "ping=ping", "-o", "out.mcap"],
            &["bare Ping frames, which have no times"],
        );
    }
}

const TABLE: &str = "t_s,depth (mbar),roll,pitch,yaw,p,q,r,ax,ay,az,left,along
1700000000.00,1500.5,1,2,3,0.1,0.2,0.3,0,0,1,2.5,10
1700000000.05,,1.5,2,3,0.1,0.2,0.3,0,0,1,,10.005
1700000000.10,1501.25,2,oops,3,0.1,0.2,0.3,0,0,1,2.75,10.01
1700000000.15,1502,2,2,3,0.1,0.2,0.3,0,0,1,2.75,10.015
";

fn mapping(columns: &[(&str, &str, &str, &str)]) -> String {
    let head = "time_column = \"t_s\"\nutc = true\n".to_owned();
    columns.iter().fold(head, |text, (column, sensor, quantity, unit)| {
        format!(
            "{text}[[columns]]\ncolumn = \"{column}\"\nsensor = \"{sensor}\"\nquantity = \"{quantity}\"\nunit = \"{unit}\"\n"
        )
    })
}

#[test]
fn imported_table_becomes_the_bytes_of_its_sensors() {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("table.csv", TABLE);
    let columns = [
        ("depth (mbar)", "depth", "pressure", "mbar"),
        ("roll", "imu", "roll", "deg"),
        ("pitch", "imu", "pitch", "deg"),
        ("yaw", "imu", "yaw", "deg"),
        ("p", "imu", "rate_x", "deg/s"),
        ("q", "imu", "rate_y", "deg/s"),
        ("r", "imu", "rate_z", "deg/s"),
        ("ax", "imu", "force_x", "g"),
        ("ay", "imu", "force_y", "g"),
        ("az", "imu", "force_z", "g"),
        ("left", "ping_left", "range", "m"),
        ("along", "tether", "chainage", "m"),
    ];
    folder.write("map.toml", mapping(&columns));
    let arguments = ["import", "table.csv", "--vehicle", "vehicle.toml", "-o", "out.mcap", "--map"];
    let answer = folder.headrace(&[&arguments[..], &["map.toml", "--json"]].concat());
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    assert!(answer.stderr.contains("rows with a cell that isn't a number: 1 times"), "{}", answer.stderr);
    let shown = json(&answer);
    let counts = &shown["messages"];
    assert_eq!((&counts["imu"], &counts["ping_left"], &counts["tether"]), (&12.into(), &3.into(), &4.into()));
    assert_eq!(counts["sonar_0"], 0);
    let (_, report) = folder.replay("out.mcap", &[]);
    let sources = report["sources"].as_array().unwrap();
    assert!(sources.iter().all(|source| source["bad_frames"] == 0), "{sources:?}");
    let heard =
        |id: &str| sources.iter().find(|source| source["id"] == id).unwrap()["frames"].as_u64().unwrap();
    assert_eq!((heard("imu"), heard("ping_left"), heard("tether")), (12, 3, 4));
    // The depth sensor's raw readings become three pressures, calibrated with the constants from the sensor's memory.
    assert_eq!(counts["depth"], heard("depth"));
    assert!(heard("depth") > 3);
    std::fs::remove_file(folder.path("out.mcap")).unwrap();
    for (columns, words) in [
        (&columns[..4], "rate_x, rate_y, rate_z, force_x, force_y, force_z"),
        (&[("deep", "depth", "pressure", "mbar")], "isn't a column; expected one of t_s, depth (mbar), roll"),
        (&[("along", "depth", "pressure", "m")], "must be one of Pa, hPa, mbar, kPa, bar"),
        (&[("along", "dvl", "velocity_x", "m/s")], "isn't a sensor of the vehicle file"),
    ] {
        folder.write("wrong.toml", mapping(columns));
        refused(&folder, &[&arguments[1..], &["wrong.toml"]].concat(), &["wrong.toml:", words]);
    }
    refused(&folder, &arguments[1..6], &["--map MAPPING.toml"]);
}

/// Faulty rows are reported, and none of their values is assigned to a wrong column.
///
/// The faults are truncated rows, decimal commas in a file with commas as separators, and ranges beyond the head's
/// setting. A byte order mark before the header is no fault.
#[test]
fn rows_that_contradict_the_header_are_skipped_and_reported() {
    let folder = Folder::new();
    folder.write("vehicle.toml", format!("{TUNNEL}{HEAD}"));
    folder.write("map.toml", mapping(&[("a", "sonar_0", "angle", "deg"), ("r", "sonar_0", "range", "m")]));
    let import = |rows: &str| {
        folder.write("table.csv", format!("\u{feff}t_s,a,r\n{rows}"));
        let arguments = ["import", "table.csv", "--vehicle", "vehicle.toml", "-o", "out.mcap", "--force"];
        let answer = folder.headrace(&[&arguments[..], &["--map", "map.toml", "--json"]].concat());
        (answer.code, json(&answer)["messages"]["sonar_0"].as_u64().unwrap(), answer.stderr)
    };
    let (code, messages, _) = import("1,0.0,3.0\n1.1,2.4,3.1,\n1.2,4.8,\n");
    assert_eq!((code, messages), (Some(0), 3));
    for (rows, expected_messages, words) in [
        ("1,0.0,3.0\n1.1,2,4,3,1\n1.2,4.8,3.0\n", 2, "rows with more or fewer cells than the header"),
        ("1,0.0,3.0\n1.1,2.4,3.1\n1.2,4\n", 2, "rows with more or fewer cells than the header"),
        ("1,0.0,3.0\n1.1,2.4,3.1\n1.2,4.8,2", 2, "a last row without a line end: it may be cut short"),
        (
            "1,0.0,3.0\n1.1,2.4,30\n1.2,4.8,3.0\n",
            3,
            "ranges outside the head's range setting, imported as pings without an echo",
        ),
    ] {
        let (code, messages, said) = import(rows);
        assert_eq!((code, messages), (Some(3), expected_messages), "{rows}: {said}");
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn wrong_file_kind_is_refused_with_the_likely_kind() {
    let folder = Folder::new();
    folder.write("vehicle.toml", format!("{TUNNEL}{AUTOPILOT}{HEAD}"));
    folder.write("empty.tlog", b"");
    folder.write("bag.tlog", b"#ROSBAG V2.0\nmuch more");
    folder.write("text.log", "not a log at all\n");
    folder.write("what.dat", b"(1.0) can0 123#11\n");
    let with = ["--vehicle", "vehicle.toml", "-o", "out.mcap"];
    for (file, words) in [
        ("empty.tlog", &["in its 0 bytes", "empty"][..]),
        ("bag.tlog", &["a ROS bag"]),
        ("what.dat", &["--format tlog|candump|imagenex|ping|a50|csv", "a log of candump"]),
        ("absent.tlog", &["reading absent.tlog"]),
    ] {
        refused(&folder, &[&[file][..], &with].concat(), words);
    }
    refused(
        &folder,
        &["text.log", "--source", "imu=can0", "-o", "out.mcap"],
        &["no line of candump", "text"],
    );
    refused(&folder, &["text.log", "--vehicle", "vehicle.toml", "-o", "out.mcap"], &["can:INTERFACE"]);
    refused(&folder, &["bag.tlog", "-o", "out.mcap"], &["--source ID=mavlink"]);
    let unknown = ["bag.tlog", "--vehicle", "vehicle.toml", "--source", "imu=mavlink", "-o", "out.mcap"];
    refused(&folder, &unknown, &["allowed are attitude, depth, sonar_0"]);
    refused(
        &folder,
        &["text.log", "--source", "imu=can0", "-o", "text.log"],
        &["writing text.log", "is read by this command"],
    );
}
