//! Frames: `BR`, payload length, message id, source, destination, payload, and a checksum. The checksum is the sum of
//! all preceding bytes, as 16 bits.
//!
//! Source: Ping protocol, packet format. All numbers are little-endian.

use headrace_sensor::codec::{Bytes, TooLong, Verdict};

/// Maximum accepted frame length. The protocol allows 65,545 bytes, but frames of echosounders are far shorter than
/// this maximum.
pub const MAX_FRAME_BYTES: usize = 4096;

/// Maximum accepted payload length.
pub const MAX_PAYLOAD_BYTES: usize = MAX_FRAME_BYTES - HEADER_BYTES - CHECKSUM_BYTES;

const HEADER_BYTES: usize = 8;
const CHECKSUM_BYTES: usize = 2;
const START: [u8; 2] = *b"BR";

/// A frame with a borrowed payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Message id.
    pub id: u16,
    /// Device id of the sender.
    pub source: u8,
    /// Device id of the receiver.
    pub destination: u8,
    /// Payload.
    pub payload: &'a [u8],
}

impl<'a> Frame<'a> {
    /// Parses the frame at the front of `bytes`; `None` unless the frame is complete and its checksum is correct.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        let (header, rest) = bytes.split_first_chunk::<HEADER_BYTES>()?;
        let [b, r, n0, n1, i0, i1, source, destination] = *header;
        let (payload, rest) = rest.split_at_checked(usize::from(u16::from_le_bytes([n0, n1])))?;
        let sum = sum(header).wrapping_add(sum(payload));
        let good = [b, r] == START && rest.first_chunk() == Some(&sum.to_le_bytes());
        good.then_some(Self { id: u16::from_le_bytes([i0, i1]), source, destination, payload })
    }

    /// Encodes the frame.
    ///
    /// Errors: the payload is longer than [`MAX_PAYLOAD_BYTES`].
    pub fn encode(&self) -> Result<Bytes<MAX_FRAME_BYTES>, TooLong> {
        let mut frame = Bytes::default();
        begin(&mut frame, self.id, self.source, self.destination)?;
        frame.extend(self.payload)?;
        end(&mut frame)?;
        Ok(frame)
    }
}

/// Begins a frame; the caller appends its payload.
pub(super) fn begin(
    frame: &mut Bytes<MAX_FRAME_BYTES>,
    id: u16,
    source: u8,
    destination: u8,
) -> Result<(), TooLong> {
    let [i0, i1] = id.to_le_bytes();
    let [b, r] = START;
    frame.clear();
    // The zeros stand for the payload length, which the function `end` sets.
    frame.extend(&[b, r, 0, 0, i0, i1, source, destination])
}

/// Ends a frame whose payload is complete: sets the length and appends the checksum.
pub(super) fn end(frame: &mut Bytes<MAX_FRAME_BYTES>) -> Result<(), TooLong> {
    let len = frame.as_slice().len().saturating_sub(HEADER_BYTES);
    let length = u16::try_from(len).map_err(|_| TooLong { len, max: MAX_PAYLOAD_BYTES })?;
    if let Some(place) = frame.as_mut_slice().get_mut(START.len()..START.len() + size_of::<u16>()) {
        place.copy_from_slice(&length.to_le_bytes());
    }
    let sum = sum(frame.as_slice());
    frame.extend(&sum.to_le_bytes())
}

/// Judges whether `front` is a frame or may become one. The checksum is checked, but not the payload.
pub(super) fn judge(front: &[u8]) -> Verdict {
    if front.iter().zip(START).any(|(byte, wanted)| *byte != wanted) {
        return Verdict::NotAStart;
    }
    let Some((_, payload, _)) = announced(front) else { return Verdict::Need(HEADER_BYTES) };
    let whole = HEADER_BYTES + payload + CHECKSUM_BYTES;
    // The codec itself rejects frames longer than its buffer.
    Verdict::on(front, whole, |frame| Frame::parse(frame).is_some())
}

/// Message id and payload length from the header of an incomplete frame, and the bytes of the payload present
/// so far.
pub(super) fn announced(front: &[u8]) -> Option<(u16, usize, &[u8])> {
    let (&[_, _, n0, n1, i0, i1, _, _], rest) = front.split_first_chunk::<HEADER_BYTES>()?;
    let len = usize::from(u16::from_le_bytes([n0, n1]));
    Some((u16::from_le_bytes([i0, i1]), len, rest.get(..len).unwrap_or(rest)))
}

fn sum(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |sum: u16, byte| sum.wrapping_add(u16::from(*byte)))
}
