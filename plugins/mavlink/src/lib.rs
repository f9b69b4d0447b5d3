//! MAVLink from a vehicle whose autopilot owns the sensors: its frames to attitude, rates and forces, pressure, distances,
//! and back.
//!
//! [`frame`] tells frames from noise, [`message`] reads those of use, [`decoder`] makes readings for the loop, [`emulator`] is
//! the autopilot's side for simulations, [`plugin`] reads the vehicle file and [`tlog`] the files that ground stations
//! write. Definitions of messages are the mavlink crate's.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod frame;
pub mod message;
pub mod plugin;
pub mod tlog;

pub use mavlink::MavHeader;
/// The messages that ArduPilot speaks: its own and all that it includes.
pub use mavlink::dialects::ardupilotmega as dialect;
pub use plugin::Kind;

#[cfg(test)]
mod tests;
