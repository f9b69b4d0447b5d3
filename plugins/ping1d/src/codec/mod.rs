//! The Ping protocol: frames with a weak checksum, and the messages that an echosounder and its host exchange.

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
    /// Device id of the receiver; 0 is the host, 255 everyone.
    pub destination: u8,
    /// What is said.
    pub message: Message,
}

impl Addressed {
    /// The message as a frame.
    ///
    /// Errors: a payload beyond [`MAX_PAYLOAD_BYTES`], or an id that may not be sent as [`Message::Other`].
    pub fn encode(&self) -> Result<Bytes<MAX_FRAME_BYTES>, MessageError> {
        let payload = self.message.payload()?;
        let frame = Frame {
            id: self.message.id(),
            source: self.source,
            destination: self.destination,
            payload: payload.as_slice(),
        };
        Ok(frame.encode()?)
    }
}

/// How frames stand in a stream of bytes, either way.
///
/// A frame of a known id but with another length than its message has is no frame, as soon as that can be seen: a length
/// that lies then swallows nothing. Only texts and unknown messages have no length to check.
/// Source: Ping protocol, packet format.
#[derive(Debug, Clone, Copy, Default)]
pub struct Frames;

/// Messages out of a stream of bytes, either way.
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
