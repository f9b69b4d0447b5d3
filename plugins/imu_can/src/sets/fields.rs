//! Checked reads of a frame's identifier and data, shared by all message sets.

use crate::frame::{CanFrame, CanId, FrameKind};

/// A frame with a known identifier but a wrong length.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("reading a message of {len} bytes: {id:?} needs {needed}")]
pub struct MessageError {
    /// Identifier of the frame.
    pub id: CanId,
    /// Length of the frame.
    pub len: usize,
    /// Length that the frame must have.
    pub needed: usize,
}

/// Converts raw values to physical units; `quantum` is the physical value of one raw unit.
pub fn scaled<const N: usize>(raw: [i16; N], quantum: f64) -> [f64; N] {
    raw.map(|raw| f64::from(raw) * quantum)
}

/// Identifier of a data frame; `None` for remote and error frames, which carry no measurement.
pub(super) fn data_id(frame: &CanFrame) -> Option<CanId> {
    match frame.kind() {
        FrameKind::Data(id) => Some(id),
        FrameKind::Remote(_) | FrameKind::Error(_) => None,
    }
}

/// The frame's data as an array of exactly `N` bytes.
pub(super) fn exactly<const N: usize>(id: CanId, data: &[u8]) -> Result<[u8; N], MessageError> {
    data.try_into().map_err(|_| MessageError { id, len: data.len(), needed: N })
}

/// Consecutive two-byte words; missing words are zero.
pub(super) fn words<const N: usize>(data: &[u8], word: impl Fn([u8; 2]) -> i16) -> [i16; N] {
    let (pairs, _) = data.as_chunks::<2>();
    let mut words = [0; N];
    for (place, pair) in words.iter_mut().zip(pairs) {
        *place = word(*pair);
    }
    words
}
