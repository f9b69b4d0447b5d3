//! The Ping protocol: frames with a weak checksum, and the messages between echosounder and host.

mod fields;
mod frame;
mod message;

use headrace_sensor::codec::{Bytes, Framed, Framing, Verdict};

pub use frame::{Frame, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES};
pub use message::{
    DeviceInformation, Distance, DistanceSimple, GeneralInfo, MAX_STRENGTHS, Message, MessageError, Profile,
    ProtocolVersion, ScanRange, Text, id,
};

/// A message with its sender and its receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Addressed {
    /// Device id of the sender; 0 is the host.
    pub source: u8,
    /// Device id of the receiver; 0 is the host, 255 all devices.
    pub destination: u8,
    /// The message.
    pub message: Message,
}

impl Addressed {
    /// Encodes the message as a frame.
    ///
    /// Errors: the payload is longer than [`MAX_PAYLOAD_BYTES`], or the id may not be sent as [`Message::Other`].
    pub fn encode(&self) -> Result<Bytes<MAX_FRAME_BYTES>, MessageError> {
        let mut frame = Bytes::default();
        self.message.encode_to(&mut frame, self.source, self.destination)?;
        Ok(frame)
    }
}

/// Separates messages in a byte stream, in either direction.
///
/// A frame with a known id is rejected as soon as its length doesn't fit its message. A false length therefore hides
/// none of the following frames. Only texts and unknown messages have no length to check.
/// Source: Ping protocol, packet format.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frames;

/// Decodes messages from a byte stream, in either direction.
pub type PingCodec = Framed<Frames, MAX_FRAME_BYTES>;

impl Framing for Frames {
    type Value = Addressed;

    fn judge(&self, front: &[u8]) -> Verdict {
        match frame::judge(front) {
            verdict @ (Verdict::Need(_) | Verdict::Frame(_)) => match frame::announced(front) {
                Some((id, len, there)) if !message::may_be(id, len, there) => Verdict::Bad,
                _ => verdict,
            },
            verdict => verdict,
        }
    }

    fn read(&self, frame: &[u8]) -> Option<Addressed> {
        let frame = Frame::parse(frame)?;
        let message = Message::decode(&frame).ok()?;
        Some(Addressed { source: frame.source, destination: frame.destination, message })
    }
}

#[cfg(test)]
mod tests;
