//! Decodes a maker's messages into readings on arrival. A unit sends the frames of one sample back to back.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framing as _};
use headrace_sensor::device::Decoder;
use headrace_sensor::device_clock::ClockReport;
use headrace_sensor::geometry::frames::{Rot, Sensor, Vec3};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{Decoded, Level, Packet, Reading};
use headrace_sensor::sample_times::SampleTimes;
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;
use serde::{Deserialize, Serialize};

use crate::codec::{ImuCodec, Message, MessageSet};
use crate::sets::{bosch, j1939, sbg, scaled, xsens};

const MICROSECOND: DurNs = DurNs(1000);

/// Axis order of a J1939 unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxisOrder {
    /// Standard order: pitch, roll, yaw; lateral, longitudinal, vertical. Figures of merit and latency are used.
    Yxz,
    /// `OpenIMU` order: x, y, z. The unit's maker says to ignore the figures of merit and the latency.
    Xyz,
}

/// Decoding settings of an inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DecoderSettings {
    /// The maker's message set.
    pub set: MessageSet,
    /// Axis order of the unit; used only for the J1939 set.
    pub axis_order: AxisOrder,
    /// Tick of the sample time; used for the Xsens set.
    pub sample_time_tick: DurNs,
    /// Delay from a reading's time of validity to its receipt.
    pub latency: DurNs,
}

/// Decodes an inertial unit's bytes into readings.
#[derive(Debug, Clone)]
pub struct ImuDecoder {
    codec: ImuCodec,
    state: State,
    passed_over: u64,
}

stateful!(ImuDecoder { state: codec, state, passed_over; });

/// State of the decoder, updated by each message.
#[derive(Debug, Clone)]
struct State {
    meaning: DecoderSettings,
    invalid: Invalid,
    /// Whether a quaternion has been received. Euler angles are then ignored, so that no attitude is used twice.
    sends_quaternions: bool,
    sample_time_ticks: Option<u32>,
    clock: Option<SampleTimes>,
    stamped_by_filter: Option<bool>,
    received: MonoNs,
    group: Option<u16>,
    /// Components of acceleration received since the latest complete vector.
    acceleration_mps2: [Option<f64>; 3],
    withheld: u64,
}

stateful!(State { state: invalid, sends_quaternions, sample_time_ticks, clock, stamped_by_filter, received, group, acceleration_mps2, withheld; fixed: meaning; });

/// Quantities marked invalid by the unit's latest status.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Invalid {
    orientation: bool,
    rate: bool,
    force: bool,
}

/// A reading and its delay within the device. The delay is zero if the device sends none.
type DelayedReading = Option<(Reading, DurNs)>;

impl AxisOrder {
    /// Converts three values from wire order to sensor axes x, y, z, or back.
    pub fn swapped(self, [a, b, c]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Yxz => [b, a, c],
            Self::Xyz => [a, b, c],
        }
    }
}

impl ImuDecoder {
    /// Creates a decoder with these settings.
    pub fn new(meaning: DecoderSettings) -> Self {
        let state = State {
            meaning,
            invalid: Invalid::default(),
            sends_quaternions: false,
            sample_time_ticks: None,
            clock: None,
            stamped_by_filter: None,
            received: MonoNs(0),
            group: None,
            acceleration_mps2: [None; 3],
            withheld: 0,
        };
        Self { codec: ImuCodec::new(meaning.set), state, passed_over: 0 }
    }

    /// Number of good frames from other devices.
    pub fn passed_over(&self) -> u64 {
        self.passed_over
    }

    /// Timestamp of the unit's latest sample, if the unit sends timestamps. The timestamp wraps.
    pub fn sample_time(&self) -> Option<DurNs> {
        let ticks = self.state.sample_time_ticks?;
        Some(DurNs(self.state.meaning.sample_time_tick.0.saturating_mul(i64::from(ticks))))
    }

    /// Number of the unit's latest sample, if the unit sends numbers. The number wraps.
    pub fn group(&self) -> Option<u16> {
        self.state.group
    }
}

impl Decoder for ImuDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { codec, state, passed_over } = self;
        codec.push_frames(packet.bytes, |frame, _| {
            let Some(message) = state.meaning.set.read(frame) else {
                *passed_over += 1;
                return;
            };
            state.received = packet.received;
            if let Some((reading, delay)) = state.take(&message) {
                let received = packet.received;
                let came = state.clock.as_mut().map_or(received, |clock| clock.arrival(&reading, received));
                let valid_at = came - (state.meaning.latency + delay);
                sink(Decoded { valid_at, reading });
            }
        });
        codec.flush(&mut |_| ());
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Number of values withheld because the unit marked them invalid.
    fn withheld(&self) -> u64 {
        self.state.withheld
    }

    fn withheld_reason(&self) -> Option<WithheldReason> {
        (self.state.withheld > 0).then_some(WithheldReason::MarkedInvalid)
    }

    fn clock(&self) -> Option<ClockReport> {
        self.state.clock.as_ref().map(SampleTimes::report)
    }
}

impl State {
    fn take(&mut self, message: &Message) -> DelayedReading {
        match message {
            Message::Xsens(message) => self.take_xsens(message),
            Message::Sbg(message) => self.take_sbg(message),
            Message::J1939(message) => self.take_j1939(message),
            Message::Bosch(message) => self.take_bosch(*message),
        }
    }

    fn take_xsens(&mut self, message: &xsens::Message) -> DelayedReading {
        use xsens::Message as M;
        match *message {
            M::StatusWord(word) => {
                self.invalid.orientation = !word.orientation_valid();
                self.invalid.rate = word.rate_clipped();
                self.invalid.force = word.acceleration_clipped();
            }
            M::SampleTime(ticks) => {
                self.sample_time_ticks = Some(ticks);
                self.stamp(ticks, self.meaning.sample_time_tick);
            }
            M::GroupCounter(group) => self.group = Some(group),
            M::Quaternion(raw) => return self.quaternion(scaled(raw, xsens::QUATERNION_QUANTUM)),
            M::EulerAngles(raw) => {
                return self.euler(scaled(raw, xsens::EULER_QUANTUM_DEG).map(f64::to_radians));
            }
            M::RateOfTurn(raw) => return self.rate(scaled(raw, xsens::RATE_QUANTUM_RADPS)),
            M::Acceleration(raw) => return self.force(scaled(raw, xsens::ACCELERATION_QUANTUM_MPS2)),
            // High-rate messages are ignored, because published sources disagree about which code means rate and which
            // code means force.
            _ => (),
        }
        None
    }

    fn take_sbg(&mut self, message: &sbg::Message) -> DelayedReading {
        use sbg::Message as M;
        match *message {
            M::Quaternion(raw) => {
                self.quaternion(sbg::rotation_to_ours(scaled(raw, sbg::QUATERNION_QUANTUM)))
            }
            M::Euler(raw) => self.euler(sbg::to_ours(scaled(raw, sbg::EULER_QUANTUM_RAD))),
            M::Rate(raw) => self.rate(sbg::to_ours(scaled(raw, sbg::RATE_QUANTUM_RADPS))),
            M::Acceleration(raw) => self.force(sbg::to_ours(scaled(raw, sbg::ACCELERATION_QUANTUM_MPS2))),
            M::ImuInfo { time_us, status, .. } => {
                self.sbg_stamp(time_us, false);
                self.invalid.force = !status.force_is_well();
                self.invalid.rate = !status.rate_is_well();
                None
            }
            M::EkfTime(time_us) => {
                self.sbg_stamp(time_us, true);
                None
            }
            M::Accuracy(_) => None,
        }
    }

    fn take_j1939(&mut self, message: &j1939::Message) -> DelayedReading {
        let order = self.meaning.axis_order;
        let (triple, reading) = match message {
            // Pitch and roll without yaw are no full attitude. The navigation filter can derive pitch and roll from the
            // direction of gravity.
            j1939::Message::Slope(_) => return None,
            j1939::Message::AngularRate(triple) => {
                let rates = triple.rates_degps().map(|degps| degps.map(f64::to_radians));
                (triple, rates.and_then(|rates| rate(order.swapped(rates))))
            }
            j1939::Message::Acceleration(triple) => {
                (triple, triple.accelerations_mps2().and_then(|mps2| force(order.swapped(mps2))))
            }
        };
        let heeded = order == AxisOrder::Yxz;
        let Some((reading, _)) = reading.filter(|_| !(heeded && triple.has_error())) else {
            self.withheld += 1;
            return None;
        };
        let delay_ms = triple.latency_ms().filter(|_| heeded).unwrap_or(0.0);
        Some((reading, DurNs::from_secs_f64(delay_ms / 1000.0)))
    }

    /// Handles a message of a Bosch unit; returns the acceleration once all three components have arrived.
    ///
    /// Turn rates are not reported, because the unit has none about its pitch axis.
    fn take_bosch(&mut self, message: bosch::Message) -> DelayedReading {
        let [x, y, z] = &mut self.acceleration_mps2;
        match message {
            bosch::Message::Roll(_, acceleration) => *x = Some(acceleration.mps2()),
            bosch::Message::Yaw(_, acceleration) => *y = Some(acceleration.mps2()),
            bosch::Message::Vertical(acceleration) => *z = Some(acceleration.mps2()),
        }
        let complete = [(*x)?, (*y)?, (*z)?];
        self.acceleration_mps2 = [None; 3];
        force(complete)
    }

    /// Handles a timestamp of an SBG unit. Only the kind of timestamp that arrived first is used.
    ///
    /// The unit stamps samples and solutions of its own filter with the same clock, but at different times.
    fn sbg_stamp(&mut self, time_us: u32, of_filter: bool) {
        if *self.stamped_by_filter.get_or_insert(of_filter) == of_filter {
            self.stamp(time_us, MICROSECOND);
        }
    }

    /// Processes a timestamp of the unit's 32-bit clock, which wraps.
    fn stamp(&mut self, ticks: u32, tick: DurNs) {
        let clock = self.clock.get_or_insert_with(|| SampleTimes::new(u32::BITS, tick));
        clock.stamp(u64::from(ticks), self.received);
    }

    fn rate(&mut self, radps: [f64; 3]) -> DelayedReading {
        self.withheld += u64::from(self.invalid.rate);
        rate(radps).filter(|_| !self.invalid.rate)
    }

    fn force(&mut self, mps2: [f64; 3]) -> DelayedReading {
        self.withheld += u64::from(self.invalid.force);
        force(mps2).filter(|_| !self.invalid.force)
    }

    fn quaternion(&mut self, [w, x, y, z]: [f64; 4]) -> DelayedReading {
        self.sends_quaternions = true;
        self.attitude(Rot::from_wxyz(w, x, y, z))
    }

    fn euler(&mut self, [roll, pitch, yaw]: [f64; 3]) -> DelayedReading {
        if self.sends_quaternions {
            return None;
        }
        self.attitude(Some(Rot::from_roll_pitch_yaw(roll, pitch, yaw)))
    }

    fn attitude(&mut self, attitude: Option<Rot<Level, Sensor>>) -> DelayedReading {
        let attitude = attitude.filter(|_| !self.invalid.orientation);
        self.withheld += u64::from(attitude.is_none());
        Some((Reading::Attitude(attitude?), DurNs::ZERO))
    }
}

#[expect(clippy::unnecessary_wraps, reason = "the callers pass it on")]
fn rate([x, y, z]: [f64; 3]) -> DelayedReading {
    Some((Reading::AngularRate(Vec3::new(x, y, z)), DurNs::ZERO))
}

#[expect(clippy::unnecessary_wraps, reason = "the callers pass it on")]
fn force([x, y, z]: [f64; 3]) -> DelayedReading {
    Some((Reading::SpecificForce(Vec3::new(x, y, z)), DurNs::ZERO))
}
