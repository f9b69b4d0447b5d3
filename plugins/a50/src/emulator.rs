//! Emulates an A50, which sends reports at a fixed rate.

use headrace_sensor::device::{Direction, Emulator, LineSink};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::GroundVelocity;

use crate::report::{Against, Velocity};

/// Delay from the reflection of sound to sending the report. In the maker's example it is 189 ms.
const DELAY_US: i64 = 100_000;
/// Reading of the device's clock at power-on, microseconds since 1970.
const BEGINS_US: i64 = 1_638_191_471_000_000;
/// Reported altitude, m. It is constant, because the emulator has no model of the surface that the beams
/// meet.
const ALTITUDE_M: f64 = 1.0;
/// Two figures of merit, sent alternately, because the decoder withholds identical reports as repeats.
const FOMS_MPS: [f64; 2] = [0.001, 0.001_1];

/// Settings of the emulated A50.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Simulated {
    /// Report rate, Hz.
    pub rate_hz: f64,
    /// Delay from the sending of a report to its receipt.
    pub latency: DurNs,
}

/// An ideal emulated device: there is no noise, and only the wire format quantises values.
#[derive(Debug, Clone)]
pub struct A50Emulator {
    device: Simulated,
    start: MonoNs,
    begun: u64,
    sent: u64,
}

impl A50Emulator {
    /// Creates a device that is switched on, and first pings, at `start`.
    pub fn new(device: Simulated, start: MonoNs) -> Self {
        Self { device, start, begun: 0, sent: 0 }
    }

    fn due(&self) -> MonoNs {
        self.start + DurNs::from_secs_f64(self.begun as f64 / self.device.rate_hz)
    }
}

impl Emulator<GroundVelocity> for A50Emulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<GroundVelocity>) {
        while self.due() < until {
            due.push(GroundVelocity::due(self.due()));
            self.begun += 1;
        }
    }

    fn tell(&mut self, moved: &GroundVelocity, line: LineSink<'_>) {
        // In device axes, y and z have the opposite sign of headrace's y and z.
        let [x, y, z] = moved.velocity_mps.0.into();
        let at_us = BEGINS_US + moved.at.since(self.start).0 / 1000;
        // Imported figures of merit may be equal, too. The next float is a different one, and its value is the same.
        let [even, odd] = moved.fom_mps.map_or(FOMS_MPS, |fom_mps| [fom_mps, fom_mps.next_up()]);
        let report = Velocity {
            against: Against::Bottom,
            velocity_mps: [x, -y, -z],
            fom_mps: if self.sent.is_multiple_of(2) { even } else { odd },
            altitude_m: ALTITUDE_M,
            valid_beams: 4,
            is_valid: moved.is_valid,
            status: moved.status,
            times_us: Some([at_us, at_us + DELAY_US]),
        };
        self.sent += 1;
        let received = moved.at + DurNs(DELAY_US * 1000) + self.device.latency;
        line(Direction::Received, received, &report.encode());
    }
}
