//! An inertial unit's table in the vehicle file, and its registration with the loop.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{
    Decoder, Device, DeviceKind, Emulated, EmulatorSetup, InertialNoise, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup};
use headrace_sensor::geometry::time::DurNs;

use crate::codec::MessageSet;
use crate::dbc::decoder::DbcDecoder;
use crate::dbc::emulator::DbcEmulator;
use crate::dbc::keys;
use crate::dbc::mapping::Mapping;
use crate::decoder::{AxisOrder, DecoderSettings, ImuDecoder};
use crate::driver;
use crate::emulator::ImuEmulator;
use crate::noise;
use crate::sets::{j1939, xsens};

/// Name of this device kind in vehicle files.
pub const NAME: &str = "imu_can";

/// Buffer for several seconds of four frames per sample at the usual rate.
const RING_BYTES: usize = 1 << 17;

const USUAL_TICK_US: i64 = 100;

/// The device kind of inertial units on CAN.
#[derive(Debug, Clone, Copy)]
pub struct ImuCanKind;

/// An inertial unit as configured in the vehicle file.
#[derive(Debug, Clone)]
pub struct CanImu {
    sensor: SensorConfig,
    known: Known,
    rate_hz: f64,
}

/// Source of the frame definitions: preset or DBC.
#[derive(Debug, Clone)]
enum Known {
    Preset(DecoderSettings),
    Dbc(Box<Mapping>),
}

#[derive(Clone, Copy)]
enum Preset {
    Xsens,
    Sbg,
    J1939,
    Bosch,
}

impl DeviceKind for ImuCanKind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let rate_hz = own.number("rate_hz", 1.0..=1000.0)?.unwrap_or(100.0);
        let known = match own.named_file("dbc")? {
            Some(_) if own.text("preset")?.is_some() => {
                return Err(own.invalid("dbc", "is given beside preset; give only one of them"));
            }
            Some(file) => Known::Dbc(Box::new(keys::mapping(&file, own, sensor.latency)?)),
            None => Known::Preset(preset(sensor, own)?),
        };
        Ok(Box::new(CanImu { sensor: sensor.clone(), known, rate_hz }))
    }
}

fn preset(sensor: &SensorConfig, own: &Section<'_>) -> Result<DecoderSettings, ConfigError> {
    let presets = [
        ("xsens_mti600", Preset::Xsens),
        ("sbg_ellipse", Preset::Sbg),
        ("j1939", Preset::J1939),
        ("bosch_mm5", Preset::Bosch),
    ];
    let preset = own.required("preset", own.choice("preset", &presets)?)?;
    let mut axis_order = AxisOrder::Yxz;
    let mut tick_us = USUAL_TICK_US;
    let set = match preset {
        Preset::Xsens => {
            tick_us = own.integer("sample_time_tick_us", 1..=1_000_000)?.unwrap_or(USUAL_TICK_US);
            MessageSet::Xsens(xsens::Ids { base: id_base(own)? })
        }
        Preset::Sbg => MessageSet::Sbg,
        Preset::J1939 => {
            let orders = [("yxz", AxisOrder::Yxz), ("xyz", AxisOrder::Xyz)];
            axis_order = own.choice("axis_order", &orders)?.unwrap_or(axis_order);
            let address = own.integer("source_address", 0..=253)?;
            let source_address = address.and_then(|address| u8::try_from(address).ok());
            MessageSet::J1939(j1939::Network { source_address })
        }
        Preset::Bosch => MessageSet::Bosch,
    };
    Ok(DecoderSettings {
        set,
        axis_order,
        sample_time_tick: DurNs(tick_us.saturating_mul(1000)),
        latency: sensor.latency,
    })
}

fn id_base(own: &Section<'_>) -> Result<Option<u32>, ConfigError> {
    let base = own.integer("id_base", 0..=0x1FFF_FF00)?.and_then(|base| u32::try_from(base).ok());
    if base.is_some_and(|base| base & 0xFF != 0) {
        return Err(own.invalid("id_base", "must end in 00: the lowest byte is the message's code"));
    }
    Ok(base)
}

impl Device for CanImu {
    fn specification(&self) -> SensorSpec {
        let decoder: Box<dyn Decoder> = match &self.known {
            Known::Preset(meaning) => Box::new(ImuDecoder::new(*meaning)),
            Known::Dbc(mapping) => Box::new(DbcDecoder::new(mapping)),
        };
        SensorSpec { sensor: self.sensor.clone(), kind: SensorKind::Imu, decoder, ring_bytes: RING_BYTES }
    }

    fn inertial_noise(&self) -> Option<InertialNoise> {
        match &self.known {
            Known::Preset(meaning) => noise::of(meaning.set),
            Known::Dbc(_) => None,
        }
    }

    fn sense(&self) -> Sense {
        Sense::Inertial
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        Emulated::Inertial(match &self.known {
            Known::Preset(meaning) => Box::new(ImuEmulator::new(*meaning, self.rate_hz, setup.start)),
            Known::Dbc(mapping) => Box::new(DbcEmulator::new(**mapping, self.rate_hz, setup.start)),
        })
    }

    fn line_address(&self) -> Option<String> {
        Some(match &self.known {
            Known::Preset(meaning) => format!("{:?}", meaning.set),
            Known::Dbc(mapping) => format!("{:?}", Mapping { latency: DurNs::ZERO, ..**mapping }),
        })
    }

    fn carriers(&self) -> &'static [Carrier] {
        &driver::CARRIERS
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        Box::new(driver::listener())
    }
}
