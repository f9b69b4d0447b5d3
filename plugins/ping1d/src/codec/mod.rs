//! The Ping protocol: frames with a weak checksum, and the messages that an echosounder and its host exchange.

mod bytes;
mod fields;
mod frame;
mod message;

use headrace_core::codec::{Codec, CodecCounts, FrameBuffer, Verdict};

pub use bytes::{Bytes, TooLong};
pub use frame::{Frame, MAX_FRAME_BYTES, MAX_PAYLOAD_BYTES};
pub use message::{
    DeviceInformation, Distance, DistanceSimple, GeneralInfo, Message, MessageError, Profile,
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

/// Messages out of a stream of bytes, either way.
///
/// A frame of a known id but with another length than its message has is no frame, as soon as that can be seen: a length
/// that lies then swallows nothing. Only texts and unknown messages have no length to check.
/// Source: Ping protocol, packet format.
#[derive(Debug, Clone, Default)]
pub struct PingCodec {
    buffer: FrameBuffer<MAX_FRAME_BYTES>,
}

impl PingCodec {
    /// Like [`Codec::push`], but hands out valid frames and so copies no payload.
    pub fn push_frames(&mut self, bytes: &[u8], mut sink: impl FnMut(Frame<'_>)) {
        self.buffer.push(bytes, judge, |frame| Frame::parse(frame).into_iter().for_each(&mut sink));
    }

    /// Like [`Codec::flush`], but hands out valid frames.
    pub fn flush_frames(&mut self, mut sink: impl FnMut(Frame<'_>)) {
        self.buffer.flush(judge, |frame| Frame::parse(frame).into_iter().for_each(&mut sink));
    }
}

/// Framing as [`frame`] has it, and lengths as the messages have them.
fn judge(front: &[u8]) -> Verdict {
    match frame::judge(front) {
        verdict @ (Verdict::Need(_) | Verdict::Frame(_)) => match frame::announced(front) {
            Some((id, len, there)) if !message::may_be(id, len, there) => Verdict::Bad,
            _ => verdict,
        },
        verdict => verdict,
    }
}

fn addressed(frame: Frame<'_>) -> Option<Addressed> {
    let message = Message::decode(&frame).ok()?;
    Some(Addressed { source: frame.source, destination: frame.destination, message })
}

impl Codec for PingCodec {
    type Value = Addressed;
    const MAX_FRAME_BYTES: usize = MAX_FRAME_BYTES;
    const WHOLE_MESSAGES: bool = false;

    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Addressed)) {
        self.push_frames(bytes, |frame| addressed(frame).into_iter().for_each(&mut *sink));
    }

    fn flush(&mut self, sink: &mut dyn FnMut(Addressed)) {
        self.flush_frames(|frame| addressed(frame).into_iter().for_each(&mut *sink));
    }

    fn counts(&self) -> CodecCounts {
        self.buffer.counts()
    }

    fn held_bytes(&self) -> usize {
        self.buffer.held_bytes()
    }
}

#[cfg(test)]
mod tests;
