//! Imagenex 881L and 881A profiling heads: switch commands, returns, a decoder for the loop and an emulated head.
//!
//! The crate converts bytes to values and back without I/O. The port (TCP for the 881L, RS-485 for the 881A) is another
//! layer.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod codec;
pub mod driver;
pub mod emulator;
pub mod homing;
pub mod logfile;
pub mod plugin;
pub mod probe;
pub mod program;
pub mod settings;
pub mod stepping;

pub use plugin::Imagenex881Kind;
