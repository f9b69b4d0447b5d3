//! Inertial units on CAN: decodes and encodes several makers' frames of attitude, turn rate and specific force.
//!
//! [`frame`] is the CAN frame, [`sets`] has the makers' messages, and [`codec`] decodes frames into messages.
//! [`decoder`] makes readings for the loop, and [`emulator`] is the device side for simulations. [`dbc`] does the same
//! for units described by a DBC file. [`plugin`] reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod codec;
pub mod dbc;
pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod frame;
mod noise;
pub mod plugin;
pub mod sets;

pub use plugin::ImuCanKind;

#[cfg(test)]
mod tests;
