//! A Bar100's table in the vehicle file, and its registration with the loop.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{Device, DeviceKind, Emulated, EmulatorSetup, Sense, SensorKind, SensorSpec};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup};

use crate::calibration::{Calibration, Overrides, PressureMode, STANDARD_ATMOSPHERE_BAR};
use crate::decoder::{Bar100Decoder, DecoderSettings};
use crate::driver::{Bar100Driver, CARRIERS};
use crate::emulator::{Bar100Emulator, Simulated};

/// Name of this device kind in vehicle files.
pub const NAME: &str = "bar100";

/// Buffer for two minutes of measurements at the usual rate.
const RING_BYTES: usize = 1 << 16;

/// Pressure range of a Bar100 as sold, bar.
const PART_LIMITS_BAR: (f64, f64) = (0.0, 100.0);

/// The Bar100 device kind.
#[derive(Debug, Clone, Copy)]
pub struct Bar100Kind;

/// A Bar100 as configured in the vehicle file.
#[derive(Debug, Clone)]
pub struct Bar100 {
    sensor: SensorConfig,
    meaning: DecoderSettings,
    emulated: Simulated,
}

impl DeviceKind for Bar100Kind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let modes =
            [("pr", PressureMode::Vented), ("pa", PressureMode::Sealed), ("paa", PressureMode::Absolute)];
        let overrides = Overrides {
            p_min_bar: own.number("p_min_bar", -1.0..=1000.0)?,
            p_max_bar: own.number("p_max_bar", -1.0..=1000.0)?,
            mode: own.choice("p_mode", &modes)?,
        };
        let ambient_bar = own.number("ambient_bar", 0.4..=1.1)?.unwrap_or(STANDARD_ATMOSPHERE_BAR);
        let reject_busy = own.boolean("reject_busy")?.unwrap_or(false);
        let rate_hz = own.number("rate_hz", 0.1..=100.0)?.unwrap_or(20.0);
        let calibration = Calibration::new(
            overrides.mode.unwrap_or(PressureMode::Sealed),
            overrides.p_min_bar.unwrap_or(PART_LIMITS_BAR.0),
            overrides.p_max_bar.unwrap_or(PART_LIMITS_BAR.1),
        )
        .map_err(|error| own.invalid("p_max_bar", &error.to_string()))?;
        let latency = sensor.latency;
        Ok(Box::new(Bar100 {
            sensor: sensor.clone(),
            meaning: DecoderSettings { overrides, ambient_bar, reject_busy, latency },
            emulated: Simulated { calibration, ambient_bar, rate_hz, latency },
        }))
    }
}

impl Device for Bar100 {
    fn specification(&self) -> SensorSpec {
        SensorSpec {
            sensor: self.sensor.clone(),
            kind: SensorKind::Depth,
            decoder: Box::new(Bar100Decoder::new(self.meaning)),
            ring_bytes: RING_BYTES,
        }
    }

    fn sense(&self) -> Sense {
        Sense::Depth
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::Depth(Box::new(Bar100Emulator::new(self.emulated, setup)))
    }

    fn carriers(&self) -> &'static [Carrier] {
        &CARRIERS
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(Bar100Driver::new(self.emulated.rate_hz))
    }
}
