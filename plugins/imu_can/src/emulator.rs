//! The unit's side of the bus: at a fixed rate, the frames of one sample.

use headrace_core::app::device::{Direction, Emulator, LineSink};
use headrace_core::app::measurement::Inertia;
use headrace_core::math;
use headrace_core::time::{DurNs, MonoNs};

use crate::codec::{Message, MessageSet};
use crate::decoder::Meaning;
use crate::sets::{bosch, j1939, sbg, xsens};

/// Temperature that an emulated unit gives: 10 degrees Celsius.
const SBG_TEMPERATURE: i16 = 1000;

/// An ideal unit: no noise, no bias and no delay of its own, but whole counts.
#[derive(Debug, Clone)]
pub struct ImuEmulator {
    meaning: Meaning,
    rate_hz: f64,
    start: MonoNs,
    begun: u64,
    told: u64,
}

impl ImuEmulator {
    /// A unit that is switched on, and first samples, at `start`.
    pub fn new(meaning: Meaning, rate_hz: f64, start: MonoNs) -> Self {
        Self { meaning, rate_hz, start, begun: 0, told: 0 }
    }

    /// From the start to a sample on the unit's own clock.
    fn elapsed(&self, sample: u64) -> DurNs {
        DurNs::from_secs_f64(sample as f64 / self.rate_hz)
    }

    fn xsens(&self, motion: &Inertia, elapsed: DurNs) -> [Message; 4] {
        let ticks = elapsed.0 / self.meaning.sample_time_tick.0.max(1);
        [
            xsens::Message::SampleTime(wrapped(ticks)),
            xsens::Message::Quaternion(counts(motion.attitude.wxyz(), xsens::QUATERNION_QUANTUM)),
            xsens::Message::RateOfTurn(counts(motion.rate_radps.0.into(), xsens::RATE_QUANTUM_RADPS)),
            xsens::Message::Acceleration(counts(
                motion.force_mps2.0.into(),
                xsens::ACCELERATION_QUANTUM_MPS2,
            )),
        ]
        .map(Message::Xsens)
    }

    fn j1939(&self, motion: &Inertia) -> [Message; 3] {
        let (roll, pitch, _) = motion.attitude.roll_pitch_yaw();
        let slope = j1939::Slope {
            pitch: j1939::slope_raw(pitch.to_degrees()),
            roll: j1939::slope_raw(roll.to_degrees()),
            figures: 0,
            latency: 0,
        };
        let order = self.meaning.axis_order;
        let rates = order.swapped(motion.rate_radps.0.into()).map(f64::to_degrees);
        let forces = order.swapped(motion.force_mps2.0.into());
        let triple = |raw| j1939::Triple { raw, figures: 0, latency: 0 };
        [
            j1939::Message::Slope(slope),
            j1939::Message::AngularRate(triple(rates.map(j1939::rate_raw))),
            j1939::Message::Acceleration(triple(forces.map(j1939::acceleration_raw))),
        ]
        .map(Message::J1939)
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
        let elapsed = self.elapsed(self.told);
        self.told += 1;
        let mut send = |messages: &[Message]| {
            for frame in messages.iter().filter_map(|message| self.meaning.set.encode(message)) {
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

fn sbg(motion: &Inertia, elapsed: DurNs) -> [Message; 4] {
    let force = sbg::to_ours(motion.force_mps2.0.into());
    let rate = sbg::to_ours(motion.rate_radps.0.into());
    let quaternion = sbg::rotation_to_ours(motion.attitude.wxyz());
    [
        sbg::Message::ImuInfo {
            time_us: wrapped(elapsed.0 / 1000),
            status: sbg::ALL_WELL,
            temperature: SBG_TEMPERATURE,
        },
        sbg::Message::Acceleration(counts(force, sbg::ACCELERATION_QUANTUM_MPS2)),
        sbg::Message::Rate(counts(rate, sbg::RATE_QUANTUM_RADPS)),
        sbg::Message::Quaternion(counts(quaternion, sbg::QUATERNION_QUANTUM)),
    ]
    .map(Message::Sbg)
}

fn bosch(motion: &Inertia) -> [Message; 3] {
    let rate = |radps: f64| bosch::RawRate::nearest(radps.to_degrees());
    let force = bosch::RawAcceleration::nearest;
    [
        bosch::Message::Yaw(rate(motion.rate_radps.z()), force(motion.force_mps2.y())),
        bosch::Message::Roll(rate(motion.rate_radps.x()), force(motion.force_mps2.x())),
        bosch::Message::Vertical(force(motion.force_mps2.z())),
    ]
    .map(Message::Bosch)
}

/// A device's clock of 32 bits.
fn wrapped(ticks: i64) -> u32 {
    u32::try_from(ticks.rem_euclid(1 << 32)).unwrap_or_default()
}

/// The nearest counts that the wire can say.
fn counts<const N: usize>(values: [f64; N], quantum: f64) -> [i16; N] {
    values.map(|value| {
        let counts = math::round_to_i64(value / quantum);
        i16::try_from(counts).unwrap_or(if counts < 0 { i16::MIN } else { i16::MAX })
    })
}
