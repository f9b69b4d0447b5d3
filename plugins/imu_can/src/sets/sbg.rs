//! SBG Systems Ellipse and HPINS: little-endian, identifiers as delivered (all outputs are off by default).
//!
//! The device's axes are x forward, y right, z down, and its earth frame is north, east, down: two of three axes point
//! the other way than ours. [`to_ours`] turns vectors and [`rotation_to_ours`] rotations; both are their own inverse.
//! Source: SBG Systems, sbgECom CAN protocol and sbgCan.dbc; bits of the status in its firmware reference.

use super::{MessageError, data_id, exactly, words};
use crate::frame::{CanFrame, CanId, Payload};

/// Acceleration, m/s^2.
pub const ACCELERATION_QUANTUM_MPS2: f64 = 1e-2;
/// Turn rate, rad/s.
pub const RATE_QUANTUM_RADPS: f64 = 1e-3;
/// One step of a quaternion's component.
pub const QUATERNION_QUANTUM: f64 = 1.0 / 32_767.0;
/// Euler angles and their accuracies, radians.
pub const EULER_QUANTUM_RAD: f64 = 1e-4;
/// Temperature, degrees Celsius.
pub const TEMPERATURE_QUANTUM_DEGC: f64 = 1e-2;

/// The unit answers, its accelerometers have passed their tests and are within their range.
const FORCE_WELL: u16 = 0x11D;
/// The same of its gyros.
const RATE_WELL: u16 = 0x2E1;
/// A status of which all bits that are known say that all is well.
pub const ALL_WELL: ImuStatus = ImuStatus(0x3FF);

/// State of the inertial unit as bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImuStatus(pub u16);

impl ImuStatus {
    /// Whether specific force is fit for use.
    pub fn force_is_well(self) -> bool {
        self.0 & FORCE_WELL == FORCE_WELL
    }

    /// Whether turn rate is fit for use.
    pub fn rate_is_well(self) -> bool {
        self.0 & RATE_WELL == RATE_WELL
    }
}

/// One message, in the device's own axes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Heads a sample of the inertial unit.
    ImuInfo {
        /// Time since switched on, microseconds.
        time_us: u32,
        /// State.
        status: ImuStatus,
        /// Temperature.
        temperature: i16,
    },
    /// Specific force.
    Acceleration([i16; 3]),
    /// Turn rate.
    Rate([i16; 3]),
    /// Heads a solution of the filter: time since switched on, microseconds.
    EkfTime(u32),
    /// Sensor to north, east, down; w x y z.
    Quaternion([i16; 4]),
    /// Roll, pitch, yaw.
    Euler([i16; 3]),
    /// Accuracies of roll, pitch, yaw.
    Accuracy([u16; 3]),
}

/// A vector in the device's axes in ours, or the other way.
pub fn to_ours([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

/// A quaternion w x y z between the device's frames as one between ours, or the other way.
pub fn rotation_to_ours([w, x, y, z]: [f64; 4]) -> [f64; 4] {
    [w, x, -y, -z]
}

/// Reads a frame; `None` where it is not of this set.
///
/// Errors: a length that the message can't have.
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

/// Writes a message.
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
