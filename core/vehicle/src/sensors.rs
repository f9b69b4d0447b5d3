//! `[[sensors]]` of a vehicle file: the keys that all devices have, and those of each kind of device.

use core::ops::RangeInclusive;

use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::time::DurNs;
use headrace_sensor::SensorConfig;
use headrace_sensor::device::{Device, DeviceKind};

/// Allowed coordinates of a sensor in the body frame, m.
pub(super) const SENSOR_DISTANCE_M: RangeInclusive<f64> = -20.0..=20.0;
/// Allowed mounting angles of a sensor, degrees.
pub(super) const DEGREES: RangeInclusive<f64> = -360.0..=360.0;

/// Sensors of a vehicle file, in the order of the file.
#[derive(Default)]
pub(super) struct Sensors {
    pub(super) devices: Vec<Box<dyn Device>>,
    pub(super) configs: Vec<SensorConfig>,
}

/// Reads all `[[sensors]]` tables. Returns `None` if any of them has an error.
///
/// Errors: the file has no such table. If the caller does not collect errors, also the first invalid table.
pub(super) fn parse(
    root: &Section<'_>,
    tables: Vec<Section<'_>>,
    kinds: &[&dyn DeviceKind],
) -> Result<Option<Sensors>, ConfigError> {
    if tables.is_empty() {
        let problem = "has no sensor; at least one table headed [[sensors]] is needed";
        return root.part(|| Err(root.invalid("sensors", problem)));
    }
    let (mut sensors, mut ids, mut complete) = (Sensors::default(), Vec::new(), true);
    for table in tables {
        match root.part(|| parse_sensor(&table, &mut ids, kinds))? {
            Some((config, device)) => {
                sensors.devices.push(device);
                sensors.configs.push(config);
            }
            None => complete = false,
        }
    }
    Ok(complete.then_some(sensors))
}

/// Reads one `[[sensors]]` table. `ids` contains the ids of earlier sensors, and gets that of this one.
fn parse_sensor(
    section: &Section<'_>,
    ids: &mut Vec<String>,
    kinds: &[&dyn DeviceKind],
) -> Result<(SensorConfig, Box<dyn Device>), ConfigError> {
    let id = section.text("id")?;
    let id_problem = id.as_deref().and_then(|id| id_problem(id, ids));
    ids.extend(id.clone());
    let choices: Vec<(&str, usize)> = kinds.iter().enumerate().map(|(i, kind)| (kind.name(), i)).collect();
    let index = section.choice("plugin", &choices)?;
    let position = section.triple("position_m", SENSOR_DISTANCE_M)?.unwrap_or_default();
    let angles = section.triple("angles_deg", DEGREES)?.unwrap_or_default().map(f64::to_radians);
    let connect = section.text("connect")?.unwrap_or_default();
    let latency_ms = section.number("latency_ms", 0.0..=1000.0)?.unwrap_or(0.0);
    let id = match id_problem {
        Some(problem) => Err(section.invalid("id", problem)),
        None => section.required("id", id),
    };
    let index = section.required("plugin", index)?;
    let kind = kinds.get(index).ok_or_else(|| section.invalid("plugin", "is not in this build"))?;
    let config = SensorConfig {
        id: id.as_ref().cloned().unwrap_or_default(),
        plugin: kind.name().to_owned(),
        connect,
        mount: Mount {
            position: Vec3::new(position[0], position[1], position[2]),
            rotation: Rot::from_roll_pitch_yaw(angles[0], angles[1], angles[2]),
        },
        latency: DurNs::from_secs_f64(latency_ms / 1000.0),
    };
    let device = kind.configure(&config, section)?;
    section.finish()?;
    id.map(|_| (config, device))
}

/// Id of the operator's input, which is recorded like a sensor.
pub const CONSOLE_ID: &str = "console";

/// Returns the problem with a sensor's id, if any.
fn id_problem(id: &str, ids: &[String]) -> Option<&'static str> {
    let simple = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if id.is_empty() || id.len() > 32 || !id.chars().all(simple) {
        return Some("must be 1 to 32 letters, digits, _ or -");
    }
    if id == CONSOLE_ID {
        return Some("is reserved for the operator's input; choose another id");
    }
    ids.iter().any(|other| other == id).then_some("is the id of an earlier sensor; ids must differ")
}
