//! Decodes CAN frames into readings, according to a mapping of DBC signals.

use headrace_sensor::codec::{Codec as _, CodecCounts, Framed, Framing, Verdict};
use headrace_sensor::device::Decoder;
use headrace_sensor::device_clock::ClockReport;
use headrace_sensor::geometry::frames::{Rot, Vec3};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{Decoded, Packet, Reading};
use headrace_sensor::sample_times::SampleTimes;
use headrace_sensor::stateful;
use headrace_sensor::withheld::WithheldReason;

use super::layout::DATA_BYTES;
use super::mapping::{Attitude, Axes, Condition, Mapping, Part, Stamp};
use crate::codec::can_frame;
use crate::frame::{CanFrame, CanId, FRAME_BYTES, FrameKind};

/// Maximum number of frames that a mapping uses. Each signal may have its own frame: 3 of rate, 3 of force, 4 of
/// attitude, 4 of validity and 1 of time.
const MOST_FRAMES: usize = 15;

/// Maximum time between the frames of one sample. A unit sends these frames back to back, so a longer gap means another
/// sample.
const SAME_SAMPLE: DurNs = DurNs::from_millis(5);

/// Identifiers and lengths of the mapping's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Listened {
    frames: [Option<(CanId, u8)>; MOST_FRAMES],
}

/// Decodes bytes into the mapping's frames.
///
/// Other devices' frames, remote frames and error frames are good frames without a value. A frame is bad if its length
/// differs from the DBC's.
pub type DbcCodec = Framed<Listened, FRAME_BYTES>;

/// Decodes an inertial unit's bytes into readings.
#[derive(Debug, Clone)]
pub struct DbcDecoder {
    listened: Listened,
    codec: DbcCodec,
    state: State,
    passed_over: u64,
}

stateful!(DbcDecoder { state: codec, state, passed_over; fixed: listened; });

#[derive(Debug, Clone)]
struct State {
    axes: Axes,
    latency: DurNs,
    rate: Option<Vector<3>>,
    force: Option<Vector<3>>,
    quaternion: Option<Vector<4>>,
    euler: Option<Vector<3>>,
    all_well: Well,
    attitude_well: Well,
    rate_well: Well,
    force_well: Well,
    stamp: Option<Stamp>,
    clock: Option<SampleTimes>,
    withheld: u64,
}

stateful!(State { state: all_well, attitude_well, rate_well, force_well, clock, withheld; each: rate, force, quaternion, euler; fixed: axes, latency, stamp; });

/// A vector whose components are in one or several frames.
#[derive(Debug, Clone, Copy)]
struct Vector<const N: usize> {
    parts: [Part; N],
    came: [Option<(MonoNs, f64)>; N],
}

stateful!(Vector<3> { slots: came; fixed: parts; });
stateful!(Vector<4> { slots: came; fixed: parts; });

/// Error of a vector whose components are from different samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Mixed;

/// Validity of a quantity as reported by the unit. Values count as valid until the unit reports that they aren't.
#[derive(Debug, Clone, Copy)]
struct Well {
    condition: Option<Condition>,
    now: bool,
}

stateful!(Well { state: now; fixed: condition; });

impl Listened {
    /// Finds the frames that contain a mapping's signals.
    pub fn new(mapping: &Mapping) -> Self {
        let mut frames = [None; MOST_FRAMES];
        for place in mapping.places() {
            let frame = Some((place.id, place.frame_bytes));
            if !frames.contains(&frame)
                && let Some(free) = frames.iter_mut().find(|frame| frame.is_none())
            {
                *free = frame;
            }
        }
        Self { frames }
    }

    fn bytes(&self, id: CanId) -> Option<usize> {
        let found = self.frames.iter().flatten().find(|(listened, _)| *listened == id);
        found.map(|(_, bytes)| usize::from(*bytes))
    }
}

impl Framing for Listened {
    type Value = CanFrame;

    const WHOLE_MESSAGES: bool = true;

    fn judge(&self, front: &[u8]) -> Verdict {
        let fits = |frame: CanFrame| match frame.kind() {
            FrameKind::Data(id) => self.bytes(id).is_none_or(|bytes| bytes == frame.data().len()),
            FrameKind::Remote(_) | FrameKind::Error(_) => true,
        };
        Verdict::on(front, FRAME_BYTES, |frame| can_frame(frame).is_some_and(fits))
    }

    fn read(&self, frame: &[u8]) -> Option<CanFrame> {
        let frame = can_frame(frame)?;
        let FrameKind::Data(id) = frame.kind() else { return None };
        self.bytes(id).map(|_| frame)
    }
}

impl DbcDecoder {
    /// Creates a decoder for this mapping.
    pub fn new(mapping: &Mapping) -> Self {
        let (quaternion, euler) = match mapping.attitude {
            Some(Attitude::Quaternion(parts)) => (Some(Vector::new(parts)), None),
            Some(Attitude::Euler(parts)) => (None, Some(Vector::new(parts))),
            None => (None, None),
        };
        let conditions = mapping.conditions;
        let state = State {
            axes: mapping.axes,
            latency: mapping.latency,
            rate: mapping.rate.map(Vector::new),
            force: mapping.force.map(Vector::new),
            quaternion,
            euler,
            all_well: Well::new(conditions.all),
            attitude_well: Well::new(conditions.attitude),
            rate_well: Well::new(conditions.rate),
            force_well: Well::new(conditions.force),
            stamp: mapping.sample_time,
            clock: mapping.sample_time.map(|stamp| SampleTimes::new(stamp.place.layout.bits(), stamp.tick)),
            withheld: 0,
        };
        let listened = Listened::new(mapping);
        Self { listened, codec: DbcCodec::new(listened), state, passed_over: 0 }
    }

    /// Number of good frames outside the mapping.
    pub fn passed_over(&self) -> u64 {
        self.passed_over
    }
}

impl Decoder for DbcDecoder {
    fn decode(&mut self, packet: Packet<'_>, sink: &mut dyn FnMut(Decoded)) {
        let Self { listened, codec, state, passed_over } = self;
        codec.push_frames(packet.bytes, |frame, _| match listened.read(frame) {
            Some(frame) => state.take(&frame, packet.received, sink),
            None => *passed_over += 1,
        });
        codec.flush(&mut |_| ());
    }

    fn counts(&self) -> CodecCounts {
        self.codec.counts()
    }

    /// Number of withheld values and vectors: values that the unit marks invalid or that aren't finite, and vectors
    /// with a component missing.
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
    fn take(&mut self, frame: &CanFrame, received: MonoNs, sink: &mut dyn FnMut(Decoded)) {
        let FrameKind::Data(id) = frame.kind() else { return };
        let mut data = [0; DATA_BYTES];
        for (place, byte) in data.iter_mut().zip(frame.data()) {
            *place = *byte;
        }
        let Self { all_well, attitude_well, rate_well, force_well, withheld, axes, clock, .. } = self;
        for well in [&mut *all_well, attitude_well, rate_well, force_well] {
            well.note(id, data);
        }
        if let (Some(stamp), Some(clock)) = (self.stamp, clock.as_mut())
            && let Some(ticks) = stamp.place.raw(id, data)
        {
            clock.stamp(ticks, received);
        }
        let mut tell = |well: &Well, reading: Option<Reading>| match reading
            .filter(|reading| all_well.now && well.now && reading.is_finite())
        {
            Some(reading) => {
                let came = clock.as_mut().map_or(received, |clock| clock.arrival(&reading, received));
                sink(Decoded { valid_at: came - self.latency, reading });
            }
            None => *withheld += 1,
        };
        if let Some(complete) = self.quaternion.as_mut().and_then(|vector| vector.take(id, data, received)) {
            let attitude = complete.ok().and_then(|wxyz| {
                let [w, x, y, z] = axes.rotation_turned(wxyz);
                Rot::from_wxyz(w, x, y, z)
            });
            tell(attitude_well, attitude.map(Reading::Attitude));
        }
        if let Some(complete) = self.euler.as_mut().and_then(|vector| vector.take(id, data, received)) {
            let angles = complete.ok().filter(|angles| angles.iter().all(|angle| angle.is_finite()));
            let attitude = angles.map(|angles| {
                let [roll, pitch, yaw] = axes.turned(angles);
                Rot::from_roll_pitch_yaw(roll, pitch, yaw)
            });
            tell(attitude_well, attitude.map(Reading::Attitude));
        }
        if let Some(complete) = self.rate.as_mut().and_then(|vector| vector.take(id, data, received)) {
            tell(rate_well, complete.ok().map(|rate| Reading::AngularRate(vec3(axes.turned(rate)))));
        }
        if let Some(complete) = self.force.as_mut().and_then(|vector| vector.take(id, data, received)) {
            tell(force_well, complete.ok().map(|force| Reading::SpecificForce(vec3(axes.turned(force)))));
        }
    }
}

impl<const N: usize> Vector<N> {
    fn new(parts: [Part; N]) -> Self {
        Self { parts, came: [None; N] }
    }

    /// Stores the vector's components that this frame carries; returns the vector in SI units once it is complete.
    ///
    /// Errors: the components are from different samples. The older components are dropped.
    fn take(
        &mut self,
        id: CanId,
        data: [u8; DATA_BYTES],
        received: MonoNs,
    ) -> Option<Result<[f64; N], Mixed>> {
        let mut touched = false;
        for (part, came) in self.parts.iter().zip(&mut self.came) {
            if let Some(value) = part.place.value(id, data) {
                *came = Some((received, part.unit.to_si(value)));
                touched = true;
            }
        }
        if !touched || self.came.iter().any(Option::is_none) {
            return None;
        }
        let old = |at: MonoNs| received.since(at) > SAME_SAMPLE;
        let mut values = [0.0; N];
        let mut mixed = false;
        for (value, came) in values.iter_mut().zip(&mut self.came) {
            if let Some((at, number)) = *came {
                *value = number;
                if old(at) {
                    (mixed, *came) = (true, None);
                }
            }
        }
        if mixed {
            return Some(Err(Mixed));
        }
        self.came = [None; N];
        Some(Ok(values))
    }
}

impl Well {
    fn new(condition: Option<Condition>) -> Self {
        Self { condition, now: true }
    }

    fn note(&mut self, id: CanId, data: [u8; DATA_BYTES]) {
        let Some(condition) = self.condition else { return };
        if let Some(raw) = condition.place.raw(id, data) {
            self.now = raw & condition.mask == condition.value;
        }
    }
}

fn vec3<F>([x, y, z]: [f64; 3]) -> Vec3<F> {
    Vec3::new(x, y, z)
}
