//! Bosch MM5.10 as used on the bus of the ABS M5 kit: little-endian, unsigned, one turn rate and one acceleration per
//! frame.
//!
//! The unit has no turn rate about its pitch axis.
//! Source: Bosch Motorsport, ABS M5 Kit manual, p. 40 to 42.

use super::fields::{MessageError, data_id};
use crate::frame::{CanFrame, CanId, Payload};

const YAW: u16 = 0x70;
const ROLL: u16 = 0x80;
const VERTICAL: u16 = 0x576;

/// Minimum length of a frame that has both values.
const NEEDED_BYTES: usize = 6;

/// Step of the turn rates, degrees per second. A raw value of zero means -163.84.
pub const RATE_QUANTUM_DEGPS: f64 = 0.005;
/// Step of the accelerations, g. A raw value of zero means -4.1768.
pub const ACCELERATION_QUANTUM_G: f64 = 0.000_127_465;
const RATE_OFFSET_DEGPS: f64 = -163.84;
const ACCELERATION_OFFSET_G: f64 = -4.1768;

/// One standard gravity, m/s^2.
const STANDARD_GRAVITY_MPS2: f64 = 9.806_65;

/// A turn rate in counts, as in the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawRate(pub u16);

/// An acceleration in counts, as in the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawAcceleration(pub u16);

/// One message of the Bosch set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Turn rate about z, acceleration along y.
    Yaw(RawRate, RawAcceleration),
    /// Turn rate about x, acceleration along x.
    Roll(RawRate, RawAcceleration),
    /// Acceleration along z.
    Vertical(RawAcceleration),
}

impl RawRate {
    /// Turn rate, degrees per second.
    pub fn degps(self) -> f64 {
        f64::from(self.0) * RATE_QUANTUM_DEGPS + RATE_OFFSET_DEGPS
    }

    /// Raw value nearest to a turn rate in degrees per second.
    pub fn nearest(degps: f64) -> Self {
        Self(raw(degps, RATE_QUANTUM_DEGPS, RATE_OFFSET_DEGPS))
    }
}

impl RawAcceleration {
    /// Acceleration, g.
    pub fn g(self) -> f64 {
        f64::from(self.0) * ACCELERATION_QUANTUM_G + ACCELERATION_OFFSET_G
    }

    /// Acceleration, m/s^2.
    pub fn mps2(self) -> f64 {
        self.g() * STANDARD_GRAVITY_MPS2
    }

    /// Raw value nearest to an acceleration in m/s^2.
    pub fn nearest(mps2: f64) -> Self {
        Self(raw(mps2 / STANDARD_GRAVITY_MPS2, ACCELERATION_QUANTUM_G, ACCELERATION_OFFSET_G))
    }
}

fn raw(value: f64, quantum: f64, offset: f64) -> u16 {
    let raw = headrace_sensor::geometry::math::round_to_i64((value - offset) / quantum);
    u16::try_from(raw.clamp(0, i64::from(u16::MAX))).unwrap_or_default()
}

/// Decodes a frame; `None` if the frame isn't of this set.
///
/// Errors: fewer than six bytes.
pub fn decode(frame: &CanFrame) -> Result<Option<Message>, MessageError> {
    let Some(id @ CanId::Standard(code @ (YAW | ROLL | VERTICAL))) = data_id(frame) else { return Ok(None) };
    let data = frame.data();
    let &[r0, r1, _, _, a0, a1, ..] = data else {
        return Err(MessageError { id, len: data.len(), needed: NEEDED_BYTES });
    };
    let rate = RawRate(u16::from_le_bytes([r0, r1]));
    let acceleration = RawAcceleration(u16::from_le_bytes([a0, a1]));
    Ok(Some(match code {
        YAW => Message::Yaw(rate, acceleration),
        ROLL => Message::Roll(rate, acceleration),
        _ => Message::Vertical(acceleration),
    }))
}

/// Encodes a message. Undefined bytes are zero.
pub fn encode(message: &Message) -> CanFrame {
    let (id, rate, acceleration) = match *message {
        Message::Yaw(rate, acceleration) => (YAW, rate.0, acceleration),
        Message::Roll(rate, acceleration) => (ROLL, rate.0, acceleration),
        Message::Vertical(acceleration) => (VERTICAL, 0, acceleration),
    };
    let payload = Payload::default().with(&rate.to_le_bytes()).with(&[0, 0]);
    CanFrame::new(CanId::Standard(id), payload.with(&acceleration.0.to_le_bytes()).with(&[0, 0]))
}
