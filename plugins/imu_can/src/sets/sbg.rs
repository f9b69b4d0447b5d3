//! SBG Systems Ellipse and HPINS: little-endian, default identifiers (all outputs are off by default).
//!
//! Device axes are x forward, y right, z down. The earth frame is north, east, down. The signs of y and z are therefore
//! opposite to headrace's. [`to_ours`] converts vectors, and [`rotation_to_ours`] converts rotations; each is its own
//! inverse.
//! Source: SBG Systems, sbgECom CAN protocol and sbgCan.dbc; bits of the status in its firmware reference.

use super::fields::{MessageError, data_id, exactly, words};
use crate::frame::{CanFrame, CanId, Payload};

/// Acceleration that one raw unit stands for, m/s^2.
pub const ACCELERATION_QUANTUM_MPS2: f64 = 1e-2;
/// Turn rate that one raw unit stands for, rad/s.
pub const RATE_QUANTUM_RADPS: f64 = 1e-3;
/// Size of one raw unit of a quaternion component.
pub const QUATERNION_QUANTUM: f64 = 1.0 / 32_767.0;
/// Angle that one raw unit stands for, radians. It is the same for Euler angles and for their accuracies.
pub const EULER_QUANTUM_RAD: f64 = 1e-4;
/// Temperature difference that one raw unit stands for, degrees Celsius.
pub const TEMPERATURE_QUANTUM_DEGC: f64 = 1e-2;

/// Status bits of valid specific force: the unit responds, and its accelerometers have passed their tests and are
/// within range.
const FORCE_WELL: u16 = 0x11D;
/// Status bits of valid turn rate: the unit responds, and its gyros have passed their tests and are within range.
const RATE_WELL: u16 = 0x2E1;
/// A status with all known bits set to valid.
pub const ALL_WELL: ImuStatus = ImuStatus(0x3FF);

/// Status bits of the inertial unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImuStatus(pub u16);

impl ImuStatus {
    /// Whether specific force is valid.
    pub fn force_is_well(self) -> bool {
        self.0 & FORCE_WELL == FORCE_WELL
    }

    /// Whether turn rate is valid.
    pub fn rate_is_well(self) -> bool {
        self.0 & RATE_WELL == RATE_WELL
    }
}

/// One message of the SBG set, in the device's axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Header of an inertial sample.
    ImuInfo {
        /// Time since power-on, microseconds.
        time_us: u32,
        /// Status bits of the unit.
        status: ImuStatus,
        /// Temperature of the unit.
        temperature: i16,
    },
    /// Specific force.
    Acceleration([i16; 3]),
    /// Turn rate.
    Rate([i16; 3]),
    /// Header of a filter solution: time since power-on, microseconds.
    EkfTime(u32),
    /// Rotation from the sensor to north, east, down; w x y z.
    Quaternion([i16; 4]),
    /// Roll, pitch, yaw.
    Euler([i16; 3]),
    /// Accuracies of roll, pitch, yaw.
    Accuracy([u16; 3]),
}

/// Converts a vector from device axes to headrace's, or back.
pub fn to_ours([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

/// Converts a quaternion w x y z from the device's frames to headrace's, or back.
pub fn rotation_to_ours([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, x, -y, -z]
}

/// Decodes a frame; `None` if the frame isn't of this set.
///
/// Errors: the length is wrong for the message.
pub fn decode(frame: &CanFrame) -> Result<Option<Message>, MessageError> {
    let Some(id @ CanId::Standard(code)) = data_id(frame) else { return Ok(None) };
    let data = frame.data();
    let three_words = || exactly::<6>(id, data).map(|data| words(&data, i16::from_le_bytes));
    Ok(Some(match code {
        0x120 => {
            let [t0, t1, t2, t3, s0, s1, c0, c1] = exactly(id, data)?;
            Message::ImuInfo {
                time_us: u32::from_le_bytes([t0, t1, t2, t3]),
                status: ImuStatus(u16::from_le_bytes([s0, s1])),
                temperature: i16::from_le_bytes([c0, c1]),
            }
        }
        0x121 => Message::Acceleration(three_words()?),
        0x122 => Message::Rate(three_words()?),
        0x130 => Message::EkfTime(u32::from_le_bytes(exactly(id, data)?)),
        0x131 => Message::Quaternion(words(&exactly::<8>(id, data)?, i16::from_le_bytes)),
        0x132 => Message::Euler(three_words()?),
        0x133 => Message::Accuracy(three_words()?.map(i16::cast_unsigned)),
        _ => return Ok(None),
    }))
}

/// Encodes a message.
pub fn encode(message: &Message) -> CanFrame {
    let bytes = |bytes: &[u8]| Payload::default().with(bytes);
    let (id, payload) = match *message {
        Message::ImuInfo { time_us, status, temperature } => {
            let payload = bytes(&time_us.to_le_bytes()).with(&status.0.to_le_bytes());
            (0x120, payload.with(&temperature.to_le_bytes()))
        }
        Message::Acceleration(raw) => (0x121, little_endian(&raw)),
        Message::Rate(raw) => (0x122, little_endian(&raw)),
        Message::EkfTime(time_us) => (0x130, bytes(&time_us.to_le_bytes())),
        Message::Quaternion(raw) => (0x131, little_endian(&raw)),
        Message::Euler(raw) => (0x132, little_endian(&raw)),
        Message::Accuracy(raw) => (0x133, little_endian(&raw.map(u16::cast_signed))),
    };
    CanFrame::new(CanId::Standard(id), payload)
}

fn little_endian(raw: &[i16]) -> Payload {
    raw.iter().fold(Payload::default(), |payload, word| payload.with(&word.to_le_bytes()))
}
