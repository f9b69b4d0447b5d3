//! Decodes transactions into readings of absolute pressure.

use headrace_sensor::codec::{Codec as _, CodecCounts};
use headrace_sensor::device::Decoder;
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, Packet, Reading, WaterPressure};
use headrace_sensor::snapshot::{Restorer, Saver, SnapshotError, Stateful};
use headrace_sensor::withheld::WithheldReason;

use crate::calibration::{Calibration, CalibrationCells, CalibrationError, Overrides};
use crate::codec::{Bar100Codec, Measurement, Transaction};

/// Decoding settings of a Bar100.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecoderSettings {
    /// Values of the vehicle file that override the sensor's memory.
    pub overrides: Overrides,
    /// Ambient air pressure, bar. Only a vented sensor uses it.
    pub ambient_bar: f64,
    /// Whether measurements with a busy status are withheld.
    pub reject_busy: bool,
    /// Delay from the measurement's time of validity to its receipt.
    pub latency: DurNs,
}

/// Decodes a Bar100's transactions into readings. Measurements are withheld and counted until the calibration
/// is known.
#[derive(Debug, Clone)]
pub struct Bar100Decoder {
    codec: Bar100Codec,
    meaning: DecoderSettings,
    cells: CalibrationCells,
    calibration: Result<Option<Calibration>, CalibrationError>,
    withheld: u64,
    /// Reason why the latest withheld measurement was withheld.
    reason: Option<WithheldReason>,
}

impl Stateful for Bar100Decoder {
    fn save(&self, to: &mut Saver) {
        self.codec.save(to);
        to.value(&(self.cells, self.withheld, self.reason));
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.codec.restore(from)?;
        (self.cells, self.withheld, self.reason) = from.value()?;
        self.calibration = self.cells.calibration(&self.meaning.overrides);
        Ok(())
    }
}

impl Bar100Decoder {
    /// Creates a decoder without a calibration.
    pub fn new(meaning: DecoderSettings) -> Self {
        let cells = CalibrationCells::default();
        let calibration = cells.calibration(&meaning.overrides);
        Self { codec: Bar100Codec::default(), meaning, cells, calibration, withheld: 0, reason: None }
    }

    /// The calibration in use, if known.
    ///
    /// Errors: the sensor's memory has impossible values.
    pub fn calibration(&self) -> Result<Option<Calibration>, CalibrationError> {
        self.calibration
    }
}

/// Absolute pressure and temperature of a measurement.
fn water_pressure(measured: Measurement, calibration: &Calibration, ambient_bar: f64) -> WaterPressure {
    WaterPressure {
        pressure_pa: calibration.pressure_pa(measured.pressure_counts, ambient_bar),
        resolution_pa: calibration.resolution_pa(),
        temperature_degc: measured.temperature_degc(),
    }
}

impl Decoder for Bar100Decoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, meaning, cells, calibration, withheld, reason } = self;
        let valid_at = packet.received - meaning.latency;
        let mut take = |transaction: Transaction| match transaction {
            Transaction::Memory(word) => {
                cells.note(&word);
                *calibration = cells.calibration(&meaning.overrides);
            }
            Transaction::Measurement(measured) => {
                let known = calibration.ok().flatten();
                let ready = known.filter(|_| !(meaning.reject_busy && measured.status.is_busy()));
                if let Some(ready) = ready {
                    let pressure = water_pressure(measured, &ready, meaning.ambient_bar);
                    sink(Decoded { valid_at, reading: Reading::Pressure(pressure) });
                } else {
                    *withheld += 1;
                    let busy = known.map(|_| WithheldReason::Fault);
                    *reason = Some(busy.unwrap_or(WithheldReason::NoCalibration));
                }
            }
        };
        codec.push(packet.bytes, &mut take);
        codec.flush(&mut take);
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Number of measurements withheld because the calibration was unknown or invalid, or the status was busy.
    fn withheld(&self) -> u64 {
        self.withheld
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        self.reason
    }
}
