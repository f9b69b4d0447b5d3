//! The sensor's side of the bus: it is asked for its calibration, then for measurements at a fixed rate.

use headrace_core::app::device::{Direction, Emulator, Truth};
use headrace_core::frames::Mount;
use headrace_core::time::{DurNs, MonoNs};

use crate::calibration::{Calibration, Scaling0};
use crate::codec::{Measurement, MemoryWord, Status};

/// Date of calibration that the emulated memory gives.
const CALIBRATED: Scaling0 = Scaling0 { year: 2021, month: 6, day: 15, mode: 0 };

/// Ten degrees Celsius in counts: ((10 + 50) / 0.05 + 24) * 16.
const TEMPERATURE_COUNTS: u16 = 0x4C80;

/// What an emulated sensor is like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emulated {
    /// Its range and kind.
    pub calibration: Calibration,
    /// Pressure of the air outside, bar.
    pub ambient_bar: f64,
    /// How it sits on the vehicle.
    pub mount: Mount,
    /// Measurements a second.
    pub rate_hz: f64,
    /// From validity to receive time.
    pub latency: DurNs,
}

/// An ideal sensor: no noise and no delay of its own, but whole counts.
#[derive(Debug, Clone)]
pub struct Bar100Emulator {
    sensor: Emulated,
    start: MonoNs,
    measured: u64,
}

impl Bar100Emulator {
    /// A sensor that is switched on, and first measures, at `start`.
    pub fn new(sensor: Emulated, start: MonoNs) -> Self {
        Self { sensor, start, measured: 0 }
    }

    fn measure(&self, truth: &dyn Truth, at: MonoNs) -> Measurement {
        let site = truth.site();
        let height_m = truth.pose(at).place(self.sensor.mount.position).z();
        let pressure_pa = site.pressure_pa(site.surface_above_floor_m - height_m);
        Measurement {
            status: Status::IDLE,
            pressure_counts: self.sensor.calibration.counts(pressure_pa, self.sensor.ambient_bar),
            temperature_counts: TEMPERATURE_COUNTS,
        }
    }
}

impl Emulator for Bar100Emulator {
    fn due(&self) -> MonoNs {
        self.start + DurNs::from_secs_f64(self.measured as f64 / self.sensor.rate_hz)
    }

    fn act(&mut self, truth: &dyn Truth, line: &mut dyn FnMut(Direction, MonoNs, &[u8])) {
        let at = self.due();
        let received = at + self.sensor.latency;
        if self.measured == 0 {
            for (cell, word) in self.sensor.calibration.to_words(CALIBRATED) {
                let read = MemoryWord { cell, status: Status::IDLE, word };
                line(Direction::Received, received, &read.encode());
            }
        }
        line(Direction::Received, received, &self.measure(truth, at).encode());
        self.measured += 1;
    }
}
