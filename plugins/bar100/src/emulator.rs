//! Emulates a Bar100, which answers requests for its calibration and for measurements.
//!
//! Requests come from an emulated host at a fixed rate, or from a real host.

use headrace_sensor::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Pressure;

use crate::calibration::{Calibration, Scaling0};
use crate::codec::{MEASURE, Measurement, MemoryWord, Status};

/// Calibration date in the emulated memory.
const CALIBRATED: Scaling0 = Scaling0 { year: 2021, month: 6, day: 15, mode: 0 };

/// Ten degrees Celsius in counts: ((10 + 50) / 0.05 + 24) * 16.
const TEMPERATURE_COUNTS: u16 = 0x4C80;

/// Settings of the emulated sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulated {
    /// Pressure range and pressure mode.
    pub calibration: Calibration,
    /// Ambient air pressure, bar.
    pub ambient_bar: f64,
    /// Measurement rate, Hz.
    pub rate_hz: f64,
    /// Delay from the measurement's time of validity to its receipt.
    pub latency: DurNs,
}

/// An ideal emulated sensor: there is no noise and no added delay, but counts are whole numbers.
#[derive(Debug, Clone)]
pub struct Bar100Emulator {
    sensor: Simulated,
    start: MonoNs,
    begun: u64,
    /// Whether the host that requests measurements is emulated, too.
    polled: bool,
    /// Measurements that a real host has requested and that the sensor hasn't started yet.
    waiting: Vec<Pressure>,
    calibration_told: bool,
}

impl Bar100Emulator {
    /// Creates a sensor that is switched on, and first measures, at the setup's start.
    pub fn new(sensor: Simulated, setup: &EmulatorSetup) -> Self {
        let (start, polled) = (setup.start, setup.polled);
        Self { sensor, start, begun: 0, polled, waiting: Vec::new(), calibration_told: !polled }
    }

    fn due(&self) -> MonoNs {
        self.start + DurNs::from_secs_f64(self.begun as f64 / self.sensor.rate_hz)
    }

    fn measurement(&self, pressure_pa: f64) -> Measurement {
        Measurement {
            status: Status::IDLE,
            pressure_counts: self.sensor.calibration.counts(pressure_pa, self.sensor.ambient_bar),
            temperature_counts: TEMPERATURE_COUNTS,
        }
    }

    fn tell_calibration(&mut self, received: MonoNs, line: LineSink<'_>) {
        for (cell, word) in self.sensor.calibration.to_words(CALIBRATED) {
            let read = MemoryWord { cell, status: Status::IDLE, word };
            line(Direction::Received, received, &read.encode());
        }
        self.calibration_told = true;
    }
}

impl Emulator<Pressure> for Bar100Emulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Pressure>) {
        while self.polled && self.due() < until {
            due.push(Pressure::due(self.due()));
            self.begun += 1;
        }
        let begun = self.waiting.partition_point(|pressure| pressure.at < until);
        due.extend(self.waiting.drain(..begun));
    }

    /// Receives a host's request: the bytes to write, then the number of bytes to read.
    fn hear(&mut self, at: MonoNs, bytes: &[u8], line: LineSink<'_>) {
        let Some(asked) = bytes.first() else { return };
        if *asked == MEASURE {
            self.waiting.push(Pressure::due(at));
            return;
        }
        let words = self.sensor.calibration.to_words(CALIBRATED);
        // Cells outside the calibration return the value of erased memory.
        let word = words.iter().find(|(cell, _)| cell == asked).map_or(0xFFFF, |(_, word)| *word);
        let read = MemoryWord { cell: *asked, status: Status::IDLE, word };
        line(Direction::Received, at + self.sensor.latency, &read.encode());
    }

    fn tell(&mut self, pressure: &Pressure, line: LineSink<'_>) {
        let received = pressure.at + self.sensor.latency;
        if !self.calibration_told {
            self.tell_calibration(received, line);
        }
        line(Direction::Received, received, &self.measurement(pressure.pressure_pa).encode());
    }
}
