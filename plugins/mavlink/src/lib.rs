//! MAVLink from a vehicle whose autopilot owns the sensors.
//!
//! Attitude, rates and forces, pressure and distances are decoded and encoded. [`frame`] separates frames from noise,
//! and [`message`] reads the supported messages. [`decoder`] makes readings for the loop, and [`emulator`] is the
//! autopilot side for simulations. [`out`] encodes the program's own messages. [`plugin`] reads the vehicle file, and
//! [`tlog`] reads the log files of ground stations. Message definitions come from the mavlink crate.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod frame;
pub mod message;
pub mod out;
pub mod plugin;
pub mod tlog;

pub use mavlink::MavHeader;
/// ArduPilot's dialect: its own messages and all messages that it includes.
pub use mavlink::dialects::ardupilotmega as dialect;
pub use plugin::MavlinkKind;

#[cfg(test)]
mod tests;
