//! MAVLink from a vehicle whose autopilot owns the sensors: its frames to attitude, rates and forces, pressure, distances,
//! and back.
//!
//! [`frame`] tells frames from noise ([`checksum`] has each message's own part of that), [`message`] reads those of use,
//! [`decoder`] makes readings for the loop, [`emulator`] is the autopilot's side for simulations, [`plugin`] reads the
//! vehicle file and [`tlog`] the files that ground stations write.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod checksum;
pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod frame;
pub mod message;
pub mod plugin;
pub mod tlog;

pub use plugin::Kind;

#[cfg(test)]
mod tests;
