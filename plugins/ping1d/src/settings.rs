//! An echosounder's settings: the keys of its table in the vehicle file.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::DurNs;

use crate::codec::ScanRange;

/// Trigger of the pings: host or device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Polling {
    /// The host requests each distance.
    Asked,
    /// The device sends profiles at its interval.
    Continuous,
}

/// An echosounder's settings, checked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Minimum confidence, 0 to 1, of readings that navigation uses.
    pub min_confidence: f64,
    /// Time between two successive pings.
    pub interval: DurNs,
    /// Speed of sound setting of the device, m/s.
    pub sound_speed_mps: f64,
    /// Device id on the line.
    pub device_id: u8,
    /// Trigger of the pings: host or device.
    pub polling: Polling,
    /// Listening range; `None` if the device chooses range and gain.
    pub scan: Option<ScanRange>,
    /// Gain index, 0 to 6; `None` to leave the device's gain unchanged.
    pub gain: Option<u8>,
}

impl Settings {
    /// Reads an echosounder's keys.
    ///
    /// Errors: a key isn't allowed, or the latency isn't below the interval.
    pub fn read(sensor: &SensorConfig, own: &Section<'_>) -> Result<Self, ConfigError> {
        let device_id = own.integer("device_id", 1..=254)?.and_then(|id| u8::try_from(id).ok());
        let settings = Self {
            min_confidence: own.number("min_confidence", 0.0..=1.0)?.unwrap_or(0.5),
            // In the protocol the interval is a 16-bit number of whole milliseconds.
            interval: DurNs::from_millis(own.integer("interval_ms", 10..=65_535)?.unwrap_or(66)),
            sound_speed_mps: own.number("sound_speed_mps", 1000.0..=2000.0)?.unwrap_or(1500.0),
            device_id: device_id.unwrap_or(1),
            polling: own
                .choice("polling", &[("asked", Polling::Asked), ("continuous", Polling::Continuous)])?
                .unwrap_or(Polling::Asked),
            scan: own.number("scan_m", 1.0..=100.0)?.map(|metres| ScanRange {
                start_mm: 0,
                length_mm: u32::try_from(math::round_to_i64(metres * 1000.0)).unwrap_or(0),
            }),
            gain: own.integer("gain", 0..=6)?.and_then(|gain| u8::try_from(gain).ok()),
        };
        if sensor.latency >= settings.interval {
            let problem = "must be below interval_ms: a device answers before it is asked again";
            return Err(own.invalid("latency_ms", problem));
        }
        Ok(settings)
    }

    /// Speed of sound in wire units, mm/s.
    pub fn sound_speed_mmps(&self) -> u32 {
        u32::try_from(math::round_to_i64(self.sound_speed_mps * 1000.0)).unwrap_or(0)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use headrace_sensor::config::Document;
    use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};

    use super::*;

    /// A forward-looking echosounder without latency.
    pub(crate) fn sensor() -> SensorConfig {
        SensorConfig {
            id: "left".to_owned(),
            plugin: "ping1d".to_owned(),
            connect: String::new(),
            mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
            latency: DurNs::ZERO,
        }
    }

    /// Settings from the text of a vehicle file's table.
    pub(crate) fn settings(text: &str) -> Result<Settings, ConfigError> {
        let root = Document::new("v.toml", text).root()?;
        let settings = Settings::read(&sensor(), &root)?;
        root.finish()?;
        Ok(settings)
    }

    #[test]
    fn every_key_is_read_and_has_a_default() {
        let usual = Settings {
            min_confidence: 0.5,
            interval: DurNs::from_millis(66),
            sound_speed_mps: 1500.0,
            device_id: 1,
            polling: Polling::Asked,
            scan: None,
            gain: None,
        };
        assert_eq!(settings(""), Ok(usual));
        let text = "min_confidence = 0.8\ninterval_ms = 50\nsound_speed_mps = 1447\ndevice_id = 3\n\
                    polling = \"continuous\"\nscan_m = 8\ngain = 2";
        let other = Settings {
            min_confidence: 0.8,
            interval: DurNs::from_millis(50),
            sound_speed_mps: 1447.0,
            device_id: 3,
            polling: Polling::Continuous,
            scan: Some(ScanRange { start_mm: 0, length_mm: 8000 }),
            gain: Some(2),
        };
        assert_eq!(settings(text), Ok(other));
    }

    #[test]
    fn invalid_keys_are_refused_with_their_line() {
        let error = |text: &str| settings(text).unwrap_err().to_string();
        assert_eq!(error("device_id = 0"), "v.toml:1: device_id = 0: must be a whole number from 1 to 254");
        assert!(error("\nmin_confidence = 50").starts_with("v.toml:2: min_confidence = 50: must be"));
        let late = SensorConfig { latency: DurNs::from_millis(66), ..sensor() };
        let root = Document::new("v.toml", "latency_ms = 66").root().unwrap();
        let error = Settings::read(&late, &root).unwrap_err().to_string();
        assert!(error.starts_with("v.toml:1: latency_ms = 66: must be below interval_ms"), "{error}");
    }
}
