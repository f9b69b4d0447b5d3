//! The messages that are of use, in the wire's own units and axes: x forward, y right, z down, and north, east, down.
//!
//! [`to_ours`] turns vectors into our axes (x forward, y left, z up) and angles into ours; both are their own inverse.
//! Source: MAVLink common message set (common.xml): ATTITUDE, RAW_IMU, SCALED_IMU to SCALED_IMU3, SCALED_PRESSURE to
//! SCALED_PRESSURE3, DISTANCE_SENSOR.

use headrace_sensor::codec::Bytes;

use crate::frame::{Frame, Version};

/// Unit of acceleration: a thousandth of standard gravity, m/s^2.
pub const MILLI_G_MPS2: f64 = 9.806_65e-3;
/// Unit of turn rate, rad/s.
pub const MILLIRADPS: f64 = 1e-3;
/// Unit of pressure, Pa.
pub const HECTOPASCAL: f64 = 100.0;

const ATTITUDE: u32 = 30;
const DISTANCE_SENSOR: u32 = 132;

/// One message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Message {
    /// Attitude and turn rate as the autopilot estimates them.
    Attitude(Attitude),
    /// Rates and forces of one inertial unit.
    Imu(Imu),
    /// Pressure of one barometer.
    Pressure(Pressure),
    /// One distance.
    Distance(Distance),
}

/// ATTITUDE.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attitude {
    /// Since the autopilot began; wraps after 49 days.
    pub time_boot_ms: u32,
    /// Roll, pitch, yaw: turned about z, then y, then x.
    pub angles_rad: [f32; 3],
    /// Turn rates about x, y, z.
    pub rates_radps: [f32; 3],
}

/// RAW_IMU and SCALED_IMU to SCALED_IMU3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imu {
    /// Which message.
    pub message: ImuMessage,
    /// Since the autopilot began, or since 1970; scaled ones tell it in milliseconds.
    pub time_us: u64,
    /// Acceleration less gravity.
    pub force_mg: [i16; 3],
    /// Turn rate.
    pub rate_mradps: [i16; 3],
    /// Which unit it is; only RAW_IMU of the second version tells more than 0.
    pub unit: u8,
}

/// SCALED_PRESSURE to SCALED_PRESSURE3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pressure {
    /// Which message.
    pub message: PressureMessage,
    /// Since the autopilot began.
    pub time_boot_ms: u32,
    /// Absolute pressure.
    pub absolute_hpa: f32,
    /// Temperature, hundredths of a degree Celsius.
    pub temperature_cdegc: i16,
}

/// DISTANCE_SENSOR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Distance {
    /// Since the autopilot began.
    pub time_boot_ms: u32,
    /// The least that the sensor can measure.
    pub least_cm: u16,
    /// The most that the sensor can measure.
    pub most_cm: u16,
    /// What it measures.
    pub distance_cm: u16,
    /// Number of the sensor.
    pub sensor_id: u8,
    /// Where it looks, as a number of MAV_SENSOR_ORIENTATION.
    pub orientation: u8,
    /// Quality in per cent, of which 1 means invalid; 0 where it isn't known.
    pub quality_percent: u8,
}

/// The messages that tell rates and forces.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImuMessage {
    /// RAW_IMU.
    Raw,
    /// SCALED_IMU.
    Scaled,
    /// SCALED_IMU2.
    Scaled2,
    /// SCALED_IMU3.
    Scaled3,
}

/// The messages that tell pressures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressureMessage {
    /// SCALED_PRESSURE.
    First,
    /// SCALED_PRESSURE2.
    Second,
    /// SCALED_PRESSURE3.
    Third,
}

/// Who sends a frame, and its number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sender {
    /// The vehicle.
    pub system_id: u8,
    /// The part of it.
    pub component_id: u8,
    /// Number of the frame, modulo 256.
    pub sequence: u8,
}

/// A vector, or roll, pitch and yaw, in the wire's axes in ours, or the other way.
pub fn to_ours([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

impl ImuMessage {
    const fn id(self) -> u32 {
        match self {
            Self::Raw => 27,
            Self::Scaled => 26,
            Self::Scaled2 => 116,
            Self::Scaled3 => 129,
        }
    }

    const fn of(id: u32) -> Option<Self> {
        Some(match id {
            27 => Self::Raw,
            26 => Self::Scaled,
            116 => Self::Scaled2,
            129 => Self::Scaled3,
            _ => return None,
        })
    }
}

impl PressureMessage {
    const fn id(self) -> u32 {
        match self {
            Self::First => 29,
            Self::Second => 137,
            Self::Third => 143,
        }
    }

    const fn of(id: u32) -> Option<Self> {
        Some(match id {
            29 => Self::First,
            137 => Self::Second,
            143 => Self::Third,
            _ => return None,
        })
    }
}

impl Message {
    /// What a frame says; `None` for other messages.
    pub fn of(frame: &Frame) -> Option<Self> {
        let fields = Fields(frame.payload.as_slice());
        match frame.message_id {
            ATTITUDE => Some(Self::Attitude(Attitude {
                time_boot_ms: fields.u32(0),
                angles_rad: [4, 8, 12].map(|at| fields.f32(at)),
                rates_radps: [16, 20, 24].map(|at| fields.f32(at)),
            })),
            DISTANCE_SENSOR => Some(Self::Distance(Distance {
                time_boot_ms: fields.u32(0),
                least_cm: fields.u16(4),
                most_cm: fields.u16(6),
                distance_cm: fields.u16(8),
                sensor_id: fields.u8(11),
                orientation: fields.u8(12),
                quality_percent: fields.u8(38),
            })),
            id => {
                if let Some(message) = ImuMessage::of(id) {
                    return Some(Self::Imu(imu(message, fields)));
                }
                PressureMessage::of(id).map(|message| {
                    Self::Pressure(Pressure {
                        message,
                        time_boot_ms: fields.u32(0),
                        absolute_hpa: fields.f32(4),
                        temperature_cdegc: fields.i16(12),
                    })
                })
            }
        }
    }

    /// The message as a frame of the second version, its last zeros left away. Fields that nobody here reads are zero.
    pub fn to_frame(&self, sender: Sender) -> Frame {
        let mut payload = Payload::default();
        let message_id = match self {
            Self::Attitude(attitude) => {
                payload.put(0, attitude.time_boot_ms.to_le_bytes());
                for (at, value) in [4, 8, 12].into_iter().zip(attitude.angles_rad) {
                    payload.put(at, value.to_le_bytes());
                }
                for (at, value) in [16, 20, 24].into_iter().zip(attitude.rates_radps) {
                    payload.put(at, value.to_le_bytes());
                }
                ATTITUDE
            }
            Self::Imu(imu) => {
                put_imu(&mut payload, imu);
                imu.message.id()
            }
            Self::Pressure(pressure) => {
                payload.put(0, pressure.time_boot_ms.to_le_bytes());
                payload.put(4, pressure.absolute_hpa.to_le_bytes());
                payload.put(12, pressure.temperature_cdegc.to_le_bytes());
                pressure.message.id()
            }
            Self::Distance(distance) => {
                payload.put(0, distance.time_boot_ms.to_le_bytes());
                payload.put(4, distance.least_cm.to_le_bytes());
                payload.put(6, distance.most_cm.to_le_bytes());
                payload.put(8, distance.distance_cm.to_le_bytes());
                payload.put(10, [ULTRASOUND, distance.sensor_id, distance.orientation, VARIANCE_UNKNOWN]);
                payload.put(38, [distance.quality_percent]);
                DISTANCE_SENSOR
            }
        };
        let Sender { system_id, component_id, sequence } = sender;
        let payload = payload.trimmed();
        Frame { version: Version::V2(None), sequence, system_id, component_id, message_id, payload }
    }
}

/// Type of distance sensor: MAV_DISTANCE_SENSOR_ULTRASOUND.
const ULTRASOUND: u8 = 1;
const VARIANCE_UNKNOWN: u8 = u8::MAX;

/// RAW_IMU begins with a time of eight bytes, the others with one of four; the rest is alike but for RAW_IMU's number.
fn imu(message: ImuMessage, fields: Fields<'_>) -> Imu {
    let raw = message == ImuMessage::Raw;
    let first = if raw { 8 } else { 4 };
    let axes = |at: usize| [at, at + 2, at + 4].map(|at| fields.i16(at));
    Imu {
        message,
        time_us: if raw { fields.u64(0) } else { u64::from(fields.u32(0)) * 1000 },
        force_mg: axes(first),
        rate_mradps: axes(first + 6),
        unit: if raw { fields.u8(26) } else { 0 },
    }
}

fn put_imu(payload: &mut Payload, imu: &Imu) {
    let raw = imu.message == ImuMessage::Raw;
    let first = if raw { 8 } else { 4 };
    if raw {
        payload.put(0, imu.time_us.to_le_bytes());
        payload.put(26, [imu.unit]);
    } else {
        let wrapped = (imu.time_us / 1000) & u64::from(u32::MAX);
        payload.put(0, u32::try_from(wrapped).unwrap_or_default().to_le_bytes());
    }
    for (place, value) in imu.force_mg.into_iter().chain(imu.rate_mradps).enumerate() {
        payload.put(first + 2 * place, value.to_le_bytes());
    }
}

/// The fields of a payload, little-endian; zero beyond its end.
#[derive(Clone, Copy)]
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        for (to, from) in bytes.iter_mut().zip(self.0.iter().skip(at)) {
            *to = *from;
        }
        bytes
    }

    fn u8(self, at: usize) -> u8 {
        let [byte] = self.bytes(at);
        byte
    }

    fn u16(self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    fn i16(self, at: usize) -> i16 {
        i16::from_le_bytes(self.bytes(at))
    }

    fn u32(self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    fn u64(self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    fn f32(self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }
}

/// A payload that is being written; no message here is longer than 39 bytes.
struct Payload([u8; 40]);

impl Default for Payload {
    fn default() -> Self {
        Self([0; 40])
    }
}

impl Payload {
    fn put<const N: usize>(&mut self, at: usize, bytes: [u8; N]) {
        for (to, from) in self.0.iter_mut().skip(at).zip(bytes) {
            *to = from;
        }
    }

    /// Without the zeros at its end, but for its first byte.
    fn trimmed<const N: usize>(&self) -> Bytes<N> {
        let len = self.0.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
        self.0.get(..len).and_then(|sent| Bytes::new(sent).ok()).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::contract::decode_all;
    use proptest::prelude::*;

    use super::*;
    use crate::frame::MavlinkCodec;
    use crate::tests::{RECORDED_ATTITUDE, RECORDED_PRESSURE, RECORDED_RAW_IMU};

    const SENDER: Sender = Sender { system_id: 1, component_id: 1, sequence: 9 };

    fn recorded(bytes: &[u8]) -> Message {
        Message::of(&decode_all(&mut MavlinkCodec::default(), bytes)[0]).unwrap()
    }

    #[test]
    fn recorded_messages_say_what_another_reader_finds() {
        let Message::Attitude(attitude) = recorded(RECORDED_ATTITUDE) else { panic!() };
        assert_eq!(attitude.time_boot_ms, 689_235);
        let near = |got: f32, wanted: f32| assert!((got - wanted).abs() < 1e-6, "{got} is not {wanted}");
        near(attitude.angles_rad[0], -0.024_300_39);
        near(attitude.angles_rad[1], 0.024_687_847);
        near(attitude.angles_rad[2], -2.348_0);
        let Message::Imu(imu) = recorded(RECORDED_RAW_IMU) else { panic!() };
        assert_eq!((imu.time_us, imu.unit), (689_175_112, 0));
        assert_eq!((imu.force_mg, imu.rate_mradps), ([37, 24, -983], [-15, 17, 0]));
        let Message::Pressure(pressure) = recorded(RECORDED_PRESSURE) else { panic!() };
        assert_eq!((pressure.time_boot_ms, pressure.temperature_cdegc), (689_175, 1245));
        near(pressure.absolute_hpa, 1_015.8);
    }

    fn any_message() -> impl Strategy<Value = Message> {
        let imus = [ImuMessage::Raw, ImuMessage::Scaled, ImuMessage::Scaled2, ImuMessage::Scaled3];
        let pressures = [PressureMessage::First, PressureMessage::Second, PressureMessage::Third];
        let float = || -1e9_f32..1e9;
        prop_oneof![
            (any::<u32>(), [float(), float(), float()], [float(), float(), float()]).prop_map(
                |(time_boot_ms, angles_rad, rates_radps)| {
                    Message::Attitude(Attitude { time_boot_ms, angles_rad, rates_radps })
                }
            ),
            (0..4_usize, any::<u32>(), any::<[i16; 3]>(), any::<[i16; 3]>(), any::<u8>()).prop_map(
                move |(which, time_ms, force_mg, rate_mradps, unit)| {
                    let unit = if which == 0 { unit } else { 0 };
                    let time_us = u64::from(time_ms) * 1000;
                    Message::Imu(Imu { message: imus[which], time_us, force_mg, rate_mradps, unit })
                }
            ),
            (0..3_usize, any::<u32>(), float(), any::<i16>()).prop_map(
                move |(which, time_boot_ms, absolute_hpa, temperature_cdegc)| {
                    let message = pressures[which];
                    Message::Pressure(Pressure { message, time_boot_ms, absolute_hpa, temperature_cdegc })
                }
            ),
            (any::<u32>(), any::<[u16; 3]>(), any::<[u8; 3]>()).prop_map(|(time_boot_ms, words, bytes)| {
                let [least_cm, most_cm, distance_cm] = words;
                let [sensor_id, orientation, quality_percent] = bytes;
                Message::Distance(Distance {
                    time_boot_ms,
                    least_cm,
                    most_cm,
                    distance_cm,
                    sensor_id,
                    orientation,
                    quality_percent,
                })
            }),
        ]
    }

    proptest! {
        #![proptest_config(headrace_sensor::codec::contract::config())]

        #[test]
        fn a_message_comes_back_though_its_last_zeros_are_not_sent(message in any_message()) {
            let bytes = message.to_frame(SENDER).encode().unwrap();
            let got = decode_all(&mut MavlinkCodec::default(), bytes.as_slice());
            prop_assert_eq!(got.len(), 1);
            prop_assert_eq!(Message::of(&got[0]), Some(message));
        }
    }

    #[test]
    fn zeros_at_the_end_are_not_sent() {
        let pressure = Message::Pressure(Pressure {
            message: PressureMessage::Third,
            time_boot_ms: 0x0102,
            absolute_hpa: 0.0,
            temperature_cdegc: 0,
        });
        assert_eq!(pressure.to_frame(SENDER).payload.as_slice(), [2, 1]);
    }
}
