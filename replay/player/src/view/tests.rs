use std::collections::BTreeMap;

use headrace_coverage::{Cause, Judgement, RunChange, Verdict};
use headrace_geometry::tunnel::shapes;
use headrace_monitor::head_descriptions::HeadDescriptions;
use serde_json::Value;

use super::*;

fn view() -> View {
    View::new(Site {
        profile: shapes::circle(3.0).unwrap(),
        target_m: 0.5,
        section_m: 0.25,
        run_up_m: 0.5,
        length_m: 100.0,
        head_descriptions: HeadDescriptions::default(),
        heads: vec![2, 5],
    })
}

fn record(kind: RecordKind, words: &[u64]) -> Vec<u64> {
    [&[(words.len() as u64) << 8 | kind as u64], words].concat()
}

/// Returns the messages, by topic, that the view creates from records of a stream.
fn taken(view: &mut View, stream: &str, at: u64, records: &[Vec<u64>]) -> BTreeMap<String, Vec<Value>> {
    let words = [&[0, 0], records.concat().as_slice()].concat();
    let message: Vec<u8> = words.into_iter().flat_map(u64::to_le_bytes).collect();
    let channel = STREAMS.iter().position(|name| *name == stream).unwrap();
    let mut made = Vec::new();
    view.take(u16::try_from(channel).unwrap(), MonoNs(at), &message, &mut made);
    by_topic(&made)
}

fn by_topic(made: &[Made]) -> BTreeMap<String, Vec<Value>> {
    let channels = channels();
    let mut topics: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for Made { channel, bytes, .. } in made {
        let topic = &channels[usize::from(*channel) - STREAMS.len()].topic;
        let name = topic.strip_prefix("/result/view/").unwrap().to_owned();
        topics.entry(name).or_default().push(serde_json::from_slice(bytes).unwrap());
    }
    topics
}

fn bits<const N: usize>(numbers: [f64; N]) -> Vec<u64> {
    numbers.map(f64::to_bits).to_vec()
}

fn pose(at: u64, x_m: f64) -> Vec<u64> {
    let numbers = bits([x_m, 0.5, 3.0, 0.5, 0.5, 0.5, 0.5, 0.2, 0.02, 0.01, 0.001, 0.002]);
    record(RecordKind::Pose, &[&[at], numbers.as_slice()].concat())
}

fn sample(at: u64, source: u64, place: [f64; 4]) -> Vec<u64> {
    record(RecordKind::Sample, &[&[at, source, 0], bits(place).as_slice()].concat())
}

/// Returns a record of a section's judgement with a cause.
fn section(at: u64, index: i64, change: Judgement, verdict: Verdict) -> Vec<u64> {
    let head = [at, index.cast_unsigned(), change as u64, verdict as u64];
    let tail = bits([10.1, 9.4, 0.3, 0.2, 0.2, 0.0, 0.0]);
    let cause = [Cause::TooFast as u64];
    record(RecordKind::Section, &[&head, bits([0.8, 0.02]).as_slice(), &cause, &tail].concat())
}

#[test]
fn pose_is_published_as_transform_pose_and_vehicle_state() {
    let mut view = view();
    let made = taken(&mut view, "poses", 7, &[pose(1_200_000_000, 12.345_678)]);
    let transforms = made["transforms"][0]["transforms"].as_array().unwrap();
    assert_eq!(transforms[0]["child_frame_id"], "vehicle");
    assert_eq!(transforms[0]["timestamp"], serde_json::json!({"sec": 1, "nsec": 200_000_000}));
    assert_eq!(transforms[0]["translation"], serde_json::json!({"x": 12.3457, "y": 0.5, "z": 3.0}));
    assert_eq!(transforms[1]["child_frame_id"], "wall");
    assert!(transforms[1]["translation"]["y"].as_f64().unwrap() > 3.9, "the wall lies outside the tunnel");
    assert_eq!(made["pose"][0]["pose"]["orientation"]["w"], 0.5);
    let vehicle = &made["vehicle"][0];
    assert_eq!((&vehicle["position"], &vehicle["speed_mps"]), (&"known".into(), &0.2.into()));
    assert_eq!((&vehicle["place_sd_m"], &vehicle["tilt_sd_deg"]), (&0.01.into(), &0.06.into()));

    let no_fix = record(RecordKind::NoPose, &[1_400_000_000, NoFix::Chainage as u64]);
    let made = taken(&mut view, "poses", 8, &[no_fix]);
    assert_eq!(made.keys().collect::<Vec<_>>(), ["vehicle"]);
    assert_eq!(made["vehicle"][0]["position"], "no_chainage");
    assert_eq!(made["vehicle"][0].get("chainage_m"), None, "viewers have no null");
}

#[test]
fn samples_are_published_as_clouds_of_half_a_second() {
    let mut view = view();
    let ms = |ms: u64| ms * 1_000_000;
    let samples: Vec<_> = (0..12)
        .map(|k| sample(ms(100 * k), if k % 2 == 0 { 2 } else { 5 }, [6900.25, 1.0, -2.5, 4.0]))
        .collect();
    let made = taken(&mut view, "pings", ms(1200), &samples);
    let clouds = &made["points"];
    assert_eq!(clouds.len(), 2, "the third cloud isn't complete yet");
    assert_eq!(clouds[0]["pose"]["position"]["x"], 6900.0);
    // The five points alternate between two heads: x = 0.25 with the head number in its lowest byte, y = 1, z = -2.5.
    let point = |head: u8| [[head, 0, 0x80, 0x3e], 1_f32.to_le_bytes(), (-2.5_f32).to_le_bytes()].concat();
    let expected = [point(0), point(1), point(0), point(1), point(0)].concat();
    assert_eq!(clouds[0]["data"], messages::base64(&expected));
    let mut made = Vec::new();
    view.end(&mut made);
    assert_eq!(by_topic(&made)["points"].len(), 1, "the end publishes the incomplete cloud");
}

#[test]
fn wall_grid_covers_samples_and_verdicts_near_the_vehicle() {
    let mut view = view();
    taken(&mut view, "pings", 1, &[sample(1, 2, [10.1, 0.0, 0.0, 9.4]), sample(1, 2, [1e9, 0.0, 0.0, 1.0])]);
    taken(&mut view, "judgements", 1, &[section(1, 40, Judgement::Raised, Verdict::Fail)]);
    let made = taken(&mut view, "poses", 2, &[pose(2, 10.0)]);
    let grid = &made["wall"][0];
    let (columns, stride) = (grid["column_count"].as_u64().unwrap(), grid["cell_stride"].as_u64().unwrap());
    assert_eq!(grid["row_stride"], columns * stride);
    let rows = (6.0 * core::f64::consts::PI / grid["cell_size"]["y"].as_f64().unwrap()).round();
    let len = grid["data"].as_str().unwrap().len() as f64 * 0.75;
    assert!((len - rows * (columns * stride) as f64).abs() < 3.0, "{rows} rows, {len} bytes");
    assert!(!taken(&mut view, "poses", 3, &[pose(3, 10.0)]).contains_key("wall"), "nothing has changed");
}

#[test]
fn missed_stretch_is_announced_once_when_raised_and_once_when_cleared() {
    let mut view = view();
    let run = |change: RunChange| record(RecordKind::Run, &[0, change as u64]);
    let raised = [run(RunChange::Raised), section(1, 40, Judgement::Raised, Verdict::Fail)];
    let made = taken(&mut view, "judgements", 1, &raised);
    assert_eq!(
        made["alerts"][0]["message"],
        "ch 0+010.00  too fast (0.30 m/s): holes over 0.5 m at 12 o'clock; inspect again from 0+009.50"
    );
    assert_eq!((&made["alerts"][0]["level"], &made["sections"][0]["flagged"]), (&3.into(), &true.into()));
    let grown = [run(RunChange::Changed), section(2, 41, Judgement::Raised, Verdict::Fail)];
    assert_eq!(taken(&mut view, "judgements", 2, &grown).get("alerts"), None);
    let missed = &taken(&mut view, "poses", 3, &[pose(3, 10.0)])["missed"][0];
    assert_eq!((&missed["missed_m"], missed["stretches"].as_array().unwrap().len()), (&0.5.into(), 1));
    assert_eq!(
        (&missed["stretches"][0]["from_m"], &missed["stretches"][0]["to_m"]),
        (&10.0.into(), &10.5.into())
    );

    let less = [run(RunChange::Changed), section(4, 40, Judgement::Cleared, Verdict::Pass)];
    assert_eq!(taken(&mut view, "judgements", 4, &less).get("alerts"), None);
    let none = [run(RunChange::Cleared), section(5, 41, Judgement::Cleared, Verdict::Pass)];
    let made = taken(&mut view, "judgements", 5, &none);
    assert_eq!(made["alerts"][0]["message"], "cleared  ch 0+010.00 to 0+010.50");
    assert_eq!(made["sections"][0]["cause"], "", "a section that passes has no cause");
}

fn advice(at: u64, v_max_mps: f64, will_exceed: bool) -> Vec<u64> {
    let head = [at, v_max_mps.to_bits(), Reason::HelixPitch as u64, u64::from(will_exceed)];
    record(RecordKind::Advice, &[&head, bits([0.0; 4]).as_slice(), &[0, 0, 0], &bits([0.3])].concat())
}

#[test]
fn advice_is_published_on_change_and_every_second() {
    let mut view = view();
    taken(&mut view, "poses", 0, &[pose(0, 10.0)]);
    let updates: Vec<_> = (0..15).map(|k| advice(k * 200_000_000, 0.3, false)).collect();
    let made = taken(&mut view, "advice", 3_000_000_000, &updates);
    assert_eq!((made["advice"].len(), made["alerts"].len()), (3, 1));
    assert_eq!(made["advice"][0]["words"], "may go 0.30 m/s (distance between turns)");
    let made = taken(&mut view, "advice", 3_000_000_001, &[advice(3_000_000_000, 0.1, true)]);
    assert_eq!(made["alerts"][0]["message"], "TOO FAST: at most 0.10 m/s");
    assert_eq!((&made["alerts"][0]["level"], &made["advice"][0]["speed_mps"]), (&3.into(), &0.2.into()));
}

/// Viewers' schema parsers support only a single word for `type`, and no references.
#[test]
fn schemas_use_only_features_that_viewers_support() {
    fn look(schema: &Value, place: &str) {
        let kind = schema["type"].as_str().unwrap_or_else(|| panic!("{place}: no type"));
        for (key, inner) in schema["properties"].as_object().into_iter().flatten() {
            look(inner, &format!("{place}/{key}"));
        }
        if kind == "array" {
            look(&schema["items"], &format!("{place}[]"));
        }
        assert!(schema.get("$ref").is_none() && kind != "null", "{place}");
    }
    let channels = channels();
    assert_eq!(channels.len(), 9);
    for channel in channels {
        assert_eq!(
            (channel.schema_encoding.as_str(), channel.message_encoding.as_str()),
            ("jsonschema", "json")
        );
        let schema: Value = serde_json::from_str(&channel.schema).unwrap();
        assert_eq!(schema["title"], channel.schema_name);
        look(&schema, &channel.topic);
    }
}

#[test]
fn invalid_records_are_not_published() {
    let mut view = view();
    for kind in 0..=255_u64 {
        for len in 0..20_u64 {
            let words: Vec<u64> = (0..len).map(|word| u64::MAX - word).collect();
            let made = taken(&mut view, "judgements", 1, &[[&[len << 8 | kind], words.as_slice()].concat()]);
            assert!(!made.contains_key("sections") && !made.contains_key("transforms"), "{kind} {made:?}");
        }
    }
}
