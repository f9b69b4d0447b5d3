//! Velocity reports to readings of velocity over ground.
//!
//! The device's axes are x forward, y right, z down, ours x forward, y left, z up: two of three point the other way.
//! In air, and close to things, the device is known to send valid velocities that are none, and to repeat itself; what
//! looks so is withheld, and counted by reason.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::device::Decoder;
use headrace_sensor::geometry::frames::{Sensor, Vec3};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{Decoded, Packet, Reading};
use headrace_sensor::stateful;
use serde::{Deserialize, Serialize};

use crate::report::{Against, LineCodec, Lines, Velocity};

/// A line's bytes follow one another, if TCP has to send none of them again; its own timer for that is 200 ms at least.
const SILENCE: DurNs = DurNs::from_millis(1000);

/// A velocity has three components.
const LEAST_BEAMS: u8 = 3;
/// Altitudes that an A50 can measure, m.
const ALTITUDES_M: core::ops::RangeInclusive<f64> = 0.05..=50.0;
/// The most that a report may be on its way within the device. Sound takes 70 ms for the way there and back.
const MOST_DELAY_US: i64 = 2_000_000;

/// How reports are to be understood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meaning {
    /// The largest figure of merit that is taken, m/s.
    pub fom_max_mps: f64,
    /// The largest speed that is taken, m/s.
    pub max_speed_mps: f64,
    /// From sending to receive time.
    pub latency: DurNs,
}

/// Why reports were left out, and how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Withheld {
    /// The device called them invalid.
    pub invalid: u64,
    /// Its status wasn't zero: too hot.
    pub status: u64,
    /// Velocities against the water.
    pub water: u64,
    /// Fewer than three beams were valid.
    pub beams: u64,
    /// Altitudes that it can't measure.
    pub altitude: u64,
    /// Figures of merit that were too large, or below zero.
    pub fom: u64,
    /// Speeds that were too large.
    pub speed: u64,
    /// Times that contradict each other.
    pub times: u64,
    /// Reports that repeated the one before.
    pub repeated: u64,
}

impl Withheld {
    /// All of them.
    pub fn total(&self) -> u64 {
        let Self { invalid, status, water, beams, altitude, fom, speed, times, repeated } = self;
        [invalid, status, water, beams, altitude, fom, speed, times, repeated].into_iter().sum()
    }
}

/// Bytes to readings.
#[derive(Debug, Clone)]
pub struct A50Decoder {
    codec: LineCodec,
    clock: LineClock,
    state: State,
}

stateful!(A50Decoder { state: codec, clock, state; });

#[derive(Debug, Clone)]
struct State {
    meaning: Meaning,
    last: Option<Velocity>,
    withheld: Withheld,
}

stateful!(State { state: last, withheld; fixed: meaning; });

/// A vector in the device's axes in ours, or the other way.
pub fn to_ours([x, y, z]: [f64; 3]) -> Vec3<Sensor> {
    Vec3::new(x, -y, -z)
}

impl A50Decoder {
    /// A decoder that has seen nothing yet.
    pub fn new(meaning: Meaning) -> Self {
        let state = State { meaning, last: None, withheld: Withheld::default() };
        Self { codec: LineCodec::default(), clock: LineClock::new(SILENCE), state }
    }

    /// What has been left out, by reason.
    pub fn left_out(&self) -> Withheld {
        self.state.withheld
    }
}

impl Decoder for A50Decoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, clock, state } = self;
        clock.push(codec, packet.received, packet.bytes, |received, line| {
            let Some(velocity) = Lines.read(line) else { return };
            if let Some(decoded) = state.take(received, &velocity) {
                sink(decoded);
            }
        });
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Reports that were left out; [`A50Decoder::left_out`] has the reasons.
    fn withheld(&self) -> u64 {
        self.state.withheld.total()
    }
}

impl State {
    fn take(&mut self, received: MonoNs, report: &Velocity) -> Option<Decoded> {
        let last = self.last.replace(*report);
        let velocity = to_ours(report.velocity_mps);
        let delay_us =
            report.times_us.map_or(0, |[validity, transmission]| transmission.saturating_sub(validity));
        let why = &mut self.withheld;
        let reason = if !report.is_valid {
            &mut why.invalid
        } else if report.status != 0 {
            &mut why.status
        } else if report.against == Against::Water {
            &mut why.water
        } else if report.valid_beams < LEAST_BEAMS {
            &mut why.beams
        } else if !ALTITUDES_M.contains(&report.altitude_m) {
            &mut why.altitude
        } else if !(0.0..=self.meaning.fom_max_mps).contains(&report.fom_mps) {
            &mut why.fom
        } else if velocity.norm() > self.meaning.max_speed_mps {
            &mut why.speed
        } else if !(0..=MOST_DELAY_US).contains(&delay_us) {
            &mut why.times
        } else if last.is_some_and(|last| repeats(report, &last)) {
            &mut why.repeated
        } else {
            let delay = DurNs(delay_us * 1000);
            let valid_at = received - (self.meaning.latency + delay);
            return Some(Decoded { valid_at, reading: Reading::VelocityOverGround(velocity) });
        };
        *reason += 1;
        None
    }
}

/// Whether a report is of the same moment as the last, or says the same to the last bit, which no new one does.
fn repeats(report: &Velocity, last: &Velocity) -> bool {
    let [now, before] = [report, last].map(|report| report.times_us.map(|[validity, _]| validity));
    let values = |of: &Velocity| {
        let [x, y, z] = of.velocity_mps;
        [x, y, z, of.fom_mps, of.altitude_m].map(f64::to_bits)
    };
    (now.is_some() && now == before) || values(report) == values(last)
}
