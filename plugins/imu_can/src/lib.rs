//! Inertial units on CAN: frames of several makers to attitude, turn rate and specific force, and back.
//!
//! [`frame`] is the CAN frame itself, [`sets`] the makers' messages, [`codec`] joins the two, [`decoder`] makes readings
//! for the loop, [`emulator`] is the device's side for simulations, [`dbc`] the same for units that a DBC file describes,
//! and [`plugin`] reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod codec;
pub mod dbc;
pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod frame;
pub mod plugin;
pub mod sets;

pub use plugin::Kind;

#[cfg(test)]
mod tests;
