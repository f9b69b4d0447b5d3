//! Decodes velocity reports into readings of velocity over ground.
//!
//! Device axes are x forward, y right, z down. headrace's axes are x forward, y left, z up, so y and z change sign. In
//! air and close to surfaces, the device sends wrong velocities as valid, and repeats reports. The decoder withholds
//! such reports and counts them by reason.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _, LineClock};
use headrace_sensor::device::Decoder;
use headrace_sensor::geometry::frames::{Sensor, Vec3};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{Decoded, Packet, Reading};
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;
use serde::{Deserialize, Serialize};

use crate::report::{Against, LineCodec, Lines, Velocity};

/// Longest usual gap between the bytes of one text line. It allows for a TCP retransmission, whose timer is at least
/// 200 ms.
const SILENCE: DurNs = DurNs::from_millis(1000);

/// Minimum number of valid beams for a velocity, because a velocity has three components.
const LEAST_BEAMS: u8 = 3;
/// Altitude range of an A50, m.
const ALTITUDES_M: core::ops::RangeInclusive<f64> = 0.05..=50.0;
/// Largest plausible delay between the sound's reflection and the report. Reports with a larger delay are withheld. The
/// two-way travel time at the largest altitude is only about 70 ms.
const MOST_DELAY_US: i64 = 2_000_000;

/// Decoding settings of an A50.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecoderSettings {
    /// Largest accepted figure of merit, m/s.
    pub fom_max_mps: f64,
    /// Largest accepted speed, m/s.
    pub max_speed_mps: f64,
    /// Delay from the sending of a report to its receipt.
    pub latency: DurNs,
}

/// Number of withheld velocity reports, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Withheld {
    /// Reports marked invalid by the device.
    pub invalid: u64,
    /// Reports whose status isn't zero, because the device is too hot.
    pub status: u64,
    /// Reports whose velocity is relative to the water.
    pub water: u64,
    /// Reports with fewer than three valid beams.
    pub beams: u64,
    /// Reports whose altitude is outside the measuring range.
    pub altitude: u64,
    /// Reports whose figure of merit is larger than `fom_max_mps`, or negative.
    pub fom: u64,
    /// Reports whose speed is larger than `max_speed_mps`.
    pub speed: u64,
    /// Reports whose timestamps contradict each other.
    pub times: u64,
    /// Repeats of the previous report.
    pub repeated: u64,
}

impl Withheld {
    /// Number of withheld reports for all reasons together.
    pub fn total(&self) -> u64 {
        let Self { invalid, status, water, beams, altitude, fom, speed, times, repeated } = self;
        [invalid, status, water, beams, altitude, fom, speed, times, repeated].into_iter().sum()
    }
}

/// Decodes an A50's bytes into readings of velocity.
#[derive(Debug, Clone)]
pub struct A50Decoder {
    codec: LineCodec,
    clock: LineClock,
    state: State,
}

stateful!(A50Decoder { state: codec, clock, state; });

#[derive(Debug, Clone)]
struct State {
    meaning: DecoderSettings,
    last: Option<Velocity>,
    withheld: Withheld,
    /// Reason why the latest withheld report was withheld.
    reason: Option<WithheldReason>,
}

stateful!(State { state: last, withheld, reason; fixed: meaning; });

/// Converts a vector from device axes to headrace's, or back.
pub fn to_ours([x, y, z]: [f64; 3]) -> Vec3<Sensor> {
    Vec3::new(x, -y, -z)
}

impl A50Decoder {
    /// Creates a decoder with these settings.
    pub fn new(meaning: DecoderSettings) -> Self {
        let state = State { meaning, last: None, withheld: Withheld::default(), reason: None };
        Self { codec: LineCodec::default(), clock: LineClock::new(SILENCE), state }
    }

    /// Number of withheld velocity reports, by reason.
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

    /// Number of withheld reports; [`A50Decoder::left_out`] has the reasons.
    fn withheld(&self) -> u64 {
        self.state.withheld.total()
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        self.state.reason
    }
}

impl State {
    fn take(&mut self, received: MonoNs, report: &Velocity) -> Option<Decoded> {
        let last = self.last.replace(*report);
        let velocity = to_ours(report.velocity_mps);
        let delay_us =
            report.times_us.map_or(0, |[validity, transmission]| transmission.saturating_sub(validity));
        let why = &mut self.withheld;
        let (count, reason) = if !report.is_valid {
            (&mut why.invalid, WithheldReason::MarkedInvalid)
        } else if report.status != 0 {
            (&mut why.status, WithheldReason::Fault)
        } else if report.against == Against::Water {
            (&mut why.water, WithheldReason::MarkedInvalid)
        } else if report.valid_beams < LEAST_BEAMS {
            (&mut why.beams, WithheldReason::MarkedInvalid)
        } else if !ALTITUDES_M.contains(&report.altitude_m) {
            (&mut why.altitude, WithheldReason::Implausible)
        } else if !(0.0..=self.meaning.fom_max_mps).contains(&report.fom_mps) {
            (&mut why.fom, WithheldReason::Implausible)
        } else if velocity.norm() > self.meaning.max_speed_mps {
            (&mut why.speed, WithheldReason::Implausible)
        } else if delay_us < 0 {
            (&mut why.times, WithheldReason::Implausible)
        } else if delay_us > MOST_DELAY_US {
            (&mut why.times, late(delay_us))
        } else if last.is_some_and(|last| repeats(report, &last)) {
            (&mut why.repeated, WithheldReason::Repeated)
        } else {
            let delay = DurNs(delay_us * 1000);
            let valid_at = received - (self.meaning.latency + delay);
            return Some(Decoded { valid_at, reading: Reading::VelocityOverGround(velocity) });
        };
        *count += 1;
        self.reason = Some(reason);
        None
    }
}

/// Returns the reason for withholding a report that was sent `delay_us` after its measurement.
fn late(delay_us: i64) -> WithheldReason {
    let seconds = |us: i64| DurNs(us.saturating_mul(1000)).as_secs_f64();
    WithheldReason::Late { age_s: seconds(delay_us), at_most_s: seconds(MOST_DELAY_US) }
}

/// Whether a report repeats the previous one: the timestamps are equal, or the values are bit-identical. Noise makes
/// the values of two different measurements differ.
fn repeats(report: &Velocity, last: &Velocity) -> bool {
    let [now, before] = [report, last].map(|report| report.times_us.map(|[validity, _]| validity));
    let values = |of: &Velocity| {
        let [x, y, z] = of.velocity_mps;
        [x, y, z, of.fom_mps, of.altitude_m].map(f64::to_bits)
    };
    (now.is_some() && now == before) || values(report) == values(last)
}
