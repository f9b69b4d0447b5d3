//! Xsens (Movella) MTi-600, Sirius and Avior: big-endian, one quantity per frame.
//!
//! Each output's identifier is configurable in the device. The defaults are 11-bit codes. Some devices use 29-bit
//! identifiers: a base, with the same code in the lowest byte.
//! Source: Xsens MT CAN protocol (MT1604P); byte order as in all known readers.

use super::fields::{MessageError, data_id, exactly, words};
use crate::frame::{CanFrame, CanId, Payload};

/// Size of one raw unit of a quaternion component.
pub const QUATERNION_QUANTUM: f64 = 1.0 / 32_767.0;
/// Angle that one raw unit stands for, degrees.
pub const EULER_QUANTUM_DEG: f64 = 1.0 / 128.0;
/// Turn rate that one raw unit stands for, rad/s.
pub const RATE_QUANTUM_RADPS: f64 = 1.0 / 512.0;
/// Acceleration that one raw unit stands for, m/s^2.
pub const ACCELERATION_QUANTUM_MPS2: f64 = 1.0 / 256.0;
/// Magnetic field that one raw unit stands for, as a fraction of the earth's field.
pub const MAGNETIC_QUANTUM: f64 = 1.0 / 1024.0;
/// Temperature difference that one raw unit stands for, degrees Celsius.
pub const TEMPERATURE_QUANTUM_DEGC: f64 = 1.0 / 256.0;
/// Air pressure that one raw unit stands for, Pa.
pub const PRESSURE_QUANTUM_PA: f64 = 1.0 / 32_768.0;

/// CAN identifiers used by the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Ids {
    /// Base of 29-bit identifiers, whose lowest byte is the code; `None` for the default 11-bit codes.
    pub base: Option<u32>,
}

/// Velocity increment over one sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeltaV {
    /// x, y, z in 2^-`exponent` m/s.
    pub mantissas: [i16; 3],
    /// Exponent of the unit of `mantissas`.
    pub exponent: u8,
}

/// UTC according to the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Utc {
    /// Year minus 2000, month, day, hour, minute, second.
    pub year_to_second: [u8; 6],
    /// Tenths of milliseconds within the second.
    pub tenths_ms: u16,
}

/// Status bits of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StatusWord(pub u32);

/// One message of the Xsens set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Error code; 1 means that the device dropped messages.
    Error(u8),
    /// Sample timestamp, in ticks of configurable length (100 us by most sources).
    SampleTime(u32),
    /// Number of the sample, which wraps.
    GroupCounter(u16),
    /// UTC of the sample.
    Utc(Utc),
    /// Status bits of the device.
    StatusWord(StatusWord),
    /// Rotation from the sensor to the local earth frame (z up); w x y z.
    Quaternion([i16; 4]),
    /// Roll, pitch, yaw.
    EulerAngles([i16; 3]),
    /// Velocity increment over one sample.
    DeltaV(DeltaV),
    /// Turn rate.
    RateOfTurn([i16; 3]),
    /// Orientation increment over one sample; w x y z.
    DeltaQ([i16; 4]),
    /// Specific force.
    Acceleration([i16; 3]),
    /// Acceleration in the local earth frame, without gravity.
    FreeAcceleration([i16; 3]),
    /// Magnetic field.
    MagneticField([i16; 3]),
    /// Temperature of the device.
    Temperature(i16),
    /// Air pressure inside the housing.
    BaroPressure(u32),
    /// Specific force at high rate. Some published sources swap this code with the code of [`Message::RateOfTurnHr`].
    AccelerationHr([i16; 3]),
    /// Turn rate at high rate; see [`Message::AccelerationHr`] about its code.
    RateOfTurnHr([i16; 3]),
    /// Latitude in 2^-24 and longitude in 2^-23 degrees.
    LatLon([i32; 2]),
    /// Height in 2^-15 m.
    Altitude(i32),
    /// Velocity in 2^-6 m/s.
    Velocity([i16; 3]),
}

impl StatusWord {
    /// Whether the orientation is valid.
    pub fn orientation_valid(self) -> bool {
        self.0 & 0b10 != 0
    }

    /// Whether an accelerometer is out of range.
    pub fn acceleration_clipped(self) -> bool {
        self.0 & 0x700 != 0
    }

    /// Whether a gyro is out of range.
    pub fn rate_clipped(self) -> bool {
        self.0 & 0x3800 != 0
    }
}

impl DeltaV {
    /// Velocity increment x, y, z in m/s.
    pub fn mps(&self) -> [f64; 3] {
        let halvings = 1_u64 << self.exponent.min(63);
        self.mantissas.map(|mantissa| f64::from(mantissa) / halvings as f64)
    }
}

impl Ids {
    fn code(self, id: CanId) -> Option<u8> {
        match (self.base, id) {
            (None, CanId::Standard(id)) => u8::try_from(id).ok(),
            (Some(base), CanId::Extended(id)) if id & !0xFF == base & !0xFF => Some((id & 0xFF) as u8),
            _ => None,
        }
    }

    fn id(self, code: u8) -> CanId {
        match self.base {
            None => CanId::Standard(u16::from(code)),
            Some(base) => CanId::Extended(base & !0xFF | u32::from(code)),
        }
    }

    /// Decodes a frame; `None` if the frame isn't of this set.
    ///
    /// Errors: the length is wrong for the message.
    pub fn decode(self, frame: &CanFrame) -> Result<Option<Message>, MessageError> {
        let Some(id) = data_id(frame) else { return Ok(None) };
        let data = frame.data();
        let four = || exactly::<4>(id, data);
        let three_words = || exactly::<6>(id, data).map(|data| words(&data, i16::from_be_bytes));
        let four_words = || exactly::<8>(id, data).map(|data| words(&data, i16::from_be_bytes));
        Ok(Some(match self.code(id) {
            Some(0x01) => Message::Error(u8::from_be_bytes(exactly(id, data)?)),
            Some(0x05) => Message::SampleTime(u32::from_be_bytes(four()?)),
            Some(0x06) => Message::GroupCounter(u16::from_be_bytes(exactly(id, data)?)),
            Some(0x07) => {
                let [year, month, day, hour, minute, second, high, low] = exactly(id, data)?;
                Message::Utc(Utc {
                    year_to_second: [year, month, day, hour, minute, second],
                    tenths_ms: u16::from_be_bytes([high, low]),
                })
            }
            Some(0x11) => Message::StatusWord(StatusWord(u32::from_be_bytes(four()?))),
            Some(0x21) => Message::Quaternion(four_words()?),
            Some(0x22) => Message::EulerAngles(three_words()?),
            Some(0x31) => {
                let data = exactly::<7>(id, data)?;
                let [.., exponent] = data;
                Message::DeltaV(DeltaV { mantissas: words(&data, i16::from_be_bytes), exponent })
            }
            Some(0x32) => Message::RateOfTurn(three_words()?),
            Some(0x33) => Message::DeltaQ(four_words()?),
            Some(0x34) => Message::Acceleration(three_words()?),
            Some(0x35) => Message::FreeAcceleration(three_words()?),
            Some(0x41) => Message::MagneticField(three_words()?),
            Some(0x51) => Message::Temperature(i16::from_be_bytes(exactly(id, data)?)),
            Some(0x52) => Message::BaroPressure(u32::from_be_bytes(four()?)),
            Some(0x61) => Message::AccelerationHr(three_words()?),
            Some(0x62) => Message::RateOfTurnHr(three_words()?),
            Some(0x71) => {
                let [a0, a1, a2, a3, o0, o1, o2, o3] = exactly(id, data)?;
                Message::LatLon([i32::from_be_bytes([a0, a1, a2, a3]), i32::from_be_bytes([o0, o1, o2, o3])])
            }
            Some(0x72) => Message::Altitude(i32::from_be_bytes(four()?)),
            Some(0x76) => Message::Velocity(three_words()?),
            _ => return Ok(None),
        }))
    }

    /// Encodes a message.
    pub fn encode(self, message: &Message) -> CanFrame {
        let bytes = |bytes: &[u8]| Payload::default().with(bytes);
        let (code, payload) = match *message {
            Message::Error(code) => (0x01, bytes(&[code])),
            Message::SampleTime(ticks) => (0x05, bytes(&ticks.to_be_bytes())),
            Message::GroupCounter(count) => (0x06, bytes(&count.to_be_bytes())),
            Message::Utc(utc) => (0x07, bytes(&utc.year_to_second).with(&utc.tenths_ms.to_be_bytes())),
            Message::StatusWord(word) => (0x11, bytes(&word.0.to_be_bytes())),
            Message::Quaternion(raw) => (0x21, big_endian(&raw)),
            Message::EulerAngles(raw) => (0x22, big_endian(&raw)),
            Message::DeltaV(delta) => (0x31, big_endian(&delta.mantissas).with(&[delta.exponent])),
            Message::RateOfTurn(raw) => (0x32, big_endian(&raw)),
            Message::DeltaQ(raw) => (0x33, big_endian(&raw)),
            Message::Acceleration(raw) => (0x34, big_endian(&raw)),
            Message::FreeAcceleration(raw) => (0x35, big_endian(&raw)),
            Message::MagneticField(raw) => (0x41, big_endian(&raw)),
            Message::Temperature(raw) => (0x51, bytes(&raw.to_be_bytes())),
            Message::BaroPressure(raw) => (0x52, bytes(&raw.to_be_bytes())),
            Message::AccelerationHr(raw) => (0x61, big_endian(&raw)),
            Message::RateOfTurnHr(raw) => (0x62, big_endian(&raw)),
            Message::LatLon([lat, lon]) => (0x71, bytes(&lat.to_be_bytes()).with(&lon.to_be_bytes())),
            Message::Altitude(raw) => (0x72, bytes(&raw.to_be_bytes())),
            Message::Velocity(raw) => (0x76, big_endian(&raw)),
        };
        CanFrame::new(self.id(code), payload)
    }
}

fn big_endian(raw: &[i16]) -> Payload {
    raw.iter().fold(Payload::default(), |payload, word| payload.with(&word.to_be_bytes()))
}
