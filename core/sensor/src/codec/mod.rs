//! Codecs between a device's bytes and its values, without I/O, and the contract that every codec is tested
//! against.
//!
//! A codec is a pure state machine. It takes bytes in pieces of any size and emits values. It reads no clock, does
//! no I/O, and holds at most one frame of bytes. Ports are a separate layer.

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
