//! An A50's table in the vehicle file, and its registration with the loop.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{Device, DeviceKind, Emulated, EmulatorSetup, Sense, SensorKind, SensorSpec};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup};

use crate::decoder::{A50Decoder, DecoderSettings};
use crate::driver;
use crate::emulator::{A50Emulator, Simulated};

/// Name of this device kind in vehicle files.
pub const NAME: &str = "a50";

/// Buffer for several seconds of reports at the highest rate.
const RING_BYTES: usize = 1 << 17;

/// The A50 device kind.
#[derive(Debug, Clone, Copy)]
pub struct A50Kind;

/// An A50 as configured in the vehicle file.
#[derive(Debug, Clone)]
pub struct A50 {
    sensor: SensorConfig,
    meaning: DecoderSettings,
    emulated: Simulated,
}

impl DeviceKind for A50Kind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let latency = sensor.latency;
        let meaning = DecoderSettings {
            fom_max_mps: own.number("fom_max_mps", 0.001..=10.0)?.unwrap_or(0.4),
            max_speed_mps: own.number("max_speed_mps", 0.1..=10.0)?.unwrap_or(3.0),
            latency,
        };
        let rate_hz = own.number("rate_hz", 0.5..=30.0)?.unwrap_or(8.0);
        Ok(Box::new(A50 { sensor: sensor.clone(), meaning, emulated: Simulated { rate_hz, latency } }))
    }
}

impl Device for A50 {
    fn specification(&self) -> SensorSpec {
        SensorSpec {
            sensor: self.sensor.clone(),
            kind: SensorKind::VelocityLog,
            decoder: Box::new(A50Decoder::new(self.meaning)),
            ring_bytes: RING_BYTES,
        }
    }

    fn sense(&self) -> Sense {
        Sense::Velocity
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::VelocityLog(Box::new(A50Emulator::new(self.emulated, setup.start)))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &driver::CARRIERS
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(driver::A50Driver::new())
    }
}
