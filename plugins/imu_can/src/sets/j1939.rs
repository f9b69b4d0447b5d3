//! SAE J1939 slope, angular rate and acceleration: 29-bit identifiers, little-endian, unsigned with an offset.
//!
//! Identifier = priority << 26 | parameter group << 8 | source address. A value whose highest byte is 0xFE (error) or
//! 0xFF (not available) carries no measurement.
//! Source: SAE J1939-71, parameter groups 61481, 61482, 61485; figures of merit and latency as Axiomatic UMAX0608XX and
//! Honeywell TARS document them.

use super::fields::{MessageError, data_id, exactly};
use crate::frame::{CanFrame, CanId, Payload};

const SLOPE_2: u32 = 61_481;
const ANGULAR_RATE: u32 = 61_482;
const ACCELERATION: u32 = 61_485;
/// Default priority of all three groups.
const PRIORITY: u32 = 3;
/// Source address of encoded frames if the set accepts any sender.
const ANY_SENDER: u8 = 0x80;

/// Step of the angles, degrees. A raw value of zero means -250.
pub const SLOPE_QUANTUM_DEG: f64 = 1.0 / 32_768.0;
/// Step of the turn rates, degrees per second. A raw value of zero means -250.
pub const RATE_QUANTUM_DEGPS: f64 = 1.0 / 128.0;
/// Step of the accelerations, m/s^2. A raw value of zero means -320.
pub const ACCELERATION_QUANTUM_MPS2: f64 = 0.01;
const ANGLE_OFFSET_DEG: f64 = -250.0;
const ACCELERATION_OFFSET_MPS2: f64 = -320.0;
const LATENCY_QUANTUM_MS: f64 = 0.5;

/// Filter of frames by their sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Network {
    /// Source address of the unit; `None` if it is the only sender of these groups.
    pub source_address: Option<u8>,
}

/// Pitch and roll with extended range and resolution (SSI2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slope {
    /// Raw pitch, 24 bits.
    pub pitch: u32,
    /// Raw roll, 24 bits.
    pub roll: u32,
    /// Four values of two bits each, from bit 0: pitch compensation, pitch figure of merit, roll compensation, roll
    /// figure of merit.
    pub figures: u8,
    /// Age of the values when the frame was sent, in half milliseconds.
    pub latency: u8,
}

/// Three turn rates or accelerations, in the maker's axis order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Triple {
    /// Values in the order of the frame.
    pub raw: [u16; 3],
    /// Figures of merit, two bits each from bit 0: 0 good, 1 degraded, 2 error, 3 not available.
    pub figures: u8,
    /// Age of the values when the frame was sent, in half milliseconds.
    pub latency: u8,
}

/// One message of the J1939 set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Parameter group 61481: slope.
    Slope(Slope),
    /// Parameter group 61482: angular rate.
    AngularRate(Triple),
    /// Parameter group 61485: acceleration.
    Acceleration(Triple),
}

impl Slope {
    /// Pitch in degrees, if available.
    pub fn pitch_deg(&self) -> Option<f64> {
        slope_deg(self.pitch)
    }

    /// Roll in degrees, if available.
    pub fn roll_deg(&self) -> Option<f64> {
        slope_deg(self.roll)
    }
}

impl Triple {
    /// Turn rates in degrees per second, in wire order; `None` if one of them is unavailable.
    pub fn rates_degps(&self) -> Option<[f64; 3]> {
        self.values(RATE_QUANTUM_DEGPS, ANGLE_OFFSET_DEG)
    }

    /// Accelerations in m/s^2, in wire order; `None` if one of them is unavailable.
    pub fn accelerations_mps2(&self) -> Option<[f64; 3]> {
        self.values(ACCELERATION_QUANTUM_MPS2, ACCELERATION_OFFSET_MPS2)
    }

    /// Whether any figure of merit is "error".
    pub fn has_error(&self) -> bool {
        [0, 2, 4].iter().any(|shift| self.figures >> shift & 0b11 == 0b10)
    }

    /// Age of the values when the frame was sent, in milliseconds, if available.
    pub fn latency_ms(&self) -> Option<f64> {
        is_value(self.latency).then(|| f64::from(self.latency) * LATENCY_QUANTUM_MS)
    }

    fn values(self, quantum: f64, offset: f64) -> Option<[f64; 3]> {
        let all = self.raw.iter().all(|raw| is_value(raw.to_be_bytes()[0]));
        all.then(|| self.raw.map(|raw| f64::from(raw) * quantum + offset))
    }
}

impl Network {
    /// Decodes a frame; `None` if the frame isn't of this set, or is from another sender.
    ///
    /// Errors: a length other than eight.
    pub fn decode(self, frame: &CanFrame) -> Result<Option<Message>, MessageError> {
        let Some(id @ CanId::Extended(bits)) = data_id(frame) else { return Ok(None) };
        let sender = (bits & 0xFF) as u8;
        let group = bits >> 8 & 0x3_FFFF;
        let known = [SLOPE_2, ANGULAR_RATE, ACCELERATION].contains(&group);
        if !known || self.source_address.is_some_and(|address| address != sender) {
            return Ok(None);
        }
        let [b0, b1, b2, b3, b4, b5, figures, latency] = exactly(id, frame.data())?;
        let triple = Triple { raw: [[b0, b1], [b2, b3], [b4, b5]].map(u16::from_le_bytes), figures, latency };
        Ok(Some(match group {
            SLOPE_2 => Message::Slope(Slope {
                pitch: u32::from_le_bytes([b0, b1, b2, 0]),
                roll: u32::from_le_bytes([b3, b4, b5, 0]),
                figures,
                latency,
            }),
            ANGULAR_RATE => Message::AngularRate(triple),
            _ => Message::Acceleration(triple),
        }))
    }

    /// Encodes a message.
    pub fn encode(self, message: &Message) -> CanFrame {
        let (group, payload) = match message {
            Message::Slope(slope) => {
                let [p0, p1, p2, _] = slope.pitch.to_le_bytes();
                let [r0, r1, r2, _] = slope.roll.to_le_bytes();
                let tail = [slope.figures, slope.latency];
                (SLOPE_2, Payload::default().with(&[p0, p1, p2, r0, r1, r2]).with(&tail))
            }
            Message::AngularRate(triple) => (ANGULAR_RATE, triple_payload(*triple)),
            Message::Acceleration(triple) => (ACCELERATION, triple_payload(*triple)),
        };
        let sender = u32::from(self.source_address.unwrap_or(ANY_SENDER));
        CanFrame::new(CanId::Extended(PRIORITY << 26 | group << 8 | sender), payload)
    }
}

fn triple_payload(triple: Triple) -> Payload {
    let words = triple.raw.iter().fold(Payload::default(), |payload, raw| payload.with(&raw.to_le_bytes()));
    words.with(&[triple.figures, triple.latency])
}

fn slope_deg(raw: u32) -> Option<f64> {
    let [_, highest, ..] = raw.to_be_bytes();
    is_value(highest).then(|| f64::from(raw) * SLOPE_QUANTUM_DEG + ANGLE_OFFSET_DEG)
}

fn is_value(highest_byte: u8) -> bool {
    highest_byte < 0xFE
}

/// Converts a turn rate in degrees per second to its raw value.
pub(crate) fn rate_raw(degps: f64) -> u16 {
    raw(degps, RATE_QUANTUM_DEGPS, ANGLE_OFFSET_DEG)
}

/// Converts an acceleration in m/s^2 to its raw value.
pub(crate) fn acceleration_raw(mps2: f64) -> u16 {
    raw(mps2, ACCELERATION_QUANTUM_MPS2, ACCELERATION_OFFSET_MPS2)
}

/// Converts an angle in degrees to its raw value.
pub(crate) fn slope_raw(deg: f64) -> u32 {
    let raw = headrace_sensor::geometry::math::round_to_i64((deg - ANGLE_OFFSET_DEG) / SLOPE_QUANTUM_DEG);
    u32::try_from(raw.clamp(0, 0xFD_FFFF)).unwrap_or_default()
}

fn raw(value: f64, quantum: f64, offset: f64) -> u16 {
    let raw = headrace_sensor::geometry::math::round_to_i64((value - offset) / quantum);
    u16::try_from(raw.clamp(0, 0xFDFF)).unwrap_or_default()
}
