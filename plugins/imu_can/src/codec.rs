//! Frames to the messages of one maker's set.

use headrace_core::codec::{Codec, CodecCounts};

use crate::frame::{CanFrame, CanFrameCodec, FRAME_BYTES};
use crate::sets::{MessageError, bosch, j1939, sbg, xsens};

/// A maker's set of messages with what of it can be configured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageSet {
    /// Xsens MTi-600 and kin.
    Xsens(xsens::Ids),
    /// SBG Ellipse and HPINS.
    Sbg,
    /// SAE J1939.
    J1939(j1939::Network),
    /// Bosch MM5.10.
    Bosch,
}

/// A message of any set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Of the Xsens set.
    Xsens(xsens::Message),
    /// Of the SBG set.
    Sbg(sbg::Message),
    /// Of the J1939 set.
    J1939(j1939::Message),
    /// Of the Bosch set.
    Bosch(bosch::Message),
}

impl MessageSet {
    /// Reads a frame; `None` where it is not of this set. Remote and error frames never are.
    ///
    /// Errors: an identifier of the set with a length that it can't have.
    pub fn decode(&self, frame: &CanFrame) -> Result<Option<Message>, MessageError> {
        Ok(match self {
            Self::Xsens(ids) => ids.decode(frame)?.map(Message::Xsens),
            Self::Sbg => sbg::decode(frame)?.map(Message::Sbg),
            Self::J1939(network) => network.decode(frame)?.map(Message::J1939),
            Self::Bosch => bosch::decode(frame)?.map(Message::Bosch),
        })
    }

    /// Writes a message; `None` where it is of another set.
    pub fn encode(&self, message: &Message) -> Option<CanFrame> {
        match (self, message) {
            (Self::Xsens(ids), Message::Xsens(message)) => Some(ids.encode(message)),
            (Self::Sbg, Message::Sbg(message)) => Some(sbg::encode(message)),
            (Self::J1939(network), Message::J1939(message)) => Some(network.encode(message)),
            (Self::Bosch, Message::Bosch(message)) => Some(bosch::encode(message)),
            _ => None,
        }
    }
}

/// Bytes to messages of one set.
///
/// Other devices' frames on the bus, remote frames and error frames are passed over and counted apart; a frame of the
/// set with a wrong length is a bad frame.
#[derive(Debug, Clone)]
pub struct ImuCodec {
    set: MessageSet,
    frames: CanFrameCodec,
    passed_over: u64,
    malformed: u64,
}

impl ImuCodec {
    /// A codec for one set.
    pub fn new(set: MessageSet) -> Self {
        Self { set, frames: CanFrameCodec::default(), passed_over: 0, malformed: 0 }
    }

    /// Good frames that are not of the set.
    pub fn passed_over(&self) -> u64 {
        self.passed_over
    }
}

impl Codec for ImuCodec {
    type Value = Message;

    const MAX_FRAME_BYTES: usize = FRAME_BYTES;
    const WHOLE_MESSAGES: bool = true;

    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Message)) {
        let Self { set, frames, passed_over, malformed } = self;
        frames.push(bytes, &mut |frame| match set.decode(&frame) {
            Ok(Some(message)) => sink(message),
            Ok(None) => *passed_over += 1,
            Err(_) => *malformed += 1,
        });
    }

    fn flush(&mut self, _sink: &mut dyn FnMut(Message)) {
        // A frame has one length: what is incomplete holds no other.
        self.frames.flush(&mut |_| ());
    }

    fn counts(&self) -> CodecCounts {
        let frames = self.frames.counts();
        CodecCounts {
            good_frames: frames.good_frames - self.malformed,
            bad_frames: frames.bad_frames + self.malformed,
            skipped_bytes: frames.skipped_bytes + self.malformed * FRAME_BYTES as u64,
        }
    }

    fn held_bytes(&self) -> usize {
        self.frames.held_bytes()
    }
}

#[cfg(test)]
mod tests;
