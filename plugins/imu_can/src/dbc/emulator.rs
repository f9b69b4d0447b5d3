//! Emulates an inertial unit on the CAN bus. At a fixed rate, it sends one sample as all frames that the DBC
//! file defines.

use headrace_sensor::device::{Direction, Emulator, LineSink};
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Inertia;

use super::file::Place;
use super::layout::DATA_BYTES;
use super::mapping::{Attitude, Condition, Mapping, Part};
use crate::frame::{CanFrame, CanId, Payload};

/// An ideal emulated unit: there is no noise, bias or added delay, but signals are quantised.
#[derive(Debug, Clone)]
pub struct DbcEmulator {
    mapping: Mapping,
    frames: Vec<Frame>,
    rate_hz: f64,
    start: MonoNs,
    begun: u64,
    sent: u64,
}

/// A kind of frame that each sample has: identifier, length and multiplexer value.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    id: CanId,
    bytes: u8,
    switch: Option<u64>,
}

impl DbcEmulator {
    /// Creates a unit that is switched on, and first samples, at `start`.
    pub fn new(mapping: Mapping, rate_hz: f64, start: MonoNs) -> Self {
        let mut frames: Vec<Frame> = Vec::new();
        for place in mapping.places() {
            let frame = Frame {
                id: place.id,
                bytes: place.frame_bytes,
                switch: place.switch.map(|(_, value)| value),
            };
            if !frames.contains(&frame) {
                frames.push(frame);
            }
        }
        // In a multiplexed message, every frame also carries the unmultiplexed signals.
        let switched: Vec<CanId> = frames.iter().filter(|f| f.switch.is_some()).map(|f| f.id).collect();
        frames.retain(|frame| frame.switch.is_some() || !switched.contains(&frame.id));
        Self { mapping, frames, rate_hz, start, begun: 0, sent: 0 }
    }

    /// Time of a sample on the unit's clock, counted from the start.
    fn elapsed(&self, sample: u64) -> DurNs {
        DurNs::from_secs_f64(sample as f64 / self.rate_hz)
    }

    /// Values of all mapped signals for this motion.
    fn values(&self, motion: &Inertia) -> Vec<(Place, f64)> {
        let axes = self.mapping.axes;
        let mut values = Vec::new();
        let mut say = |parts: &[Part], si: &[f64]| {
            values.extend(parts.iter().zip(si).map(|(part, si)| (part.place, part.unit.of_si(*si))));
        };
        if let Some(parts) = self.mapping.rate {
            say(&parts, &axes.turned(motion.rate_radps.0.into()));
        }
        if let Some(parts) = self.mapping.force {
            say(&parts, &axes.turned(motion.force_mps2.0.into()));
        }
        match self.mapping.attitude {
            Some(Attitude::Quaternion(parts)) => say(&parts, &axes.rotation_turned(motion.attitude.wxyz())),
            Some(Attitude::Euler(parts)) => {
                say(&parts, &axes.turned(motion.attitude.roll_pitch_yaw().into()));
            }
            None => (),
        }
        values
    }

    /// Encodes a frame; `None` if one of its values isn't finite, because it wasn't measured.
    fn frame(&self, frame: Frame, values: &[(Place, f64)], elapsed: DurNs) -> Option<CanFrame> {
        let there = |place: &Place| {
            place.id == frame.id && place.switch.is_none_or(|(_, on)| Some(on) == frame.switch)
        };
        if values.iter().any(|(place, value)| there(place) && !value.is_finite()) {
            return None;
        }
        let mut data = [0; DATA_BYTES];
        for (place, value) in values.iter().filter(|(place, _)| there(place)) {
            data = place.put(data, *value);
        }
        let conditions = self.mapping.conditions;
        let conditions = [conditions.all, conditions.attitude, conditions.rate, conditions.force];
        for Condition { place, mask, value } in conditions.into_iter().flatten().filter(|c| there(&c.place)) {
            let others = place.layout.extract(data) & !mask;
            data = place.layout.insert(data, others | value);
        }
        if let Some(stamp) = self.mapping.sample_time.filter(|stamp| there(&stamp.place)) {
            let ticks = elapsed.0 / stamp.tick.0.max(1);
            data = stamp.place.layout.insert(data, ticks as u64);
        }
        let switches =
            self.mapping.places().filter(|place| place.id == frame.id).filter_map(|place| place.switch);
        for (switch, value) in switches.filter(|(_, value)| Some(*value) == frame.switch) {
            data = switch.insert(data, value);
        }
        let data = data.get(..usize::from(frame.bytes)).unwrap_or_default();
        Some(CanFrame::new(frame.id, Payload::default().with(data)))
    }
}

impl Emulator<Inertia> for DbcEmulator {
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
        let values = self.values(motion);
        for frame in self.frames.iter().filter_map(|frame| self.frame(*frame, &values, elapsed)) {
            line(Direction::Received, motion.at + self.mapping.latency, &frame.encode());
        }
    }
}
