//! Transactions to readings of absolute pressure.

use headrace_sensor::codec::{Codec as _, CodecCounts};
use headrace_sensor::device::Decoder;
use headrace_sensor::geometry::time::DurNs;
use headrace_sensor::reading::{Decoded, Packet, Reading, WaterPressure};
use headrace_sensor::snapshot::{Restorer, Saver, SnapshotError, Stateful};

use crate::calibration::{Calibration, CalibrationCells, CalibrationError, Overrides};
use crate::codec::{Bar100Codec, Measurement, Transaction};

/// How measurements are to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meaning {
    /// What goes before the sensor's memory.
    pub overrides: Overrides,
    /// Pressure of the air outside, bar; only a vented sensor needs it.
    pub ambient_bar: f64,
    /// Whether a measurement whose status says busy is left out.
    pub reject_busy: bool,
    /// From validity to receive time.
    pub latency: DurNs,
}

/// Bytes to readings. Until the calibration is known, measurements are withheld and counted.
#[derive(Debug, Clone)]
pub struct Bar100Decoder {
    codec: Bar100Codec,
    meaning: Meaning,
    cells: CalibrationCells,
    calibration: Result<Option<Calibration>, CalibrationError>,
    withheld: u64,
}

impl Stateful for Bar100Decoder {
    fn save(&self, to: &mut Saver) {
        self.codec.save(to);
        to.value(&(self.cells, self.withheld));
    }

    fn restore(&mut self, from: &mut Restorer<'_>) -> Result<(), SnapshotError> {
        self.codec.restore(from)?;
        (self.cells, self.withheld) = from.value()?;
        self.calibration = self.cells.calibration(&self.meaning.overrides);
        Ok(())
    }
}

impl Bar100Decoder {
    /// A decoder that has seen nothing of the sensor's memory yet.
    pub fn new(meaning: Meaning) -> Self {
        let cells = CalibrationCells::default();
        let calibration = cells.calibration(&meaning.overrides);
        Self { codec: Bar100Codec::default(), meaning, cells, calibration, withheld: 0 }
    }

    /// The calibration in use, once it is known.
    ///
    /// Errors: the sensor's memory says something impossible.
    pub fn calibration(&self) -> Result<Option<Calibration>, CalibrationError> {
        self.calibration
    }
}

/// Absolute pressure and temperature that a measurement means.
fn water_pressure(measured: Measurement, calibration: &Calibration, ambient_bar: f64) -> WaterPressure {
    WaterPressure {
        pressure_pa: calibration.pressure_pa(measured.pressure_counts, ambient_bar),
        resolution_pa: calibration.resolution_pa(),
        temperature_degc: measured.temperature_degc(),
    }
}

impl Decoder for Bar100Decoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, meaning, cells, calibration, withheld } = self;
        let valid_at = packet.received - meaning.latency;
        let mut take = |transaction: Transaction| match transaction {
            Transaction::Memory(word) => {
                cells.note(&word);
                *calibration = cells.calibration(&meaning.overrides);
            }
            Transaction::Measurement(measured) => match calibration {
                Ok(Some(known)) if !(meaning.reject_busy && measured.status.is_busy()) => {
                    let pressure = water_pressure(measured, known, meaning.ambient_bar);
                    sink(Decoded { valid_at, reading: Reading::Pressure(pressure) });
                }
                _ => *withheld += 1,
            },
        };
        codec.push(packet.bytes, &mut take);
        codec.flush(&mut take);
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Measurements left out because the calibration wasn't known or was refused, or the status said busy.
    fn withheld(&self) -> u64 {
        self.withheld
    }
}
