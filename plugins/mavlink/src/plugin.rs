//! The table in a vehicle file for a sensor that is reported over MAVLink, and the sensor's registration with the loop.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{
    Device, DeviceKind, Emulated, EmulatorSetup, OptionalPayload, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup};

use crate::decoder::{DecoderSettings, DistancePart, MavlinkDecoder, Part};
use crate::driver::{self, MavlinkDriver};
use crate::emulator::AutopilotEmulator;
use crate::frame::without_identity;
use crate::message::{ImuMessage, PressureMessage};

/// Name of this device kind in vehicle files.
pub const NAME: &str = "mavlink";

/// Buffer for several seconds of an autopilot's full output.
const RING_BYTES: usize = 1 << 17;

/// Resolution of the pressures that ArduSub sends for a Bar30, Pa.
const USUAL_RESOLUTION_PA: f64 = 10.0;

/// The MAVLink device kind: sensors that an autopilot reports.
#[derive(Debug, Clone, Copy)]
pub struct MavlinkKind;

/// A sensor reported by an autopilot, as configured in the vehicle file.
#[derive(Debug, Clone)]
pub struct Autopilot {
    sensor: SensorConfig,
    meaning: DecoderSettings,
    rate_hz: f64,
    min_confidence: f64,
}

#[derive(Clone, Copy)]
enum PartName {
    Imu,
    Pressure,
    Distance,
}

impl DeviceKind for MavlinkKind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let names =
            [("imu", PartName::Imu), ("pressure", PartName::Pressure), ("distance", PartName::Distance)];
        let name = own.required("part", own.choice("part", &names)?)?;
        let mut min_confidence = 0.0;
        let part = match name {
            PartName::Imu => imu(own)?,
            PartName::Pressure => pressure(own)?,
            PartName::Distance => {
                min_confidence = own.number("min_confidence", 0.0..=1.0)?.unwrap_or(0.5);
                distance(own)?
            }
        };
        let usual_rate_hz = if matches!(name, PartName::Imu) { 50.0 } else { 10.0 };
        let meaning = DecoderSettings {
            part,
            system_id: byte(own, "system_id", 1)?,
            component_id: byte(own, "component_id", 1)?,
            latency: sensor.latency,
        };
        let rate_hz = own.number("rate_hz", 0.1..=1000.0)?.unwrap_or(usual_rate_hz);
        Ok(Box::new(Autopilot { sensor: sensor.clone(), meaning, rate_hz, min_confidence }))
    }
}

fn imu(own: &Section<'_>) -> Result<Part, ConfigError> {
    let messages = [
        ("raw_imu", Some(ImuMessage::Raw)),
        ("scaled_imu", Some(ImuMessage::Scaled)),
        ("scaled_imu2", Some(ImuMessage::Scaled2)),
        ("scaled_imu3", Some(ImuMessage::Scaled3)),
        ("attitude", None),
    ];
    Ok(Part::Imu { message: own.choice("message", &messages)?.unwrap_or(Some(ImuMessage::Raw)) })
}

fn pressure(own: &Section<'_>) -> Result<Part, ConfigError> {
    let messages = [
        ("scaled_pressure", PressureMessage::First),
        ("scaled_pressure2", PressureMessage::Second),
        ("scaled_pressure3", PressureMessage::Third),
    ];
    Ok(Part::Pressure {
        message: own.choice("message", &messages)?.unwrap_or(PressureMessage::Second),
        resolution_pa: own.number("resolution_pa", 0.01..=10_000.0)?.unwrap_or(USUAL_RESOLUTION_PA),
    })
}

fn distance(own: &Section<'_>) -> Result<Part, ConfigError> {
    Ok(Part::Distance(DistancePart {
        orientation: byte(own, "orientation", 0)?,
        sensor_id: byte(own, "sensor_id", 0)?,
        unknown_confidence: own.number("unknown_confidence", 0.0..=1.0)?.unwrap_or(1.0),
        sound_speed_mps: own.number("sound_speed_mps", 1300.0..=1700.0)?.unwrap_or(1500.0),
    }))
}

fn byte(own: &Section<'_>, key: &'static str, least: i64) -> Result<Option<u8>, ConfigError> {
    Ok(own.integer(key, least..=255)?.and_then(|value| u8::try_from(value).ok()))
}

impl Device for Autopilot {
    fn specification(&self) -> SensorSpec {
        let kind = match self.meaning.part {
            Part::Imu { .. } => SensorKind::Imu,
            Part::Pressure { .. } => SensorKind::Depth,
            Part::Distance(_) => SensorKind::Echosounder { min_confidence: self.min_confidence },
        };
        SensorSpec {
            sensor: self.sensor.clone(),
            kind,
            decoder: Box::new(MavlinkDecoder::new(self.meaning)),
            ring_bytes: RING_BYTES,
        }
    }

    fn sense(&self) -> Sense {
        match self.meaning.part {
            Part::Imu { .. } => Sense::Inertial,
            Part::Pressure { .. } => Sense::Depth,
            Part::Distance(_) => Sense::Echosounder,
        }
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        let emulator = Box::new(AutopilotEmulator::new(self.meaning, self.rate_hz, setup));
        match self.meaning.part {
            Part::Imu { .. } => Emulated::Inertial(emulator),
            Part::Pressure { .. } => Emulated::Depth(emulator),
            Part::Distance(_) => Emulated::Echosounder(emulator),
        }
    }

    fn without(&self, what: OptionalPayload, packet: &[u8], shorter: &mut Vec<u8>) -> bool {
        shorter.clear();
        what == OptionalPayload::Identity && without_identity(packet, shorter).is_some()
    }

    fn line_address(&self) -> Option<String> {
        let DecoderSettings { part, system_id, component_id, .. } = self.meaning;
        let part = match part {
            Part::Imu { message } => format!("{message:?}"),
            Part::Pressure { message, .. } => format!("{message:?}"),
            Part::Distance(distance) => format!("{:?} {:?}", distance.orientation, distance.sensor_id),
        };
        Some(format!("{part} of {system_id:?} {component_id:?}, a {}", self.sense().as_str()))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &driver::CARRIERS
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(MavlinkDriver::new(self.meaning))
    }
}
