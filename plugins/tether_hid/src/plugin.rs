//! A cable counter's table in the vehicle file, and its registration with the loop.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::{ConfigError, Section};
use headrace_sensor::device::{
    CounterSpec, Decoder, Device, DeviceKind, Emulated, EmulatorSetup, Sense, SensorKind, SensorSpec,
};
use headrace_sensor::driver::{Carrier, Driver, DriverSetup};

use crate::decoder::{Counter, HidDecoder, LineDecoder};
use crate::driver;
use crate::emulator::{CounterSettings, HidEmulator, LineEmulator};
use crate::report::{Endian, MAX_REPORT_BYTES, ReportLayout, Width};
use crate::tracker::Counting;

/// Name of this device kind in vehicle files.
pub const NAME: &str = "tether_hid";

/// Buffer for a minute of reports at the usual rate.
const RING_BYTES: usize = 1 << 17;

const METRES_PER_FOOT: f64 = 0.3048;

/// The cable counter device kind.
#[derive(Debug, Clone, Copy)]
pub struct TetherHidKind;

/// A cable counter as configured in the vehicle file.
#[derive(Debug, Clone)]
pub struct CableCounter {
    sensor: SensorConfig,
    reeling: CounterSettings,
    wire: Wire,
}

/// Wire format of the counter.
#[derive(Debug, Clone)]
enum Wire {
    Hid { decoder: Box<HidDecoder>, counter: Counter, sd_m: Option<f64> },
    Line { metres_per_unit: f64 },
}

/// Default keys for one common type of counter.
#[derive(Clone, Copy)]
struct Preset {
    counts_per_metre: f64,
    /// Standard deviation of the length, excluding rounding, m. The cable slips a little on its wheel.
    sd_m: f64,
}

/// Common types of counters: an encoder with 1,000 counts per turn on a wheel of 0.5 m, and a wheel with a magnet every
/// centimetre.
///
/// The noise is assumed, not from a datasheet.
const PRESETS: [(&str, Preset); 2] = [
    ("encoder_wheel", Preset { counts_per_metre: 2000.0, sd_m: 0.005 }),
    ("magnet_wheel", Preset { counts_per_metre: 100.0, sd_m: 0.01 }),
];

/// Smallest and largest allowed step of a counter's wheel, m.
const STEP_M: core::ops::RangeInclusive<f64> = 1e-5..=1.0;

#[derive(Clone, Copy)]
enum WireKind {
    Hid,
    Line,
}

impl DeviceKind for TetherHidKind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn configure(&self, sensor: &SensorConfig, own: &Section<'_>) -> Result<Box<dyn Device>, ConfigError> {
        let kinds = [("hid", WireKind::Hid), ("lci90", WireKind::Line)];
        let kind = own.choice("kind", &kinds)?.unwrap_or(WireKind::Hid);
        let usual_rate_hz = match kind {
            WireKind::Hid => 50.0,
            WireKind::Line => 10.0,
        };
        let scale = own.number("scale", -10.0..=10.0)?.unwrap_or(1.0);
        if scale.abs() < 0.01 {
            return Err(own.invalid("scale", "must be at least 0.01 away from zero"));
        }
        let zero_at_m = own.number("zero_at_m", -1.0e6..=1.0e6)?.unwrap_or(0.0);
        let reeling = CounterSettings {
            zero_at_m,
            scale,
            rate_hz: own.number("rate_hz", 0.1..=1000.0)?.unwrap_or(usual_rate_hz),
            latency: sensor.latency,
        };
        let wire = match kind {
            WireKind::Hid => hid(&reeling, own)?,
            WireKind::Line => {
                let units = [("m", 1.0), ("ft", METRES_PER_FOOT)];
                Wire::Line { metres_per_unit: own.choice("unit", &units)?.unwrap_or(1.0) }
            }
        };
        Ok(Box::new(CableCounter { sensor: sensor.clone(), reeling, wire }))
    }
}

fn hid(reeling: &CounterSettings, own: &Section<'_>) -> Result<Wire, ConfigError> {
    let mut layout = report_layout(own)?;
    let clock_offset = own.integer("clock_ms_offset", 0..=MAX_REPORT_BYTES as i64)?;
    let clock_offset = clock_offset.and_then(|offset| usize::try_from(offset).ok());
    layout.auxiliary_offset = clock_offset.or(layout.auxiliary_offset);
    let countings = [("absolute", Counting::Absolute), ("delta", Counting::Delta)];
    let counting = own.choice("mode", &countings)?.unwrap_or(Counting::Absolute);
    let preset = own.choice("preset", &PRESETS)?;
    let counts_per_metre = own.number("counts_per_metre", -1.0e6..=1.0e6)?;
    let counts_per_metre = counts_per_metre.or(preset.map(|preset| preset.counts_per_metre));
    let step_m = own.number("step_m", STEP_M)?.or(preset.map(|preset| 1.0 / preset.counts_per_metre));
    let max_speed_mps = own.number("max_speed_mps", 0.1..=20.0)?.unwrap_or(3.0);
    let counts_per_metre = own.required("counts_per_metre", counts_per_metre)?;
    if counts_per_metre.abs() < 0.1 {
        return Err(own.invalid("counts_per_metre", "must be at least 0.1 away from zero"));
    }
    let between_reports = max_speed_mps * counts_per_metre.abs() / reeling.rate_hz;
    let half = (1_u64 << (layout.width.bits() - 1)) as f64;
    if between_reports >= half {
        let problem = format!(
            "is too fast: {between_reports} counts between two reports; a counter of this width allows fewer than \
             {half}"
        );
        return Err(own.invalid("max_speed_mps", &problem));
    }
    let counter = Counter {
        layout,
        auxiliary_is_ms: clock_offset.is_some(),
        counting,
        counts_per_metre,
        step_m: step_m.unwrap_or(0.0),
        max_speed_mps,
        latency: reeling.latency,
    };
    let decoder =
        HidDecoder::new(counter).map_err(|error| own.invalid("report_bytes", &error.to_string()))?;
    Ok(Wire::Hid { decoder: Box::new(decoder), counter, sd_m: preset.map(|preset| preset.sd_m) })
}

/// Reads the report layout, which is the reference layout as changed by the keys. If a key changes the layout, the
/// offsets of sequence, status and auxiliary value have no default.
fn report_layout(own: &Section<'_>) -> Result<ReportLayout, ConfigError> {
    let reference = ReportLayout::REFERENCE;
    let byte = |key, least, usual: usize| -> Result<usize, ConfigError> {
        let value = own.integer(key, least..=MAX_REPORT_BYTES as i64)?;
        Ok(value.and_then(|value| usize::try_from(value).ok()).unwrap_or(usual))
    };
    let id = own.integer("report_id", 0..=255)?.and_then(|id| u8::try_from(id).ok());
    let widths = [(8, Width::Bits8), (16, Width::Bits16), (32, Width::Bits32)];
    let width = match own.integer("width_bits", 8..=32)? {
        None => reference.width,
        Some(bits) => match widths.iter().find(|(allowed, _)| *allowed == bits) {
            Some((_, width)) => *width,
            None => return Err(own.invalid("width_bits", "must be 8, 16 or 32")),
        },
    };
    let endians = [("little", Endian::Little), ("big", Endian::Big)];
    let mut layout = ReportLayout {
        // HID reserves id 0 for devices without report ids.
        report_id: if id == Some(0) { None } else { id.or(reference.report_id) },
        report_bytes: byte("report_bytes", 1, reference.report_bytes)?,
        offset: byte("offset", 0, reference.offset)?,
        width,
        signed: own.boolean("signed")?.unwrap_or(reference.signed),
        endian: own.choice("endian", &endians)?.unwrap_or(reference.endian),
        ..reference
    };
    let as_reference = layout == reference;
    if !as_reference {
        layout.auxiliary_offset = None;
    }
    let other = |key, usual: Option<usize>| -> Result<Option<usize>, ConfigError> {
        let offset = own.integer(key, 0..=MAX_REPORT_BYTES as i64)?;
        Ok(offset.and_then(|offset| usize::try_from(offset).ok()).or(usual.filter(|_| as_reference)))
    };
    layout.sequence_offset = other("sequence_offset", reference.sequence_offset)?;
    layout.status_offset = other("status_offset", reference.status_offset)?;
    Ok(layout)
}

impl Device for CableCounter {
    fn specification(&self) -> SensorSpec {
        let decoder: Box<dyn Decoder> = match &self.wire {
            Wire::Hid { decoder, .. } => decoder.clone(),
            Wire::Line { metres_per_unit } => {
                Box::new(LineDecoder::new(*metres_per_unit, self.reeling.latency))
            }
        };
        SensorSpec {
            sensor: self.sensor.clone(),
            kind: SensorKind::Tether { zero_at_m: self.reeling.zero_at_m, scale: self.reeling.scale },
            decoder,
            ring_bytes: RING_BYTES,
        }
    }

    fn sense(&self) -> Sense {
        Sense::Tether
    }

    fn emulator(&self, setup: &EmulatorSetup) -> Emulated {
        match &self.wire {
            Wire::Hid { counter, .. } => {
                Emulated::Tether(Box::new(HidEmulator::new(self.reeling, *counter, setup.start)))
            }
            Wire::Line { metres_per_unit } => {
                Emulated::Tether(Box::new(LineEmulator::new(self.reeling, *metres_per_unit, setup.start)))
            }
        }
    }

    fn counter(&self) -> Option<CounterSpec> {
        let (step_m, sd_m) = match &self.wire {
            Wire::Hid { counter, sd_m, .. } => (Some(counter.resolution_m()), *sd_m),
            Wire::Line { .. } => (None, None),
        };
        Some(CounterSpec { step_m: step_m.map(|step_m| step_m * self.reeling.scale.abs()), sd_m })
    }

    fn report_descriptor(&self) -> Option<Vec<u8>> {
        match &self.wire {
            Wire::Hid { counter, .. } => Some(counter.layout.descriptor()),
            Wire::Line { .. } => None,
        }
    }

    fn remarks(&self) -> Vec<(&'static str, String)> {
        let mut remarks = Vec::new();
        if let Wire::Hid { counter, .. } = &self.wire
            && counter.counts_per_metre < 0.0
        {
            let what = "is negative: the count falls as cable is paid out; make it positive if it rises";
            remarks.push(("counts_per_metre", what.to_owned()));
        }
        if self.reeling.scale < 0.0 {
            let what = "is negative: chainage falls as cable is paid out; make it positive if it rises";
            remarks.push(("scale", what.to_owned()));
        }
        remarks
    }

    fn carriers(&self) -> &'static [Carrier] {
        match &self.wire {
            Wire::Hid { .. } => &driver::REPORT_CARRIERS,
            Wire::Line { .. } => &driver::LINE_CARRIERS,
        }
    }

    fn driver(&self, _: &DriverSetup) -> Box<dyn Driver> {
        match &self.wire {
            Wire::Hid { counter, .. } => Box::new(driver::reports(counter.layout)),
            Wire::Line { .. } => Box::new(driver::lines()),
        }
    }
}
