//! Emulates an inertial unit on the CAN bus. At a fixed rate, it sends all frames of one sample.

use headrace_sensor::device::{Direction, Emulator, LineSink};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Inertia;

use crate::codec::{Message, MessageSet};
use crate::decoder::DecoderSettings;
use crate::sets::{bosch, j1939, sbg, xsens};

/// Temperature of an emulated unit: 10 degrees Celsius, in hundredths.
const SBG_TEMPERATURE: i16 = 1000;

/// An ideal emulated unit: there is no noise, bias or added delay, but counts are whole numbers.
#[derive(Debug, Clone)]
pub struct ImuEmulator {
    meaning: DecoderSettings,
    rate_hz: f64,
    start: MonoNs,
    begun: u64,
    sent: u64,
}

impl ImuEmulator {
    /// Creates a unit that is switched on, and first samples, at `start`.
    pub fn new(meaning: DecoderSettings, rate_hz: f64, start: MonoNs) -> Self {
        Self { meaning, rate_hz, start, begun: 0, sent: 0 }
    }

    /// Time of a sample on the unit's clock, counted from the start.
    fn elapsed(&self, sample: u64) -> DurNs {
        DurNs::from_secs_f64(sample as f64 / self.rate_hz)
    }

    fn xsens(&self, motion: &Inertia, elapsed: DurNs) -> [Option<Message>; 4] {
        let ticks = elapsed.0 / self.meaning.sample_time_tick.0.max(1);
        [
            Some(xsens::Message::SampleTime(wrapped(ticks))),
            counts(motion.attitude.wxyz(), xsens::QUATERNION_QUANTUM).map(xsens::Message::Quaternion),
            counts(motion.rate_radps.0.into(), xsens::RATE_QUANTUM_RADPS).map(xsens::Message::RateOfTurn),
            counts(motion.force_mps2.0.into(), xsens::ACCELERATION_QUANTUM_MPS2)
                .map(xsens::Message::Acceleration),
        ]
        .map(|message| message.map(Message::Xsens))
    }

    fn j1939(&self, motion: &Inertia) -> [Option<Message>; 3] {
        let (roll, pitch, _) = motion.attitude.roll_pitch_yaw();
        let slope = all_finite(motion.attitude.wxyz()).map(|_| {
            j1939::Message::Slope(j1939::Slope {
                pitch: j1939::slope_raw(pitch.to_degrees()),
                roll: j1939::slope_raw(roll.to_degrees()),
                figures: 0,
                latency: 0,
            })
        });
        let order = self.meaning.axis_order;
        let rates = all_finite(order.swapped(motion.rate_radps.0.into()).map(f64::to_degrees));
        let forces = all_finite(order.swapped(motion.force_mps2.0.into()));
        let triple = |raw| j1939::Triple { raw, figures: 0, latency: 0 };
        [
            slope,
            rates.map(|rates| j1939::Message::AngularRate(triple(rates.map(j1939::rate_raw)))),
            forces.map(|forces| j1939::Message::Acceleration(triple(forces.map(j1939::acceleration_raw)))),
        ]
        .map(|message| message.map(Message::J1939))
    }
}

impl Emulator<Inertia> for ImuEmulator {
    fn begin(&mut self, until: MonoNs, due: &mut Vec<Inertia>) {
        let period = DurNs::from_secs_f64(1.0 / self.rate_hz);
        while self.start + self.elapsed(self.begun) < until {
            due.push(Inertia::due(self.start + self.elapsed(self.begun), period));
            self.begun += 1;
        }
    }

    fn tell(&mut self, motion: &Inertia, line: LineSink<'_>) {
        let elapsed = self.elapsed(self.sent);
        self.sent += 1;
        let mut send = |messages: &[Option<Message>]| {
            for frame in messages.iter().flatten().filter_map(|message| self.meaning.set.encode(message)) {
                line(Direction::Received, motion.at + self.meaning.latency, &frame.encode());
            }
        };
        match self.meaning.set {
            MessageSet::Xsens(_) => send(&self.xsens(motion, elapsed)),
            MessageSet::Sbg => send(&sbg(motion, elapsed)),
            MessageSet::J1939(_) => send(&self.j1939(motion)),
            MessageSet::Bosch => send(&bosch(motion)),
        }
    }
}

fn sbg(motion: &Inertia, elapsed: DurNs) -> [Option<Message>; 4] {
    let force = sbg::to_ours(motion.force_mps2.0.into());
    let rate = sbg::to_ours(motion.rate_radps.0.into());
    let quaternion = sbg::rotation_to_ours(motion.attitude.wxyz());
    [
        Some(sbg::Message::ImuInfo {
            time_us: wrapped(elapsed.0 / 1000),
            status: sbg::ALL_WELL,
            temperature: SBG_TEMPERATURE,
        }),
        counts(force, sbg::ACCELERATION_QUANTUM_MPS2).map(sbg::Message::Acceleration),
        counts(rate, sbg::RATE_QUANTUM_RADPS).map(sbg::Message::Rate),
        counts(quaternion, sbg::QUATERNION_QUANTUM).map(sbg::Message::Quaternion),
    ]
    .map(|message| message.map(Message::Sbg))
}

fn bosch(motion: &Inertia) -> [Option<Message>; 3] {
    let (rates, forces) = (motion.rate_radps, motion.force_mps2);
    let rate = |radps: f64| bosch::RawRate::nearest(radps.to_degrees());
    let force = bosch::RawAcceleration::nearest;
    [
        all_finite([rates.z(), forces.y()]).map(|[z, y]| bosch::Message::Yaw(rate(z), force(y))),
        all_finite([rates.x(), forces.x()]).map(|[r, x]| bosch::Message::Roll(rate(r), force(x))),
        all_finite([forces.z()]).map(|[z]| bosch::Message::Vertical(force(z))),
    ]
    .map(|message| message.map(Message::Bosch))
}

/// Returns the values if all are finite. A value that isn't finite wasn't measured, and is not sent.
fn all_finite<const N: usize>(values: [f64; N]) -> Option<[f64; N]> {
    values.iter().all(|value| value.is_finite()).then_some(values)
}

/// Returns the reading of a 32-bit clock, which wraps, after this many ticks.
fn wrapped(ticks: i64) -> u32 {
    u32::try_from(ticks.rem_euclid(1 << 32)).unwrap_or_default()
}

/// Counts nearest to `values`, clamped to the range of the wire format.
fn counts<const N: usize>(values: [f64; N], quantum: f64) -> Option<[i16; N]> {
    let counts = |value| {
        let counts = math::round_to_i64(value / quantum);
        i16::try_from(counts).unwrap_or(if counts < 0 { i16::MIN } else { i16::MAX })
    };
    all_finite(values).map(|values| values.map(counts))
}
