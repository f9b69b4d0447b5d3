//! What frames say: the messages that a `Ping1D` or Ping2 and its host exchange.
//!
//! Source: Ping protocol, common and ping1d messages.

use headrace_sensor::codec::{Bytes, TooLong};

use super::fields::{Field, Payload, record};
use super::{Frame, MAX_PAYLOAD_BYTES};

record! {
    /// What a device is.
    DeviceInformation {
        /// 1: Ping echosounder; 2: Ping360.
        device_type: u8,
        /// Revision of the hardware.
        revision: u8,
        /// Firmware, major.
        firmware_major: u8,
        /// Firmware, minor.
        firmware_minor: u8,
        /// Firmware, patch.
        firmware_patch: u8,
        /// Zero.
        reserved: u8,
    }
}

record! {
    /// Version of the protocol that a device speaks.
    ProtocolVersion {
        /// Major.
        major: u8,
        /// Minor.
        minor: u8,
        /// Patch.
        patch: u8,
        /// Zero.
        reserved: u8,
    }
}

record! {
    /// Where a device listens.
    ScanRange {
        /// Nearest distance, mm.
        start_mm: u32,
        /// From there on, mm; at least 1000.
        length_mm: u32,
    }
}

record! {
    /// An older summary of a device's state.
    GeneralInfo {
        /// Firmware, major.
        firmware_major: u16,
        /// Firmware, minor.
        firmware_minor: u16,
        /// Supply, mV.
        voltage_mv: u16,
        /// Least time between pings, ms.
        ping_interval_ms: u16,
        /// Index of the gain, 0 to 6.
        gain: u8,
        /// Whether the device chooses range and gain.
        auto: bool,
    }
}

record! {
    /// Distance to the target, and how sure of it the device is.
    DistanceSimple {
        /// At the speed of sound that the device is set to, mm.
        distance_mm: u32,
        /// 0 to 100.
        confidence_percent: u8,
    }
}

record! {
    /// Distance to the target with the ping that gave it.
    Distance {
        /// At the speed of sound that the device is set to, mm.
        distance_mm: u32,
        /// 0 to 100.
        confidence_percent: u16,
        /// Length of the pulse, us.
        pulse_us: u16,
        /// Pings since the device was switched on.
        ping_number: u32,
        /// Where the device listened.
        scan: ScanRange,
        /// Index of the gain, 0 to 6.
        gain: u32,
    }
}

/// A ping with its echo.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Profile {
    /// The ping.
    pub distance: Distance,
    /// Strengths, evenly spread over the scan; as many as a payload leaves room for.
    pub strengths: Bytes<MAX_STRENGTHS>,
}

/// Length of a profile before its strengths: the ping, and their number.
const PROFILE_HEADER: usize = Distance::LEN + u16::LEN;

/// The most strengths that a payload has room for.
pub const MAX_STRENGTHS: usize = MAX_PAYLOAD_BYTES - PROFILE_HEADER;

/// Text as a device sends it: any bytes, with or without a zero at its end.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Text(pub Bytes<MAX_PAYLOAD_BYTES>);

impl Text {
    /// What can be read of it: up to the first zero, or the first byte that isn't UTF-8.
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

/// Why a message can't be sent, or why a frame is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// A payload that its message doesn't have.
    #[error("ping message {id}: payload of {len} bytes doesn't fit it")]
    Length {
        /// Message id.
        id: u16,
        /// Length of the payload.
        len: usize,
    },
    /// A profile whose count of strengths lies.
    #[error("ping profile: {announced} strengths are announced and {present} are there")]
    Count {
        /// By the count.
        announced: u16,
        /// By the payload's length.
        present: usize,
    },
    /// An id under which no unknown message may be sent.
    #[error(
        "ping message {id}: can't be sent as unknown; it has a meaning of its own, or starts the bootloader"
    )]
    NotSendable {
        /// Message id.
        id: u16,
    },
    /// A payload beyond the cap.
    #[error("ping message: {0}")]
    TooLong(#[from] TooLong),
}

/// The enum, the ids, and both directions of the messages of fixed length, from one table.
macro_rules! messages {
    ($($(#[$meta:meta])* $name:ident($type:ty) = $constant:ident $id:literal,)*) => {
        /// Message ids.
        pub mod id {
            $($(#[$meta])* pub const $constant: u16 = $id;)*
            /// Refusal of a message.
            pub const NACK: u16 = 2;
            /// Text for people.
            pub const ASCII_TEXT: u16 = 3;
            /// Makes the device wait for new firmware. Never sent.
            pub const GOTO_BOOTLOADER: u16 = 1100;
            /// A ping with its echo.
            pub const PROFILE: u16 = 1300;
        }

        /// A message. Numbers are in the wire's own units.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Message {
            $($(#[$meta])* $name($type),)*
            /// Refusal of the message of that id.
            Nack {
                /// Id of the message that was refused.
                nacked_id: u16,
                /// Why.
                text: Text,
            },
            /// Text for people.
            AsciiText(Text),
            /// A ping with its echo.
            Profile(Profile),
            /// A message of another id, kept as it came.
            Other {
                /// Message id.
                id: u16,
                /// Payload.
                payload: Bytes<MAX_PAYLOAD_BYTES>,
            },
        }

        impl Message {
            /// Its id.
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

        /// Payload length of the messages that have but one.
        fn fixed_len(id: u16) -> Option<usize> {
            match id {
                $($id => Some(<$type as Field>::LEN),)*
                _ => None,
            }
        }
    };
}

messages! {
    /// Receipt of the message of that id.
    Ack(u16) = ACK 1,
    /// What the device is.
    DeviceInformation(DeviceInformation) = DEVICE_INFORMATION 4,
    /// Version of the protocol that the device speaks.
    ProtocolVersion(ProtocolVersion) = PROTOCOL_VERSION 5,
    /// Asks for the message of that id.
    GeneralRequest(u16) = GENERAL_REQUEST 6,
    /// Gives the device an id, as any kind of device takes it.
    SetAnyDeviceId(u8) = SET_ANY_DEVICE_ID 100,
    /// Gives the echosounder an id.
    SetDeviceId(u8) = SET_DEVICE_ID 1000,
    /// Sets where to listen.
    SetRange(ScanRange) = SET_RANGE 1001,
    /// Sets the speed of sound, mm/s.
    SetSpeedOfSound(u32) = SET_SPEED_OF_SOUND 1002,
    /// Lets the device choose range and gain, or not.
    SetModeAuto(bool) = SET_MODE_AUTO 1003,
    /// Sets the least time between pings, ms.
    SetPingInterval(u16) = SET_PING_INTERVAL 1004,
    /// Sets the gain by its index, 0 to 6.
    SetGain(u8) = SET_GAIN 1005,
    /// Switches pinging on or off.
    SetPingEnable(bool) = SET_PING_ENABLE 1006,
    /// Supply, mV.
    Voltage5(u16) = VOLTAGE_5 1202,
    /// Speed of sound that the device computes with, mm/s.
    SpeedOfSound(u32) = SPEED_OF_SOUND 1203,
    /// Where the device listens.
    Range(ScanRange) = RANGE 1204,
    /// Whether the device chooses range and gain.
    ModeAuto(bool) = MODE_AUTO 1205,
    /// Least time between pings, ms.
    PingInterval(u16) = PING_INTERVAL 1206,
    /// Index of the gain, 0 to 6.
    Gain(u32) = GAIN 1207,
    /// Length of the pulse, us.
    TransmitDuration(u16) = TRANSMIT_DURATION 1208,
    /// An older summary of the device's state.
    GeneralInfo(GeneralInfo) = GENERAL_INFO 1210,
    /// Distance and confidence.
    DistanceSimple(DistanceSimple) = DISTANCE_SIMPLE 1211,
    /// Distance with the ping that gave it.
    Distance(Distance) = DISTANCE 1212,
    /// Temperature of the processor, 0.01 degrees Celsius.
    ProcessorTemperature(u16) = PROCESSOR_TEMPERATURE 1213,
    /// Temperature of the board, 0.01 degrees Celsius.
    PcbTemperature(u16) = PCB_TEMPERATURE 1214,
    /// Whether the device pings.
    PingEnabled(bool) = PING_ENABLED 1215,
    /// Asks for the message of that id again and again.
    ContinuousStart(u16) = CONTINUOUS_START 1400,
    /// Ends that.
    ContinuousStop(u16) = CONTINUOUS_STOP 1401,
}

impl Message {
    /// What a frame says. Unknown ids are kept as [`Message::Other`].
    ///
    /// Errors: a payload that the id's message doesn't have.
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

    /// Its payload.
    ///
    /// Errors: too long, or an [`Message::Other`] whose id isn't free for that.
    pub fn payload(&self) -> Result<Bytes<MAX_PAYLOAD_BYTES>, MessageError> {
        let mut payload = Payload::default();
        self.write(&mut payload)?;
        Ok(payload)
    }
}

impl Distance {
    /// The ping that a distance or profile message tells of.
    pub fn of(frame: &Frame<'_>) -> Option<Self> {
        let mut payload = frame.payload;
        matches!(frame.id, id::DISTANCE | id::PROFILE).then(|| Self::read(&mut payload)).flatten()
    }
}

impl DistanceSimple {
    /// What a message of simple distance tells.
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

/// Whether a message of that id may have a payload of that length, which begins with what is there of it.
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
