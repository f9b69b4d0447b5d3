//! Supported MAVLink messages, in wire units and axes: x forward, y right, z down, and north, east, down.
//!
//! [`to_ours`] converts vectors and angles to headrace's axes (x forward, y left, z up), and back.
//! Source: MAVLink common message set (common.xml): ATTITUDE, RAW_IMU, SCALED_IMU to SCALED_IMU3, SCALED_PRESSURE to
//! SCALED_PRESSURE3, DISTANCE_SENSOR.

use mavlink::error::ParserError;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, MessageData};

use crate::frame::{Frame, encode};
use mavlink::dialects::ardupilotmega::{
    ATTITUDE_DATA, DISTANCE_SENSOR_DATA, MavDistanceSensor, MavMessage, RAW_IMU_DATA, SCALED_IMU_DATA,
    SCALED_IMU2_DATA, SCALED_IMU3_DATA, SCALED_PRESSURE_DATA, SCALED_PRESSURE2_DATA, SCALED_PRESSURE3_DATA,
};

/// Acceleration that one raw unit stands for: a thousandth of standard gravity, m/s^2.
pub const MILLI_G_MPS2: f64 = 9.806_65e-3;
/// Turn rate that one raw unit stands for: a milliradian per second, in rad/s.
pub const MILLIRADPS: f64 = 1e-3;
/// Pressure that one wire unit stands for: a hectopascal, in Pa.
pub const HECTOPASCAL: f64 = 100.0;

/// One supported MAVLink message.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// Attitude and turn rate estimated by the autopilot.
    Attitude(ATTITUDE_DATA),
    /// Rates and forces of one inertial unit.
    Imu(Imu),
    /// Pressure measured by one barometer.
    Pressure(Pressure),
    /// One measured distance.
    Distance(Distance),
}

/// Content of RAW_IMU and of SCALED_IMU to SCALED_IMU3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imu {
    /// Type of the message.
    pub message: ImuMessage,
    /// Time since the autopilot's boot, or since 1970. The SCALED_IMU messages have this time in milliseconds.
    pub time_us: u64,
    /// Specific force, milli-g.
    pub force_mg: [i16; 3],
    /// Turn rate, mrad/s.
    pub rate_mradps: [i16; 3],
    /// Unit number. It is above 0 only in RAW_IMU of version 2.
    pub unit: u8,
}

/// Content of SCALED_PRESSURE to SCALED_PRESSURE3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pressure {
    /// Type of the message.
    pub message: PressureMessage,
    /// Time since the autopilot's boot.
    pub time_boot_ms: u32,
    /// Absolute pressure.
    pub absolute_hpa: f32,
    /// Temperature, hundredths of a degree Celsius.
    pub temperature_cdegc: i16,
}

/// Content of DISTANCE_SENSOR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Distance {
    /// Time since the autopilot's boot.
    pub time_boot_ms: u32,
    /// Minimum measurable distance.
    pub least_cm: u16,
    /// Maximum measurable distance.
    pub most_cm: u16,
    /// Measured distance.
    pub distance_cm: u16,
    /// Sensor id.
    pub sensor_id: u8,
    /// Viewing direction, as a MAV_SENSOR_ORIENTATION number.
    pub orientation: u8,
    /// Quality in per cent. 1 means invalid, 0 unknown.
    pub quality_percent: u8,
}

/// Types of messages with rates and forces.
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

/// Types of messages with pressures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PressureMessage {
    /// SCALED_PRESSURE.
    First,
    /// SCALED_PRESSURE2.
    Second,
    /// SCALED_PRESSURE3.
    Third,
}

/// Converts a vector, or roll, pitch and yaw, from the wire's axes to headrace's, or back.
pub fn to_ours([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, -y, -z]
}

impl Message {
    /// Decodes a frame; `None` for unsupported messages.
    pub fn of(frame: &Frame) -> Option<Self> {
        match frame.message_id {
            ATTITUDE_DATA::ID => read::<ATTITUDE_DATA, _>(frame).map(Self::Attitude),
            RAW_IMU_DATA::ID => read::<RAW_IMU_DATA, _>(frame).map(Self::Imu),
            SCALED_IMU_DATA::ID => read::<SCALED_IMU_DATA, _>(frame).map(Self::Imu),
            SCALED_IMU2_DATA::ID => read::<SCALED_IMU2_DATA, _>(frame).map(Self::Imu),
            SCALED_IMU3_DATA::ID => read::<SCALED_IMU3_DATA, _>(frame).map(Self::Imu),
            SCALED_PRESSURE_DATA::ID => read::<SCALED_PRESSURE_DATA, _>(frame).map(Self::Pressure),
            SCALED_PRESSURE2_DATA::ID => read::<SCALED_PRESSURE2_DATA, _>(frame).map(Self::Pressure),
            SCALED_PRESSURE3_DATA::ID => read::<SCALED_PRESSURE3_DATA, _>(frame).map(Self::Pressure),
            Distance::ID => read::<Distance, _>(frame).map(Self::Distance),
            _ => None,
        }
    }

    /// Encodes the message as a version 2 frame. Fields that aren't decoded here are zero.
    pub fn to_frame(&self, header: MavHeader) -> MAVLinkV2MessageRaw {
        match self {
            Self::Attitude(attitude) => encode(header, attitude),
            Self::Imu(imu) => match imu.message {
                ImuMessage::Raw => encode(header, &RAW_IMU_DATA::from(*imu)),
                ImuMessage::Scaled => encode(header, &SCALED_IMU_DATA::from(*imu)),
                ImuMessage::Scaled2 => encode(header, &SCALED_IMU2_DATA::from(*imu)),
                ImuMessage::Scaled3 => encode(header, &SCALED_IMU3_DATA::from(*imu)),
            },
            Self::Pressure(pressure) => match pressure.message {
                PressureMessage::First => encode(header, &SCALED_PRESSURE_DATA::from(*pressure)),
                PressureMessage::Second => encode(header, &SCALED_PRESSURE2_DATA::from(*pressure)),
                PressureMessage::Third => encode(header, &SCALED_PRESSURE3_DATA::from(*pressure)),
            },
            Self::Distance(distance) => encode(header, distance),
        }
    }
}

/// Decodes the fields of a frame. Fields that weren't sent are zero.
fn read<D: MessageData, T: From<D>>(frame: &Frame) -> Option<T> {
    D::deser(frame.version, frame.payload.as_slice()).ok().map(T::from)
}

/// Defines the IMU messages, which have the same fields except for the times and RAW_IMU's unit number.
macro_rules! imu_messages {
    ($($data:ident: $message:ident, $time:ident: $time_type:ty = $unit_us:literal us $(, $unit:ident)?;)*) => {$(
        impl From<$data> for Imu {
            fn from(data: $data) -> Self {
                Self {
                    message: ImuMessage::$message,
                    time_us: u64::from(data.$time) * $unit_us,
                    force_mg: [data.xacc, data.yacc, data.zacc],
                    rate_mradps: [data.xgyro, data.ygyro, data.zgyro],
                    unit: 0 $(+ data.$unit)?,
                }
            }
        }

        impl From<Imu> for $data {
            fn from(imu: Imu) -> Self {
                let ([xacc, yacc, zacc], [xgyro, ygyro, zgyro]) = (imu.force_mg, imu.rate_mradps);
                #[allow(clippy::cast_possible_truncation, reason = "32 bits of milliseconds wrap")]
                let $time = (imu.time_us / $unit_us) as $time_type;
                Self { $time, xacc, yacc, zacc, xgyro, ygyro, zgyro, $($unit: imu.unit,)? ..Self::DEFAULT }
            }
        }
    )*};
}

imu_messages! {
    RAW_IMU_DATA: Raw, time_usec: u64 = 1 us, id;
    SCALED_IMU_DATA: Scaled, time_boot_ms: u32 = 1000 us;
    SCALED_IMU2_DATA: Scaled2, time_boot_ms: u32 = 1000 us;
    SCALED_IMU3_DATA: Scaled3, time_boot_ms: u32 = 1000 us;
}

/// Defines the pressure messages, which have the same fields.
macro_rules! pressure_messages {
    ($($data:ident: $message:ident;)*) => {$(
        impl From<$data> for Pressure {
            fn from($data { time_boot_ms, press_abs, temperature, .. }: $data) -> Self {
                let message = PressureMessage::$message;
                Self { message, time_boot_ms, absolute_hpa: press_abs, temperature_cdegc: temperature }
            }
        }

        impl From<Pressure> for $data {
            fn from(pressure: Pressure) -> Self {
                Self {
                    time_boot_ms: pressure.time_boot_ms,
                    press_abs: pressure.absolute_hpa,
                    temperature: pressure.temperature_cdegc,
                    ..Self::DEFAULT
                }
            }
        }
    )*};
}

pressure_messages! {
    SCALED_PRESSURE_DATA: First;
    SCALED_PRESSURE2_DATA: Second;
    SCALED_PRESSURE3_DATA: Third;
}

/// Payload offsets of a distance's sensor type and orientation.
const TYPE_AT: usize = 10;
const ORIENTATION_AT: usize = 12;

/// The mavlink crate rejects types and orientations that aren't in its definitions. Here they aren't parsed as
/// enumerations: the sensor type isn't used, and the orientation is a plain number in the vehicle file.
impl MessageData for Distance {
    type Message = MavMessage;

    const ID: u32 = DISTANCE_SENSOR_DATA::ID;
    const NAME: &'static str = DISTANCE_SENSOR_DATA::NAME;
    const EXTRA_CRC: u8 = DISTANCE_SENSOR_DATA::EXTRA_CRC;
    const ENCODED_LEN: usize = DISTANCE_SENSOR_DATA::ENCODED_LEN;

    fn ser(&self, version: MavlinkVersion, payload: &mut [u8]) -> usize {
        let data = DISTANCE_SENSOR_DATA {
            time_boot_ms: self.time_boot_ms,
            min_distance: self.least_cm,
            max_distance: self.most_cm,
            current_distance: self.distance_cm,
            mavtype: MavDistanceSensor::MAV_DISTANCE_SENSOR_ULTRASOUND,
            id: self.sensor_id,
            covariance: u8::MAX,
            signal_quality: self.quality_percent,
            ..DISTANCE_SENSOR_DATA::DEFAULT
        };
        // The payload has the variance after the orientation. Its value for "unknown" isn't zero, so the orientation is
        // never truncated, even if it is zero.
        let len = data.ser(version, payload);
        if let Some(orientation) = payload.get_mut(ORIENTATION_AT) {
            *orientation = self.orientation;
        }
        len
    }

    fn deser(version: MavlinkVersion, payload: &[u8]) -> Result<Self, ParserError> {
        let mut numbers = [0; DISTANCE_SENSOR_DATA::ENCODED_LEN];
        numbers.iter_mut().zip(payload).for_each(|(to, from)| *to = *from);
        let orientation = core::mem::take(&mut numbers[ORIENTATION_AT]);
        numbers[TYPE_AT] = 0;
        let data = DISTANCE_SENSOR_DATA::deser(version, &numbers)?;
        Ok(Self {
            time_boot_ms: data.time_boot_ms,
            least_cm: data.min_distance,
            most_cm: data.max_distance,
            distance_cm: data.current_distance,
            sensor_id: data.id,
            orientation,
            quality_percent: data.signal_quality,
        })
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::codec::contract::decode_all;
    use proptest::prelude::*;

    use super::*;
    use crate::frame::MavlinkCodec;
    use crate::tests::{RECORDED_ATTITUDE, RECORDED_PRESSURE, RECORDED_RAW_IMU};

    const SENDER: MavHeader = MavHeader { system_id: 1, component_id: 1, sequence: 9 };

    fn recorded(bytes: &[u8]) -> Message {
        Message::of(&decode_all(&mut MavlinkCodec::default(), bytes)[0]).unwrap()
    }

    #[test]
    fn recorded_messages_match_an_independent_parser() {
        let Message::Attitude(attitude) = recorded(RECORDED_ATTITUDE) else { panic!() };
        assert_eq!(attitude.time_boot_ms, 689_235);
        let near = |got: f32, wanted: f32| assert!((got - wanted).abs() < 1e-6, "{got} is not {wanted}");
        near(attitude.roll, -0.024_300_39);
        near(attitude.pitch, 0.024_687_847);
        near(attitude.yaw, -2.348_0);
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
                |(time_boot_ms, [roll, pitch, yaw], [rollspeed, pitchspeed, yawspeed])| {
                    Message::Attitude(ATTITUDE_DATA {
                        time_boot_ms,
                        roll,
                        pitch,
                        yaw,
                        rollspeed,
                        pitchspeed,
                        yawspeed,
                    })
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
        fn message_with_truncated_zeros_round_trips(message in any_message()) {
            let frame = message.to_frame(SENDER);
            let got = decode_all(&mut MavlinkCodec::default(), frame.raw_bytes());
            prop_assert_eq!(got.len(), 1);
            prop_assert_eq!(Message::of(&got[0]), Some(message));
        }
    }

    #[test]
    fn trailing_zeros_are_not_sent() {
        let pressure = Message::Pressure(Pressure {
            message: PressureMessage::Third,
            time_boot_ms: 0x0102,
            absolute_hpa: 0.0,
            temperature_cdegc: 0,
        });
        assert_eq!(pressure.to_frame(SENDER).payload(), [2, 1]);
    }
}
