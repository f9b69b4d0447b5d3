//! Validation: recordings written by Python's `rosbags` (tests/ros/make.py) give the same messages as CSV tables with
//! the same values.
//!
//! Faults of a recording are reported.

use headrace_tests::{Answer, Folder, VEHICLE, raw_messages};
use serde_json::Value;

const RECORDINGS: [&str; 6] =
    ["none.bag", "bz2.bag", "lz4.bag", "humble.mcap", "jazzy.mcap", "boot_time.mcap"];
const TOPICS: [(&str, &str); 6] = [
    ("/imu/data", "imu"),
    ("/pressure", "depth"),
    ("/cable", "tether"),
    ("/ping/left", "ping_left"),
    ("/sonar/scan", "sonar_0"),
    ("/sonar/points", "sonar_1"),
];

fn fixture(name: &str) -> Vec<u8> {
    std::fs::read(headrace_tests::root().join("tests/ros").join(name)).unwrap()
}

/// A folder with recordings, tables, the vehicle file and a mapping. `further` is added to the table of each topic in
/// the mapping.
fn folder(further: &str) -> Folder {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    for name in RECORDINGS.into_iter().chain(["values.csv", "heads.csv"]) {
        folder.write(name, fixture(name));
    }
    folder.write("topics.toml", mapping(further));
    folder
}

fn mapping(further: &str) -> String {
    let table = |(topic, sensor)| {
        let further = if topic == "/cable" { "" } else { further };
        format!("[[topics]]\ntopic = \"{topic}\"\nsensor = \"{sensor}\"\n{further}\n")
    };
    TOPICS.map(table).concat()
}

fn import(folder: &Folder, file: &str, map: &str) -> Answer {
    folder.headrace(&["import", file, "--vehicle", "vehicle.toml", "--map", map, "-o", "out.mcap", "--json"])
}

/// A message of an imported log: topic, time in nanoseconds since 1970 (computed with the log's clock metadata), and
/// bytes.
type Heard = (String, u64, Vec<u8>);

fn heard(folder: &Folder) -> Vec<Heard> {
    let log = folder.read("out.mcap");
    let summary = mcap::Summary::read(&log).unwrap().unwrap();
    let index = summary.metadata_indexes.iter().find(|index| index.name == "headrace").unwrap();
    let metadata = mcap::read::metadata(&log, index).unwrap().metadata;
    let number = |key: &str| metadata[key].parse::<u64>().unwrap();
    let zero_ns = number("clock_anchor_utc_ns") - number("clock_anchor_monotonic_ns");
    let shown = |message: &mcap::Message<'_>| {
        (message.channel.topic.clone(), message.log_time + zero_ns, message.data.to_vec())
    };
    raw_messages(&log).iter().map(shown).collect()
}

fn of<'a>(all: &'a [Heard], topic: &str) -> Vec<&'a Heard> {
    all.iter().filter(|(other, ..)| other == topic).collect()
}

#[test]
fn recordings_of_all_kinds_match_the_tables() {
    let folder = folder("");
    let columns = |columns: &[(&str, &str, &str, &str)]| {
        let head = "time_column = \"t\"\nutc = true\n".to_owned();
        columns.iter().fold(head, |text, (column, sensor, quantity, unit)| {
            format!("{text}[[columns]]\ncolumn = \"{column}\"\nsensor = \"{sensor}\"\nquantity = \"{quantity}\"\nunit = \"{unit}\"\n")
        })
    };
    let values = [
        ("roll", "imu", "roll", "rad"),
        ("pitch", "imu", "pitch", "rad"),
        ("yaw", "imu", "yaw", "rad"),
        ("p", "imu", "rate_x", "rad/s"),
        ("q", "imu", "rate_y", "rad/s"),
        ("r", "imu", "rate_z", "rad/s"),
        ("ax", "imu", "force_x", "m/s2"),
        ("ay", "imu", "force_y", "m/s2"),
        ("az", "imu", "force_z", "m/s2"),
        ("depth", "depth", "pressure", "Pa"),
        ("tether", "tether", "chainage", "m"),
        ("left", "ping_left", "range", "m"),
    ];
    let heads = ["sonar_0", "sonar_1"].map(|id| [("angle", id, "angle", "rad"), ("range", id, "range", "m")]);
    folder.write("values.toml", columns(&values));
    folder.write("heads.toml", columns(heads.as_flattened()));
    let mut tables = Vec::new();
    for (table, map) in [("values.csv", "values.toml"), ("heads.csv", "heads.toml")] {
        let answer = import(&folder, table, map);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        tables.extend(heard(&folder));
    }
    for name in RECORDINGS {
        let answer = import(&folder, name, "topics.toml");
        assert_eq!(answer.code, Some(0), "{name}: {}", answer.stderr);
        let shown: Value = serde_json::from_str(&answer.stdout).unwrap();
        assert_eq!(shown["passed_over"], 1, "{name}: unused topics");
        let got = heard(&folder);
        for id in ["imu", "depth", "tether", "sonar_0"] {
            let topic = format!("/raw/{id}");
            assert!(
                !of(&got, &topic).is_empty() && of(&got, &topic) == of(&tables, &topic),
                "{name}: {topic}"
            );
        }
        // The import computes angles from points. A beam without a return has no point, so messages of such beams are
        // left out of the comparison.
        let wanted: Vec<_> =
            of(&tables, "/raw/sonar_1").into_iter().filter(|(_, _, bytes)| bytes[8..10] != [0, 0]).collect();
        assert_eq!(of(&got, "/raw/sonar_1"), wanted, "{name}");
        // A CSV table can't contain a missing return, so ping numbers differ. Only distance and confidence are
        // compared.
        let distances = |all: &[Heard]| -> Vec<_> {
            let pings = of(all, "/raw/ping_left").into_iter();
            pings.map(|(_, at_ns, bytes)| (*at_ns, bytes[8..14].to_vec())).collect()
        };
        let silent = [0; 6];
        let (none, some): (Vec<_>, Vec<_>) =
            distances(&got).into_iter().partition(|(_, distance)| distance[..] == silent);
        assert_eq!((none.len(), some), (12, distances(&tables)), "{name}");
    }
    let (code, report) = folder.replay("out.mcap", &[]);
    assert!(matches!(code, Some(0 | 1)), "{code:?}");
    for source in report["sources"].as_array().unwrap() {
        assert_eq!((&source["bad_frames"], &source["withheld"]), (&0.into(), &0.into()), "{source}");
    }
}

#[test]
fn stamps_in_another_time_base_are_reported_and_usable_on_request() {
    let folder = folder("");
    folder.write("header.toml", mapping("time = \"header\""));
    assert_eq!(import(&folder, "boot_time.mcap", "header.toml").code, Some(0));
    let followed = heard(&folder);
    let answer = import(&folder, "boot_time.mcap", "topics.toml");
    let words = "/imu/data: header stamps are on another time base, 1699999980.000 s before recording; the times of recording";
    assert!(answer.stderr.contains(words), "{}", answer.stderr);
    assert!(!answer.stderr.contains("/cable"), "{}", answer.stderr);
    let recorded = heard(&folder);
    assert_eq!(of(&followed, "/raw/imu"), of(&recorded, "/raw/imu"));
    // A scan has the time of its first beam as its timestamp, but it is recorded only when its last beam is complete.
    assert_eq!(import(&folder, "humble.mcap", "header.toml").code, Some(0));
    assert_eq!(of(&heard(&folder), "/raw/sonar_0"), of(&recorded, "/raw/sonar_0"));
    let answer = import(&folder, "boot_time.mcap", "header.toml");
    assert!(answer.stderr.contains("they are used, shifted by 1699999980.000 s"), "{}", answer.stderr);
}

#[track_caller]
fn refused(folder: &Folder, file: &str, map: Option<&str>, words: &[&str]) {
    let mapped = map.map_or(vec![], |map| vec!["--map", map]);
    let arguments = ["import", file, "--vehicle", "vehicle.toml", "-o", "refused.mcap"];
    let answer = folder.headrace(&[&arguments[..], &mapped].concat());
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    for word in words {
        assert!(answer.stderr.contains(word), "{word:?} is not in {}", answer.stderr);
    }
    assert!(!folder.path("refused.mcap").exists());
}

#[test]
fn unambiguous_topics_are_matched_and_ambiguous_ones_need_a_mapping() {
    let folder = folder("");
    let words = [
        "which profiling head sends which topic",
        "/sonar/points",
        "/sonar/scan",
        "sonar_0, sonar_1",
        "--map",
    ];
    refused(&folder, "none.bag", None, &words);
    let (head, _) = VEHICLE.split_once("[[sensors]]").unwrap();
    let one = "[[sensors]]\nid = \"imu\"\nplugin = \"imu_can\"\npreset = \"xsens_mti600\"\n";
    folder.write("vehicle.toml", format!("{head}{one}"));
    for name in ["lz4.bag", "humble.mcap"] {
        let answer = folder.headrace(&["import", name, "--vehicle", "vehicle.toml", "-o", "out.mcap"]);
        assert_eq!(answer.code, Some(0), "{}", answer.stderr);
        assert!(answer.stderr.contains("/imu/data (sensor_msgs/"), "{}", answer.stderr);
        assert!(answer.stderr.contains("is assigned to imu"), "{}", answer.stderr);
    }
    let velocity = "[[sensors]]\nid = \"dvl\"\nplugin = \"a50\"\n";
    folder.write("vehicle.toml", format!("{head}{velocity}"));
    refused(
        &folder,
        "none.bag",
        None,
        &["no topic belongs to a sensor", "/chatter (std_msgs/", "dvl (velocity log)"],
    );
    refused(&folder, "humble.mcap", None, &["no topic belongs to a sensor"]);
}

#[test]
fn wrong_mappings_are_refused() {
    let folder = folder("");
    let table = |topic: &str, sensor: &str, further: &str| {
        format!("[[topics]]\ntopic = \"{topic}\"\nsensor = \"{sensor}\"\n{further}\n")
    };
    let imu = table("/imu/data", "imu", "");
    for (text, words) in [
        (String::new(), "topics"),
        (table("/imu", "imu", ""), "isn't a topic of the file, which has"),
        (table("/chatter", "imu", ""), "messages of type std_msgs/msg/String aren't supported"),
        (table("/imu/data", "gyro", ""), "isn't a sensor of the vehicle file"),
        (
            table("/imu/data", "depth", ""),
            "is a depth sensor, but a topic of sensor_msgs/msg/Imu belongs to an inertial unit",
        ),
        (table("/imu/data", "imu", "time = \"stamp\""), "must be one of record, header"),
        (table("/cable", "tether", "time = \"header\""), "have no header"),
        (table("/imu/data", "imu", "unit = \"Pa\""), "unit"),
        (table("/pressure", "depth", "unit = \"psi\""), "must be one of Pa, hPa, mbar, kPa, bar"),
        (format!("{imu}{imu}"), "already has a topic, /imu/data"),
        (format!("{imu}{}", table("/imu/data", "imu", "")), "imu"),
        (format!("{imu}[other]\n"), "other"),
    ] {
        folder.write("wrong.toml", &text);
        refused(&folder, "humble.mcap", Some("wrong.toml"), &["wrong.toml:", words]);
    }
    let arguments = ["import", "none.bag", "-o", "refused.mcap"];
    let answer = folder.headrace(&arguments);
    assert!(answer.code == Some(2) && answer.stderr.contains("--vehicle"), "{}", answer.stderr);
    let answer = folder.headrace(&[&arguments[..], &["--source", "imu=can0"]].concat());
    assert!(
        answer.code == Some(2) && answer.stderr.contains("--source isn't for rosbag"),
        "{}",
        answer.stderr
    );
}

/// Imports a file after `change` has modified its bytes. Returns exit code and output of the import.
fn changed(folder: &Folder, name: &str, change: impl FnOnce(&mut Vec<u8>)) -> (Option<i32>, String) {
    let mut bytes = fixture(name);
    change(&mut bytes);
    let name = format!("changed-{name}");
    folder.write(&name, bytes);
    let answer = import(folder, &name, "topics.toml");
    (answer.code, answer.stderr)
}

/// Increases the number of messages stated in the file's statistics record by three.
fn state_three_more(bytes: &mut [u8]) {
    let number = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    // The closing magic has 8 bytes, and the footer before it has 20. The footer begins with the position of the
    // summary.
    let mut at = usize::try_from(number(bytes, bytes.len() - 28)).unwrap();
    while bytes[at] != mcap::records::op::STATISTICS {
        at += 9 + usize::try_from(number(bytes, at + 1)).unwrap();
    }
    let count = number(bytes, at + 9) + 3;
    bytes[at + 9..at + 17].copy_from_slice(&count.to_le_bytes());
}

#[test]
fn recording_with_fewer_messages_than_it_states_is_reported() {
    let folder = folder("");
    let (code, said) = changed(&folder, "humble.mcap", |bytes| state_three_more(bytes));
    assert_eq!(code, Some(3), "{said}");
    assert!(
        said.contains("3 of the ") && said.contains(" messages that its summary states are missing"),
        "{said}"
    );
}

fn find(bytes: &[u8], what: &[u8], after: usize) -> usize {
    after + bytes[after..].windows(what.len()).position(|window| window == what).unwrap()
}

#[test]
fn damage_of_a_recording_is_reported() {
    let folder = folder("");
    for name in ["none.bag", "bz2.bag", "lz4.bag", "humble.mcap"] {
        let (code, said) = changed(&folder, name, |bytes| bytes.truncate(bytes.len() * 3 / 5));
        assert_eq!(code, Some(3), "{name}: {said}");
        let words =
            if name.ends_with("bag") { "cut off" } else { "the file ends before its closing records" };
        assert!(said.contains(words), "{name}: {said}");
        assert!(!heard(&folder).is_empty());
    }
    for (name, words) in
        [("lz4.bag", "chunks that can't be unpacked"), ("bz2.bag", "chunks that can't be unpacked")]
    {
        let (code, said) = changed(&folder, name, |bytes| {
            let at = find(bytes, b"compression=", 0);
            bytes[at + 200..at + 240].fill(0);
        });
        assert_eq!(code, Some(3), "{said}");
        assert!(said.contains(words), "{name}: {said}");
    }
    let unclosed = |bytes: &mut Vec<u8>| {
        let at = find(bytes, b"index_pos=", 0);
        bytes[at + 10..at + 18].fill(0);
    };
    let (code, said) = changed(&folder, "none.bag", unclosed);
    assert!(code == Some(3) && said.contains("the bag was not closed"), "{said}");
    let longer = |bytes: &mut Vec<u8>| {
        let at = find(bytes, b"chunk_count=", 0);
        bytes[at + 12] += 1;
    };
    let (code, said) = changed(&folder, "none.bag", longer);
    assert!(code == Some(3) && said.contains("the bag states "), "{said}");
    let undefined = |bytes: &mut Vec<u8>| {
        // Changes the number of the first connection definition inside a chunk, but not in its copy at the end of the
        // file.
        let chunk = find(bytes, b"compression=", 0);
        let at = find(bytes, b"conn=", chunk);
        bytes[at + 5] = 99;
    };
    let (code, said) = changed(&folder, "none.bag", undefined);
    assert!(code == Some(3) && said.contains("connection without an earlier definition"), "{said}");
    let twice = |bytes: &mut Vec<u8>| {
        // Gives the second connection definition the same number as the first one.
        let chunk = find(bytes, b"op=\x05", 0);
        let first = find(bytes, b"conn=", chunk);
        let second = find(bytes, b"op=\x07", find(bytes, b"op=\x07", first) + 1);
        let second = find(bytes, b"conn=", second - 40);
        bytes[second + 5] = bytes[first + 5];
    };
    let (code, said) = changed(&folder, "none.bag", twice);
    assert!(code == Some(3) && said.contains("connections with a second, different definition"), "{said}");
    let other = |bytes: &mut Vec<u8>| {
        while let Some(at) = bytes.windows(8).position(|window| window == b"6a62c6da") {
            bytes[at] = b'7';
        }
    };
    let (code, said) = changed(&folder, "none.bag", other);
    assert!(code == Some(2) && said.contains("(MD5 7a62c6da"), "{said}");
}

#[test]
fn files_without_a_ros_recording_are_refused() {
    let folder = folder("");
    folder.write("old.bag", b"#ROSBAG V1.2\nmuch more");
    folder.write("text.bag", b"hello");
    folder.write("text.mcap", b"hello");
    folder.write("db.bag", b"SQLite format 3\0");
    refused(&folder, "old.bag", None, &["begins with \"#ROSBAG V2.0\", this file with \"#ROSBAG V1.2\""]);
    refused(&folder, "text.bag", None, &["with \"hello\"", "text"]);
    refused(&folder, "db.bag", None, &["ros2 bag convert"]);
    let answer = folder.headrace(&["import", "text.mcap", "--vehicle", "vehicle.toml", "-o", "refused.mcap"]);
    assert_eq!(answer.code, Some(2), "{}", answer.stderr);
    folder.write("scene.toml", headrace_tests::SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    refused(&folder, "dive.mcap", None, &["is a dive log already"]);
}

/// A hand-made recording in plain CDR. Each message has a topic, a type and a time in seconds.
fn recording(messages: &[(&str, &str, u64, Vec<u8>)]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().profile("ros2").create(&mut file).unwrap();
    for (topic, of, seconds, data) in messages {
        let schema = writer.add_schema(of, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, topic, "cdr", &[].into()).unwrap();
        let log_time = (1_700_000_000 + seconds) * 1_000_000_000;
        let head = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
        writer.write_to_known_channel(&head, data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

/// A message that consists of the encapsulation, a timestamp equal to the record's time, a frame name of three letters,
/// and doubles.
fn stamped(seconds: u32, frame: &str, values: &[f64]) -> Vec<u8> {
    let head = [&[0, 1, 0, 0][..], &(1_700_000_000 + seconds).to_le_bytes(), &[0; 4], &[4, 0, 0, 0]].concat();
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    [&head, frame.as_bytes(), &[0], &values].concat()
}

fn imu(wxyz: [f64; 4], without: bool, force_z: f64) -> Vec<f64> {
    let [w, x, y, z] = wxyz;
    let covariance = |missing: bool| [if missing { -1.0 } else { 0.0 }, 0., 0., 0., 0., 0., 0., 0., 0.];
    let rest = [covariance(false), [0.; 9]].concat();
    [&[x, y, z, w][..], &covariance(without), &[0.1, 0.2, 0.3], &rest[..9], &[0., 0., force_z], &rest[..9]]
        .concat()
}

#[test]
fn missing_and_odd_values_are_reported() {
    let folder = folder("");
    let of_imu = |seconds: u32, frame, values: &[f64]| {
        ("/imu/data", "sensor_msgs/msg/Imu", u64::from(seconds), stamped(seconds, frame, values))
    };
    let pressure = |seconds: u32, value: f64| {
        (
            "/pressure",
            "sensor_msgs/msg/FluidPressure",
            u64::from(seconds),
            stamped(seconds, "abc", &[value, 0.0]),
        )
    };
    let level = [1.0, 0.0, 0.0, 0.0];
    let mut short = pressure(9, 150.0);
    short.3.truncate(30);
    let mut big = pressure(11, 152.0);
    big.3[1] = 7;
    folder.write(
        "strange.mcap",
        recording(&[
            of_imu(1, "abc", &imu(level, false, -9.8)),
            of_imu(2, "abd", &imu(level, true, -9.8)),
            of_imu(3, "abc", &imu([0.0; 4], false, -9.8)),
            of_imu(4, "abc", &imu([2.0, 0.0, 0.0, 0.0], false, -9.8)),
            of_imu(5, "abc", &imu([f64::NAN; 4], false, f64::NAN)),
            pressure(6, 150.0),
            pressure(7, f64::NAN),
            pressure(8, -1e300),
            short,
            big,
        ]),
    );
    let map = mapping("")
        .split("[[topics]]")
        .filter(|table| table.contains("imu") || table.contains("pressure"))
        .fold(String::new(), |text, table| format!("{text}[[topics]]{table}"));
    folder.write("two.toml", map);
    let answer = import(&folder, "strange.mcap", "two.toml");
    assert_eq!(answer.code, Some(3), "{}", answer.stderr);
    for words in [
        "note: /imu/data: 3 messages without orientation",
        "note: /imu/data: 1 messages without specific force",
        "note: /imu/data: 1 messages have another frame than the first, \"abc\"",
        "so the sensor's z axis points down; set `angles_deg` of imu accordingly",
        "lost: /imu/data: 1 messages whose orientation isn't a unit quaternion",
        "note: /pressure: no pressure is above 150.0 Pa",
        "lost: /pressure: 1 messages whose value isn't a number",
        "lost: /pressure: 1 messages with values that the sensor can't encode",
        "lost: /pressure: 1 messages shorter than their type requires",
        "lost: /pressure: 1 messages in another encapsulation than plain CDR",
    ] {
        assert!(answer.stderr.contains(words), "{words:?} is not in {}", answer.stderr);
    }
    let shown: Value = serde_json::from_str(&answer.stdout).unwrap();
    // The four samples give four messages with times, one with an orientation, four with rates and three with forces.
    assert_eq!(shown["messages"]["imu"], 4 + 1 + 4 + 3);
    let (_, report) = folder.replay("out.mcap", &[]);
    assert!(report["sources"].as_array().unwrap().iter().all(|source| source["bad_frames"] == 0));
}
