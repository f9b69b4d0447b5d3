//! Codecs, which convert between a device's bytes and its values, and the contract against which each codec is tested.
//!
//! A codec is a pure state machine without I/O. It takes bytes in pieces of any size and emits values. It reads no
//! clock, and holds at most one frame of bytes. Ports are a separate layer.

mod bytes;
#[cfg(feature = "contract")]
pub mod contract;
mod framed;
mod interface;
mod line_clock;

pub use bytes::{Bytes, TooLong};
pub use framed::{Framed, Framing, Verdict};
pub use interface::{Codec, CodecCounts};
pub use line_clock::LineClock;
