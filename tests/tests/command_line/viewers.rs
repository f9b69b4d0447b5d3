//! Checks that other programs can display dive logs. The tests read the logs with the plain `mcap` crate.
//!
//! Every message under `/result/view/` must match its channel's schema and the loop's published results. The log's
//! summary and indexes must be right, and a replay must ignore the messages under `/result/view/`. `tests/viewers/`
//! checks the logs with other readers.

use std::collections::BTreeMap;

use headrace_tests::json_schema::{base64, faults};
use headrace_tests::{Folder, VEHICLE};
use mcap::{MessageStream, Summary};
use serde_json::Value;

/// Twenty seconds at a normal speed, followed by a stretch that is far too fast.
const SCENE: &str = r#"name = "dive with a missed stretch"
vehicle = "vehicle.toml"

[trajectory]
start_m = 3

[[trajectory.legs]]
distance_m = 4
speed_mps = 0.2

[[trajectory.legs]]
distance_m = 12
speed_mps = 0.9
"#;

/// Records a dive; returns its folder and report.
fn recorded() -> (Folder, Value) {
    let folder = Folder::new();
    folder.write("vehicle.toml", VEHICLE);
    folder.write("scene.toml", SCENE);
    folder.simulate("scene.toml", "dive.mcap");
    let answer = folder.record("dive.mcap", "live.mcap", &["--json"]);
    let report = serde_json::from_str(&answer.stdout).unwrap();
    (folder, report)
}

/// Messages under `/result/view/` by topic, each checked against its schema.
fn view(log: &[u8]) -> BTreeMap<String, Vec<Value>> {
    let mut topics: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for message in MessageStream::new(log).unwrap().map(Result::unwrap) {
        let topic = &message.channel.topic;
        let Some(name) = topic.strip_prefix("/result/view/") else {
            assert_ne!(message.channel.message_encoding, "json", "{topic}");
            continue;
        };
        let schema = message.channel.schema.as_ref().unwrap_or_else(|| panic!("{topic} has no schema"));
        assert_eq!(
            (message.channel.message_encoding.as_str(), schema.encoding.as_str()),
            ("json", "jsonschema")
        );
        let value: Value = serde_json::from_slice(&message.data).unwrap();
        let faults = faults(&serde_json::from_slice(&schema.data).unwrap(), &value);
        assert!(faults.is_empty(), "{topic}: {faults:#?}");
        topics.entry(name.to_owned()).or_default().push(value);
    }
    topics
}

fn numbers<const N: usize>(value: &Value, keys: [&str; N]) -> [f64; N] {
    keys.map(|key| value[key].as_f64().unwrap_or_else(|| panic!("{key} in {value}")))
}

fn time_s(value: &Value) -> f64 {
    let [sec, nsec] = numbers(&value["timestamp"], ["sec", "nsec"]);
    sec + nsec / 1e9
}

#[test]
fn every_view_message_matches_its_schema_and_the_dive() {
    let (folder, report) = recorded();
    let topics = view(&folder.read("live.mcap"));
    let names: Vec<&str> = topics.keys().map(String::as_str).collect();
    let all = ["advice", "alerts", "missed", "points", "pose", "sections", "transforms", "vehicle", "wall"];
    assert_eq!(names, all);

    let [duration_s] = numbers(&report["dive"], ["duration_s"]);
    let updates = topics["vehicle"].len() as f64;
    assert!((updates - 5.0 * duration_s).abs() < 3.0, "{updates} updates in {duration_s} s");
    for transforms in &topics["transforms"] {
        for transform in transforms["transforms"].as_array().unwrap() {
            let turn = numbers(&transform["rotation"], ["x", "y", "z", "w"]);
            let norm = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
            assert!((norm - 1.0).abs() < 3e-6, "{turn:?}");
            assert_eq!(transform["parent_frame_id"], "tunnel");
        }
        let frames = transforms["transforms"].as_array().unwrap().iter().map(|t| &t["child_frame_id"]);
        assert!(frames.eq(["vehicle", "wall"]));
    }
    let poses =
        topics["pose"].iter().map(|pose| (time_s(pose), numbers(&pose["pose"]["position"], ["x"])[0]));
    let poses: Vec<_> = poses.collect();
    assert!(poses.windows(2).all(|two| two[0].0 < two[1].0), "times don't increase");
    assert!(poses.last().unwrap().1 > 18.0, "{poses:?}");

    let points: usize = topics["points"].iter().map(|cloud| points_of(cloud).len()).sum();
    assert_eq!(points as u64, report["dive"]["samples_valid"].as_u64().unwrap());
    for cloud in &topics["points"] {
        for (head, [x_m, y_m, z_m]) in points_of(cloud) {
            assert!(head < 2 && (2.0..20.0).contains(&x_m), "head {head} at {x_m}");
            // All points of the cloud lie on the tunnel's circle of 3 m radius, whose lowest point is at z = 0.
            assert!(((y_m * y_m + (z_m - 3.0) * (z_m - 3.0)).sqrt() - 3.0).abs() < 0.05, "{y_m}, {z_m}");
        }
    }

    let judged: BTreeMap<String, &Value> =
        topics["sections"].iter().map(|section| (section["start_m"].to_string(), section)).collect();
    let mut compared = 0;
    for section in report["sections"].as_array().unwrap() {
        let Some(last) = judged.get(&section["start_m"].to_string()) else { continue };
        assert_eq!(last["verdict"], section["verdict"], "{section}");
        compared += 1;
    }
    assert!(compared > 40, "{compared} sections");
    let flagged = report["sections"].as_array().unwrap().iter();
    let flagged = flagged.filter(|s| !s["flagged_s"].is_null() && s["cleared_s"].is_null()).count();
    let missed = numbers(topics["missed"].last().unwrap(), ["missed_m"])[0];
    assert!(flagged > 10 && (missed - 0.25 * flagged as f64).abs() < 1e-9, "{missed} m, {flagged} sections");

    let said: Vec<&str> = topics["alerts"].iter().map(|line| line["message"].as_str().unwrap()).collect();
    assert!(said.iter().any(|line| line.contains("too fast")), "{said:#?}");
    assert!(said.iter().any(|line| line.starts_with("TOO FAST: at most")), "{said:#?}");
}

#[test]
fn message_that_violates_its_schema_is_detected() {
    let (folder, _) = recorded();
    let log = folder.read("live.mcap");
    let mut channels = MessageStream::new(&log).unwrap().map(Result::unwrap);
    let cloud = channels.find(|message| message.channel.topic == "/result/view/points").unwrap();
    let schema: Value = serde_json::from_slice(&cloud.channel.schema.as_ref().unwrap().data).unwrap();
    let cloud: Value = serde_json::from_slice(&cloud.data).unwrap();
    let wrong = |place: &str, value: Value| {
        let mut cloud = cloud.clone();
        *cloud.pointer_mut(place).unwrap() = value;
        faults(&schema, &cloud).len()
    };
    assert_eq!(wrong("/point_stride", 16.into()), 0);
    assert_eq!(wrong("/point_stride", "16".into()), 1);
    assert_eq!(wrong("/point_stride", (-1).into()), 1);
    assert_eq!(wrong("/fields/0/type", 9.into()), 1);
    assert_eq!(wrong("/timestamp/nsec", 1_000_000_000.into()), 1);
    assert_eq!(wrong("/data", "!".into()), 1);
    let mut less = cloud.clone();
    less.as_object_mut().unwrap().remove("frame_id");
    assert_eq!(faults(&schema, &less).len(), 1);
}

/// For each point in a point cloud message, the number of its head and its position.
fn points_of(cloud: &Value) -> Vec<(u8, [f64; 3])> {
    let origin = numbers(&cloud["pose"]["position"], ["x", "y", "z"]);
    let stride = usize::try_from(cloud["point_stride"].as_u64().unwrap()).unwrap();
    let fields = cloud["fields"].as_array().unwrap();
    let offset = |name: &str| {
        let field = fields.iter().find(|field| field["name"] == name).unwrap();
        usize::try_from(field["offset"].as_u64().unwrap()).unwrap()
    };
    let data = base64(cloud["data"].as_str().unwrap()).unwrap();
    assert_eq!(data.len() % stride, 0);
    let point = |point: &[u8]| {
        let float = |name| {
            let at = offset(name);
            f64::from(f32::from_le_bytes(point[at..at + 4].try_into().unwrap()))
        };
        (point[offset("head")], [origin[0] + float("x"), origin[1] + float("y"), origin[2] + float("z")])
    };
    data.chunks(stride).map(point).collect()
}

#[test]
fn summary_and_indexes_match_a_full_read() {
    let (folder, _) = recorded();
    let log = folder.read("live.mcap");
    let mut counts: BTreeMap<u16, u64> = BTreeMap::new();
    let mut times = Vec::new();
    for message in MessageStream::new(&log).unwrap().map(Result::unwrap) {
        *counts.entry(message.channel.id).or_default() += 1;
        times.push(message.log_time);
    }
    let summary = Summary::read(&log).unwrap().unwrap();
    let stats = summary.stats.as_ref().unwrap();
    assert_eq!(stats.message_count, times.len() as u64);
    assert_eq!(stats.message_start_time, *times.iter().min().unwrap());
    assert_eq!(stats.message_end_time, *times.iter().max().unwrap());
    assert_eq!(stats.channel_message_counts, counts);
    assert_eq!(stats.channel_count as usize, summary.channels.len());
    assert_eq!(stats.schema_count as usize, summary.schemas.len());
    assert_eq!(stats.chunk_count as usize, summary.chunk_indexes.len());
    assert_eq!(stats.attachment_count as usize, summary.attachment_indexes.len());
    assert_eq!(stats.metadata_count as usize, summary.metadata_indexes.len());
    let mut indexed: BTreeMap<u16, u64> = BTreeMap::new();
    // The first chunk is skipped, because it contains channel definitions, but no message.
    for chunk in summary.chunk_indexes.iter().filter(|chunk| !chunk.message_index_offsets.is_empty()) {
        let indexes: Vec<_> = summary.read_message_indexes(&log, chunk).unwrap().into_iter().collect();
        for (channel, entries) in indexes {
            *indexed.entry(channel.id).or_default() += entries.len() as u64;
            // Every lookup decompresses the chunk, so the test checks only some of the index entries.
            for entry in entries.into_iter().step_by(41) {
                let message = summary.seek_message(&log, chunk, &entry).unwrap();
                assert_eq!((message.channel.id, message.log_time), (channel.id, entry.log_time));
            }
        }
    }
    assert_eq!(indexed, counts);
    for index in &summary.attachment_indexes {
        assert_eq!(mcap::read::attachment(&log, index).unwrap().name, index.name);
    }
    for index in &summary.metadata_indexes {
        assert_eq!(mcap::read::metadata(&log, index).unwrap().name, index.name);
    }
}

#[test]
fn view_messages_do_not_affect_replay_verify_or_recover() {
    let (folder, report) = recorded();
    assert_eq!(folder.digest("live.mcap", &[]), report["digest"].as_str().unwrap());
    let answer = folder.headrace(&["verify", "live.mcap"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    let answer = folder.headrace(&["recover", "live.mcap", "-o", "again.mcap"]);
    assert_eq!(answer.code, Some(0), "{}{}", answer.stdout, answer.stderr);
    assert_eq!(view(&folder.read("again.mcap")), view(&folder.read("live.mcap")));
}

#[test]
fn verify_names_the_first_different_pose() {
    let (folder, _) = recorded();
    folder.write("other.toml", VEHICLE.replace("counts_per_metre = 2000", "counts_per_metre = 2000.000001"));
    let answer = folder.headrace(&["verify", "live.mcap", "--vehicle", "other.toml"]);
    assert_eq!(answer.code, Some(4), "{}{}", answer.stdout, answer.stderr);
    assert!(answer.stdout.contains("poses: first difference at tick"), "{}", answer.stdout);
}

/// The layout may only use existing topics, and keys from the schemas of these topics.
#[test]
fn viewer_layout_uses_existing_topics_and_keys() {
    let (folder, _) = recorded();
    let topics = view(&folder.read("live.mcap"));
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/how-to/viewers/layout.json");
    let layout: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut named = Vec::new();
    texts(&layout["configById"], &mut named);
    named.retain(|text| text.starts_with("/result/"));
    assert!(named.len() > 10, "{named:?}");
    for text in named {
        let path = text.strip_prefix("/result/view/").unwrap_or_else(|| panic!("{text}"));
        let mut parts = path.split('.');
        let messages = topics.get(parts.next().unwrap()).unwrap_or_else(|| panic!("{text}: no such topic"));
        let message = messages.last().unwrap();
        for key in parts {
            let key = key.trim_end_matches("[:]");
            assert!(message.get(key).is_some(), "{text}: no key {key}");
        }
    }
    let mut panels = Vec::new();
    texts(&layout["layout"], &mut panels);
    for panel in panels.iter().filter(|text| text.contains('!')) {
        assert!(layout["configById"].get(panel).is_some(), "{panel} has no configuration");
    }
}

/// Collects all keys and texts of a JSON value.
fn texts(value: &Value, found: &mut Vec<String>) {
    match value {
        Value::String(text) => found.push(text.clone()),
        Value::Array(items) => items.iter().for_each(|item| texts(item, found)),
        Value::Object(items) => items.iter().for_each(|(key, item)| {
            found.push(key.clone());
            texts(item, found);
        }),
        _ => {}
    }
}
