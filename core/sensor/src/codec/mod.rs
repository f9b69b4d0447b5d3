//! The seam between a device's bytes and its values: codecs without I/O, and the contract that each of them passes.
//!
//! A codec is a pure state machine. It is fed bytes in whatever pieces a port delivers and connections out values; it reads
//! no clock, opens nothing, and holds no more than one frame's worth of bytes. Ports are another layer.

mod bytes;
#[cfg(feature = "contract")]
pub mod contract;
mod framed;
mod line_clock;

pub use bytes::{Bytes, TooLong};
pub use framed::{Framed, Framing, Verdict};
pub use line_clock::LineClock;
use serde::{Deserialize, Serialize};

/// What a codec has seen so far. Every byte pushed is in exactly one of: a good frame, `skipped_bytes`, or still held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CodecCounts {
    /// Frames that were whole and valid.
    pub good_frames: u64,
    /// Candidate frames that a start marker announced and that failed: checksum, terminator, length or range.
    pub bad_frames: u64,
    /// Bytes that belong to no good frame.
    pub skipped_bytes: u64,
}

/// Bytes to values and back, sans-I/O.
///
/// Contract, checked by the module `contract` for each implementation: any bytes whatever never panic; the same bytes split
/// anywhere give the same values; garbage before a good frame doesn't lose it; encode then decode is the identity;
/// what is held between pushes is bounded by [`Codec::MAX_FRAME_BYTES`].
pub trait Codec {
    /// One frame's meaning, in the wire's own units.
    type Value: Clone + PartialEq + core::fmt::Debug;

    /// The longest frame that is accepted; also the bound on what is held between two pushes.
    const MAX_FRAME_BYTES: usize;

    /// Whether the transport itself delivers whole messages (CAN frames, HID reports, I2C transactions). Garbage is
    /// then a message of its own and the port calls [`Codec::flush`] after each; on a byte stream garbage may stand
    /// directly before a frame.
    const WHOLE_MESSAGES: bool;

    /// Takes bytes as they came and calls `sink` for each value that they complete, in order.
    ///
    /// Allocates: never.
    fn push(&mut self, bytes: &[u8], sink: &mut dyn FnMut(Self::Value));

    /// Says that the line has been silent longer than a frame may pause, or that a message has ended: a frame begun is
    /// given up, and what it swallowed is looked through again.
    fn flush(&mut self, sink: &mut dyn FnMut(Self::Value));

    /// What has been seen so far.
    fn counts(&self) -> CodecCounts;

    /// Bytes held for a frame that isn't complete.
    fn held_bytes(&self) -> usize;
}
