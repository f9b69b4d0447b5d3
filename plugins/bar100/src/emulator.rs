//! The sensor's side of the bus: it is asked for its calibration, then for measurements, at a fixed rate by an emulated host or
//! when a real one does.

use headrace_sensor::device::{Direction, Emulator, EmulatorSetup, LineSink};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Pressure;

use crate::calibration::{Calibration, Scaling0};
use crate::codec::{MEASURE, Measurement, MemoryWord, Status};

/// Date of calibration that the emulated memory gives.
const CALIBRATED: Scaling0 = Scaling0 { year: 2021, month: 6, day: 15, mode: 0 };

/// Ten degrees Celsius in counts: ((10 + 50) / 0.05 + 24) * 16.
const TEMPERATURE_COUNTS: u16 = 0x4C80;

/// What an emulated sensor is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulated {
    /// Its range and kind.
    pub calibration: Calibration,
    /// Pressure of the air outside, bar.
    pub ambient_bar: f64,
    /// Measurements a second.
    pub rate_hz: f64,
    /// From validity to receive time.
    pub latency: DurNs,
}

/// An ideal sensor: no noise and no delay of its own, but whole counts.
#[derive(Debug, Clone)]
pub struct Bar100Emulator {
    sensor: Simulated,
    start: MonoNs,
    begun: u64,
    /// Whether the host is emulated, too.
    polled: bool,
    /// Measurements that a real host has asked for and that haven't begun.
    waiting: Vec<Pressure>,
    calibration_told: bool,
}

impl Bar100Emulator {
    /// A sensor that is switched on, and first measures, as the setup says.
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

    /// What was written, and last how many bytes are to be read.
    fn hear(&mut self, at: MonoNs, bytes: &[u8], line: LineSink<'_>) {
        let Some(asked) = bytes.first() else { return };
        if *asked == MEASURE {
            self.waiting.push(Pressure::due(at));
            return;
        }
        let words = self.sensor.calibration.to_words(CALIBRATED);
        // Cells that aren't the calibration's are erased.
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
