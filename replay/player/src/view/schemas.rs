//! The topics of a view, their channels and their schemas.
//!
//! Names and keys of `foxglove.*` are those of Foxglove's published JSON Schemas (docs.foxglove.dev, "Message
//! schemas"). Only features that viewers' schema parsers support are used. `type` is one word, and there are no
//! references and no null. Enumerations state their type beside their names, which some parsers require and others
//! ignore.

use serde_json::{Value, json};

use crate::log::ResultChannel;
use crate::log::format::VIEW_PREFIX;

/// The topics of a view, in the order of their channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    Transforms,
    Pose,
    Vehicle,
    Points,
    Wall,
    Sections,
    Missed,
    Advice,
    Alerts,
}

impl Topic {
    /// All topics of a view, in the order of their channels.
    pub(super) const ALL: [Self; 9] = [
        Self::Transforms,
        Self::Pose,
        Self::Vehicle,
        Self::Points,
        Self::Wall,
        Self::Sections,
        Self::Missed,
        Self::Advice,
        Self::Alerts,
    ];
}

/// Returns the channels of a view. Their numbers follow those of the result streams.
pub fn channels() -> Vec<ResultChannel> {
    let channel = |topic: &Topic| {
        let (name, schema_name, schema) = schema_of(*topic);
        ResultChannel {
            topic: format!("{VIEW_PREFIX}{name}"),
            schema_name: schema_name.to_owned(),
            schema_encoding: "jsonschema".to_owned(),
            schema: titled(schema_name, schema).to_string(),
            message_encoding: "json".to_owned(),
            // Viewer messages can be computed again from the rest of the log, so they are dropped first when the disk
            // fills.
            follows_echoes: true,
        }
    };
    Topic::ALL.iter().map(channel).collect()
}

/// Returns the name of a topic, the name of its schema, and the schema.
fn schema_of(topic: Topic) -> (&'static str, &'static str, Value) {
    match topic {
        Topic::Transforms => ("transforms", "foxglove.FrameTransforms", transforms()),
        Topic::Pose => ("pose", "foxglove.PoseInFrame", pose_in_frame()),
        Topic::Vehicle => ("vehicle", "headrace.Vehicle", vehicle()),
        Topic::Points => ("points", "foxglove.PointCloud", point_cloud()),
        Topic::Wall => ("wall", "foxglove.Grid", grid()),
        Topic::Sections => ("sections", "headrace.Section", section()),
        Topic::Missed => ("missed", "headrace.Missed", missed()),
        Topic::Advice => ("advice", "headrace.Advice", advice()),
        Topic::Alerts => ("alerts", "foxglove.Log", log()),
    }
}

/// Returns the schema of an object. All keys except `optional` are required.
fn object(properties: &Value, optional: &[&str]) -> Value {
    let keys = properties.as_object().into_iter().flat_map(|properties| properties.keys());
    let required: Vec<&String> = keys.filter(|key| !optional.contains(&key.as_str())).collect();
    json!({"type": "object", "required": required, "properties": properties})
}

/// Returns a schema with a title added.
fn titled(title: &str, mut schema: Value) -> Value {
    if let Some(schema) = schema.as_object_mut() {
        schema.insert("title".to_owned(), title.into());
    }
    schema
}

fn described(kind: &str, words: &str) -> Value {
    json!({"type": kind, "description": words})
}

fn number(words: &str) -> Value {
    described("number", words)
}

fn text(words: &str) -> Value {
    described("string", words)
}

fn count() -> Value {
    json!({"type": "integer", "minimum": 0})
}

fn time() -> Value {
    let nsec = json!({"type": "integer", "minimum": 0, "maximum": 999_999_999});
    titled("time", object(&json!({"sec": count(), "nsec": nsec}), &[]))
}

fn components(keys: &[&str]) -> Value {
    let properties: Value = keys.iter().map(|key| ((*key).to_owned(), json!({"type": "number"}))).collect();
    object(&properties, &[])
}

fn vector3() -> Value {
    components(&["x", "y", "z"])
}

fn quaternion() -> Value {
    components(&["x", "y", "z", "w"])
}

fn pose() -> Value {
    object(&json!({"position": vector3(), "orientation": quaternion()}), &[])
}

fn list(items: &Value) -> Value {
    json!({"type": "array", "items": items})
}

/// Returns the schema of an enumeration, with names for consecutive numbers from `first`.
fn names(first: u32, names: &[&str]) -> Value {
    let named: Vec<Value> =
        (first..).zip(names).map(|(number, name)| json!({"title": name, "const": number})).collect();
    json!({"type": "integer", "oneOf": named})
}

fn packed_fields() -> Value {
    let kinds = ["UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64"];
    let kind = names(0, &kinds);
    list(&object(&json!({"name": {"type": "string"}, "offset": count(), "type": kind}), &[]))
}

fn packed() -> Value {
    json!({"type": "string", "contentEncoding": "base64"})
}

fn transforms() -> Value {
    let transform = json!({
        "timestamp": time(),
        "parent_frame_id": {"type": "string"},
        "child_frame_id": {"type": "string"},
        "translation": vector3(),
        "rotation": quaternion(),
    });
    object(&json!({"transforms": list(&object(&transform, &[]))}), &[])
}

fn pose_in_frame() -> Value {
    object(&json!({"timestamp": time(), "frame_id": {"type": "string"}, "pose": pose()}), &[])
}

fn point_cloud() -> Value {
    let properties = json!({
        "timestamp": time(),
        "frame_id": {"type": "string"},
        "pose": pose(),
        "point_stride": count(),
        "fields": packed_fields(),
        "data": packed(),
    });
    object(&properties, &[])
}

fn grid() -> Value {
    let properties = json!({
        "timestamp": time(),
        "frame_id": {"type": "string"},
        "pose": pose(),
        "column_count": count(),
        "cell_size": components(&["x", "y"]),
        "row_stride": count(),
        "cell_stride": count(),
        "fields": packed_fields(),
        "data": packed(),
    });
    object(&properties, &[])
}

fn log() -> Value {
    let properties = json!({
        "timestamp": time(),
        "level": names(0, &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"]),
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": count(),
    });
    object(&properties, &[])
}

fn vehicle() -> Value {
    let properties = json!({
        "timestamp": time(),
        "position": text("\"known\", or the reason why the position is unknown."),
        "chainage_m": number("Chainage, metres."),
        "left_m": number("Position left of the axis, metres."),
        "up_m": number("Position above the floor's centre, metres."),
        "roll_deg": number("Roll, degrees."),
        "pitch_deg": number("Pitch, degrees."),
        "yaw_deg": number("Yaw against the tunnel, degrees."),
        "speed_mps": number("Speed along the tunnel, metres a second, positive inwards."),
        "chainage_sd_m": number("Standard deviation of the chainage, metres."),
        "place_sd_m": number("Standard deviation of the position in the cross-section, in the worse direction, metres."),
        "tilt_sd_deg": number("Standard deviation of roll or pitch, degrees."),
        "yaw_sd_deg": number("Standard deviation of yaw, degrees."),
    });
    let known = ["chainage_m", "left_m", "up_m", "roll_deg", "pitch_deg", "yaw_deg", "speed_mps"];
    let deviations = ["chainage_sd_m", "place_sd_m", "tilt_sd_deg", "yaw_sd_deg"];
    object(&properties, &[known.as_slice(), &deviations].concat())
}

fn section() -> Value {
    let properties = json!({
        "timestamp": time(),
        "start_m": number("Chainage at which it begins, metres."),
        "end_m": number("Chainage at which it ends, metres."),
        "verdict": text("pass, fail, cannot_say or open."),
        "hole_m": number("Diameter of its largest hole, metres."),
        "hole_sd_m": number("Standard deviation of the hole's diameter, metres."),
        "hole_x_m": number("Chainage of the hole's centre, metres."),
        "hole_clock": text("Clock position of the hole's centre, looking along the tunnel."),
        "target_m": number("The target, metres."),
        "flagged": described("boolean", "Driving on can't fill the hole."),
        "cause": text("Reason why the section fails; empty if it doesn't fail."),
        "words": text("Text about the section, for people."),
    });
    object(&properties, &[])
}

fn missed() -> Value {
    let stretch = json!({
        "from_m": number("Chainage at which it begins, metres."),
        "to_m": number("Chainage at which it ends, metres."),
        "hole_m": number("Diameter of its largest hole, metres."),
        "cause": text("Reason why the stretch was missed."),
    });
    let properties = json!({
        "timestamp": time(),
        "missed_m": number("Total length of the flagged sections, metres."),
        "stretches": list(&object(&stretch, &[])),
    });
    object(&properties, &[])
}

fn advice() -> Value {
    let properties = json!({
        "timestamp": time(),
        "v_max_mps": number("The largest speed at which the target is met, metres a second; 0 if no speed meets it."),
        "speed_mps": number("Speed at that time, metres a second."),
        "will_exceed": described("boolean", "The present turn will exceed the target."),
        "reason": text("Factor that limits the speed."),
        "words": text("Text of the advice, for people."),
    });
    object(&properties, &["speed_mps"])
}
