//! Blue Robotics Ping echosounders (`Ping1D`, Ping2): the Ping protocol, a decoder for the loop and an emulated device.
//!
//! The crate converts bytes to values and back without I/O. The port (serial, or the vehicle's UDP bridge) is another
//! layer.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod codec;
pub mod driver;
pub mod emulator;
pub mod plugin;
pub mod probe;
pub mod settings;

pub use plugin::Ping1dKind;
