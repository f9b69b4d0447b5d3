//! Messages exchanged between a `Ping1D` or Ping2 and its host.
//!
//! Source: Ping protocol, common and ping1d messages.

use headrace_sensor::codec::{Bytes, TooLong};

use super::fields::{Field, Payload, record};
use super::frame::{self, Frame, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES};

record! {
    /// Identity of a device.
    DeviceInformation {
        /// 1: Ping echosounder; 2: Ping360.
        device_type: u8,
        /// Revision of the hardware.
        revision: u8,
        /// Firmware version, major.
        firmware_major: u8,
        /// Firmware version, minor.
        firmware_minor: u8,
        /// Firmware version, patch.
        firmware_patch: u8,
        /// Reserved; zero.
        reserved: u8,
    }
}

record! {
    /// Protocol version of a device.
    ProtocolVersion {
        /// Major version.
        major: u8,
        /// Minor version.
        minor: u8,
        /// Patch version.
        patch: u8,
        /// Reserved; zero.
        reserved: u8,
    }
}

record! {
    /// Listening range of a device.
    ScanRange {
        /// Minimum distance, mm.
        start_mm: u32,
        /// Length of the range from the minimum distance, mm; at least 1000.
        length_mm: u32,
    }
}

record! {
    /// Legacy summary of the device's status.
    GeneralInfo {
        /// Firmware version, major.
        firmware_major: u16,
        /// Firmware version, minor.
        firmware_minor: u16,
        /// Supply voltage, mV.
        voltage_mv: u16,
        /// Minimum time between pings, ms.
        ping_interval_ms: u16,
        /// Gain index, 0 to 6.
        gain: u8,
        /// Whether the device chooses range and gain.
        auto: bool,
    }
}

record! {
    /// Distance to the target, with the device's confidence.
    DistanceSimple {
        /// Distance at the device's speed of sound setting, mm.
        distance_mm: u32,
        /// The device's confidence in the distance, 0 to 100 %.
        confidence_percent: u8,
    }
}

record! {
    /// Distance to the target, with the parameters of the ping.
    Distance {
        /// Distance at the device's speed of sound setting, mm.
        distance_mm: u32,
        /// The device's confidence in the distance, 0 to 100 %.
        confidence_percent: u16,
        /// Pulse length, us.
        pulse_us: u16,
        /// Number of pings since the device was switched on.
        ping_number: u32,
        /// Listening range of the ping.
        scan: ScanRange,
        /// Gain index, 0 to 6.
        gain: u32,
    }
}

/// A ping with its echo strengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Profile {
    /// Distance and parameters of the ping.
    pub distance: Distance,
    /// Echo strengths, evenly spaced over the scan; at most as many as fit in a payload.
    pub strengths: Bytes<MAX_STRENGTHS>,
}

/// Length of a profile before its strengths: the distance fields and the count.
const PROFILE_HEADER: usize = Distance::LEN + u16::LEN;

/// Maximum number of echo strengths in a payload.
pub const MAX_STRENGTHS: usize = MAX_PAYLOAD_BYTES - PROFILE_HEADER;

/// Text as sent: any bytes, with or without a terminating zero.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text(pub Bytes<MAX_PAYLOAD_BYTES>);

impl Text {
    /// Readable part of the text: up to the first zero, or the first byte that isn't UTF-8.
    pub fn as_str(&self) -> &str {
        let bytes = self.0.as_slice().split(|byte| *byte == 0).next().unwrap_or_default();
        bytes.utf8_chunks().next().map_or("", |chunk| chunk.valid())
    }
}

impl core::fmt::Debug for Text {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

/// A reason why a message can't be sent, or a frame can't be decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// The payload length doesn't fit the message.
    #[error("ping message {id}: a payload of {len} bytes is wrong for this message")]
    Length {
        /// Message id.
        id: u16,
        /// Length of the payload.
        len: usize,
    },
    /// The stated number of echo strengths doesn't match the payload length.
    #[error("ping profile: {announced} strengths are announced, but {present} are present")]
    Count {
        /// Number of echo strengths as stated in the profile.
        announced: u16,
        /// Number of echo strengths as computed from the payload length.
        present: usize,
    },
    /// The id may not be sent as an unknown message.
    #[error(
        "ping message {id}: cannot be sent as an unknown message: the id is known, or starts the bootloader"
    )]
    NotSendable {
        /// Message id.
        id: u16,
    },
    /// The payload is longer than the maximum.
    #[error("ping message: {0}")]
    TooLong(#[from] TooLong),
}

/// Defines the enum, the ids, and the encoding and decoding of fixed-length messages from one table.
macro_rules! messages {
    ($($(#[$meta:meta])* $name:ident($type:ty) = $constant:ident $id:literal,)*) => {
        /// Message ids.
        pub mod id {
            $($(#[$meta])* pub const $constant: u16 = $id;)*
            /// Refusal of a message.
            pub const NACK: u16 = 2;
            /// Human-readable text from the device.
            pub const ASCII_TEXT: u16 = 3;
            /// Switches the device to its bootloader. Never sent.
            pub const GOTO_BOOTLOADER: u16 = 1100;
            /// A ping with its echo strengths.
            pub const PROFILE: u16 = 1300;
        }

        /// A message, in wire units.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Message {
            $($(#[$meta])* $name($type),)*
            /// Refusal of the message with this id.
            Nack {
                /// Id of the message that the device refuses.
                nacked_id: u16,
                /// Reason of the refusal, as text.
                text: Text,
            },
            /// Human-readable text from the device.
            AsciiText(Text),
            /// A ping with its echo strengths.
            Profile(Profile),
            /// A message with an unknown id, kept as received.
            Other {
                /// Message id.
                id: u16,
                /// Payload.
                payload: Bytes<MAX_PAYLOAD_BYTES>,
            },
        }

        impl Message {
            /// Message id.
            pub fn id(&self) -> u16 {
                match self {
                    $(Self::$name(_) => $id,)*
                    Self::Nack { .. } => id::NACK,
                    Self::AsciiText(_) => id::ASCII_TEXT,
                    Self::Profile(_) => id::PROFILE,
                    Self::Other { id, .. } => *id,
                }
            }

            fn write(&self, to: &mut Payload) -> Result<(), MessageError> {
                match self {
                    $(Self::$name(value) => value.write(to)?,)*
                    Self::Nack { nacked_id, text } => {
                        nacked_id.write(to)?;
                        to.extend(text.0.as_slice())?;
                    }
                    Self::AsciiText(text) => to.extend(text.0.as_slice())?,
                    Self::Profile(profile) => profile.write(to)?,
                    Self::Other { id, payload } => {
                        if *id == id::GOTO_BOOTLOADER || is_known(*id) {
                            return Err(MessageError::NotSendable { id: *id });
                        }
                        to.extend(payload.as_slice())?;
                    }
                }
                Ok(())
            }

            fn read_fixed(id: u16, mut payload: &[u8]) -> Option<Self> {
                match id {
                    $($id => Field::read(&mut payload).map(Self::$name),)*
                    _ => None,
                }
            }
        }

        /// Payload length of a fixed-length message.
        fn fixed_len(id: u16) -> Option<usize> {
            match id {
                $($id => Some(<$type as Field>::LEN),)*
                _ => None,
            }
        }
    };
}

messages! {
    /// Acknowledges the message with this id.
    Ack(u16) = ACK 1,
    /// Identity of the device.
    DeviceInformation(DeviceInformation) = DEVICE_INFORMATION 4,
    /// Protocol version of the device.
    ProtocolVersion(ProtocolVersion) = PROTOCOL_VERSION 5,
    /// Requests the message with this id.
    GeneralRequest(u16) = GENERAL_REQUEST 6,
    /// Sets the device id, for any kind of device.
    SetAnyDeviceId(u8) = SET_ANY_DEVICE_ID 100,
    /// Sets the echosounder's device id, by a message that only echosounders know.
    SetDeviceId(u8) = SET_DEVICE_ID 1000,
    /// Sets the listening range of the device.
    SetRange(ScanRange) = SET_RANGE 1001,
    /// Sets the speed of sound, mm/s.
    SetSpeedOfSound(u32) = SET_SPEED_OF_SOUND 1002,
    /// Enables or disables the device's choice of range and gain.
    SetModeAuto(bool) = SET_MODE_AUTO 1003,
    /// Sets the minimum time between pings, ms.
    SetPingInterval(u16) = SET_PING_INTERVAL 1004,
    /// Sets the gain index, 0 to 6.
    SetGain(u8) = SET_GAIN 1005,
    /// Enables or disables pinging.
    SetPingEnable(bool) = SET_PING_ENABLE 1006,
    /// Supply voltage, mV.
    Voltage5(u16) = VOLTAGE_5 1202,
    /// Speed of sound setting, mm/s.
    SpeedOfSound(u32) = SPEED_OF_SOUND 1203,
    /// Listening range of the device.
    Range(ScanRange) = RANGE 1204,
    /// Whether the device chooses range and gain.
    ModeAuto(bool) = MODE_AUTO 1205,
    /// Minimum time between pings, ms.
    PingInterval(u16) = PING_INTERVAL 1206,
    /// Gain index, 0 to 6.
    Gain(u32) = GAIN 1207,
    /// Pulse length, us.
    TransmitDuration(u16) = TRANSMIT_DURATION 1208,
    /// Legacy summary of the device's status.
    GeneralInfo(GeneralInfo) = GENERAL_INFO 1210,
    /// Distance and confidence.
    DistanceSimple(DistanceSimple) = DISTANCE_SIMPLE 1211,
    /// Distance with the parameters of the ping.
    Distance(Distance) = DISTANCE 1212,
    /// Processor temperature, 0.01 degrees Celsius.
    ProcessorTemperature(u16) = PROCESSOR_TEMPERATURE 1213,
    /// Board temperature, 0.01 degrees Celsius.
    PcbTemperature(u16) = PCB_TEMPERATURE 1214,
    /// Whether pinging is enabled.
    PingEnabled(bool) = PING_ENABLED 1215,
    /// Starts continuous output of the message with this id.
    ContinuousStart(u16) = CONTINUOUS_START 1400,
    /// Stops continuous output of the message with this id.
    ContinuousStop(u16) = CONTINUOUS_STOP 1401,
}

impl Message {
    /// Decodes a frame. Unknown ids are kept as [`Message::Other`].
    ///
    /// Errors: the payload's length doesn't fit the message.
    pub fn decode(frame: &Frame<'_>) -> Result<Self, MessageError> {
        let Frame { id, payload, .. } = *frame;
        let length = MessageError::Length { id, len: payload.len() };
        let mut rest = payload;
        match id {
            id::NACK => {
                let nacked_id = u16::read(&mut rest).ok_or(length)?;
                Ok(Self::Nack { nacked_id, text: Text(Bytes::new(rest)?) })
            }
            id::ASCII_TEXT => Ok(Self::AsciiText(Text(Bytes::new(rest)?))),
            id::PROFILE => Profile::read(rest).map(Self::Profile),
            _ => match fixed_len(id) {
                None => Ok(Self::Other { id, payload: Bytes::new(rest)? }),
                Some(len) if len == rest.len() => Self::read_fixed(id, rest).ok_or(length),
                Some(_) => Err(length),
            },
        }
    }

    /// Encodes the message as a frame from one device id to another. The frame replaces the content of `frame`.
    ///
    /// The caller passes the buffer `frame`, because a buffer for the longest message is large.
    ///
    /// Errors: the payload is longer than [`MAX_PAYLOAD_BYTES`], or the id may not be sent as [`Message::Other`].
    pub fn encode_to(
        &self,
        frame: &mut Bytes<MAX_FRAME_BYTES>,
        source: u8,
        destination: u8,
    ) -> Result<(), MessageError> {
        frame::begin(frame, self.id(), source, destination)?;
        self.write(frame)?;
        Ok(frame::end(frame)?)
    }
}

impl Distance {
    /// Reads distance and ping parameters of a distance or profile frame; `None` for other frames.
    pub fn of(frame: &Frame<'_>) -> Option<Self> {
        let mut payload = frame.payload;
        matches!(frame.id, id::DISTANCE | id::PROFILE).then(|| Self::read(&mut payload)).flatten()
    }
}

impl DistanceSimple {
    /// Reads the distance of a simple distance frame; `None` for other frames.
    pub fn of(frame: &Frame<'_>) -> Option<Self> {
        let mut payload = frame.payload;
        (frame.id == id::DISTANCE_SIMPLE).then(|| Self::read(&mut payload)).flatten()
    }
}

impl Profile {
    fn read(payload: &[u8]) -> Result<Self, MessageError> {
        let length = MessageError::Length { id: id::PROFILE, len: payload.len() };
        let mut rest = payload;
        let distance = Distance::read(&mut rest).ok_or(length)?;
        let announced = u16::read(&mut rest).ok_or(length)?;
        if usize::from(announced) != rest.len() {
            return Err(MessageError::Count { announced, present: rest.len() });
        }
        Ok(Self { distance, strengths: Bytes::new(rest)? })
    }

    fn write(&self, to: &mut Payload) -> Result<(), TooLong> {
        let strengths = self.strengths.as_slice();
        self.distance.write(to)?;
        let too_long = TooLong { len: strengths.len(), max: MAX_STRENGTHS };
        u16::try_from(strengths.len()).map_err(|_| too_long)?.write(to)?;
        to.extend(strengths)
    }
}

fn is_known(id: u16) -> bool {
    matches!(id, id::NACK | id::ASCII_TEXT | id::PROFILE) || fixed_len(id).is_some()
}

/// Whether a message of this id may have this payload length, given the payload bytes present so far.
pub(super) fn may_be(id: u16, len: usize, there: &[u8]) -> bool {
    match id {
        id::NACK => len >= u16::LEN,
        id::PROFILE => {
            let count = there.get(Distance::LEN..).and_then(|mut rest| u16::read(&mut rest));
            len >= PROFILE_HEADER && count.is_none_or(|count| PROFILE_HEADER + usize::from(count) == len)
        }
        _ => fixed_len(id).is_none_or(|fixed| fixed == len),
    }
}
