//! Decodes CAN frames into the messages of one maker's set.

use headrace_sensor::codec::{Framed, Framing, Verdict};

use crate::frame::{CanFrame, FRAME_BYTES};
use crate::sets::{MessageError, bosch, j1939, sbg, xsens};

/// A maker's message set with its configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MessageSet {
    /// Xsens MTi-600 and related units.
    Xsens(xsens::Ids),
    /// SBG Ellipse and HPINS.
    Sbg,
    /// SAE J1939.
    J1939(j1939::Network),
    /// Bosch MM5.10.
    Bosch,
}

/// A message of any maker's set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Message {
    /// Message of the Xsens set.
    Xsens(xsens::Message),
    /// Message of the SBG set.
    Sbg(sbg::Message),
    /// Message of the J1939 set.
    J1939(j1939::Message),
    /// Message of the Bosch set.
    Bosch(bosch::Message),
}

impl MessageSet {
    /// Decodes a CAN frame; `None` if the frame isn't of this message set. Remote and error frames belong to
    /// no set.
    ///
    /// Errors: the identifier is of this set, but the length is wrong.
    pub fn decode(&self, frame: &CanFrame) -> Result<Option<Message>, MessageError> {
        Ok(match self {
            Self::Xsens(ids) => ids.decode(frame)?.map(Message::Xsens),
            Self::Sbg => sbg::decode(frame)?.map(Message::Sbg),
            Self::J1939(network) => network.decode(frame)?.map(Message::J1939),
            Self::Bosch => bosch::decode(frame)?.map(Message::Bosch),
        })
    }

    /// Encodes a message; `None` if the message is of another set.
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

/// Decodes bytes into messages of one maker's set.
///
/// Other devices' frames, remote frames and error frames are good frames without a message. A frame of the message set
/// with a wrong length is bad. Bytes that hold no classic CAN frame are bad, too.
pub type ImuCodec = Framed<MessageSet, FRAME_BYTES>;

impl Framing for MessageSet {
    type Value = Message;

    const WHOLE_MESSAGES: bool = true;

    fn judge(&self, front: &[u8]) -> Verdict {
        let fits = |frame| self.decode(&frame).is_ok();
        Verdict::on(front, FRAME_BYTES, |frame| can_frame(frame).is_some_and(fits))
    }

    fn read(&self, frame: &[u8]) -> Option<Message> {
        self.decode(&can_frame(frame)?).ok()?
    }
}

/// Parses a CAN frame.
pub(crate) fn can_frame(bytes: &[u8]) -> Option<CanFrame> {
    CanFrame::decode(bytes.first_chunk()?).ok()
}

#[cfg(test)]
mod tests;
