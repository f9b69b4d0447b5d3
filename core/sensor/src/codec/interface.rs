//! Interface of a codec, and its counters.

use serde::{Deserialize, Serialize};

/// Counters of a codec. Each pushed byte belongs to a good frame, counts as skipped, or is still held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CodecCounts {
    /// Number of complete, valid frames.
    pub good_frames: u64,
    /// Number of frame candidates with a start marker, but a wrong checksum, terminator, length or value.
    pub bad_frames: u64,
    /// Number of bytes that belong to no good frame.
    pub skipped_bytes: u64,
}

/// Converts bytes to values and back, without I/O.
///
/// The module `contract` tests that every codec keeps this contract:
/// - No input panics.
/// - The same bytes split anywhere give the same values.
/// - A good frame after garbage is found.
/// - Decoding reverses encoding.
/// - At most [`Codec::MAX_FRAME_BYTES`] bytes are held between pushes.
pub trait Codec {
    /// Value of one frame, in the protocol's units.
    type Value: Clone + PartialEq + core::fmt::Debug;

    /// Maximum length of a frame, and maximum number of bytes held between two pushes.
    const MAX_FRAME_BYTES: usize;

    /// Whether the transport delivers whole messages (CAN frames, HID reports, I2C transactions).
    ///
    /// If true, the port calls [`Codec::flush`] after each message, and garbage never shares a message with a frame. On
    /// a byte stream, garbage may directly precede a frame.
    const WHOLE_MESSAGES: bool;

    /// Takes received bytes and calls `sink` for each completed value, in order.
    ///
    /// Allocates: never.
    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Self::Value));

    /// Signals the end of a message, or a silence that is longer than any pause within a frame.
    ///
    /// The codec gives up an incomplete frame and searches its bytes for other frames.
    fn flush(&mut self, sink: &mut dyn FnMut(Self::Value));

    /// Counters of frames and bytes so far.
    fn counts(&self) -> CodecCounts;

    /// Number of held bytes. They may begin a frame that is still incomplete.
    fn held_bytes(&self) -> usize;
}
