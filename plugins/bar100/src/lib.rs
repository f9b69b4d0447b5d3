//! Blue Robotics Bar100 depth sensor (Keller 7LD) on I2C: converts transactions to absolute pressure and back.
//!
//! [`codec`] decodes transactions, [`calibration`] converts counts to pressure, and [`decoder`] joins the two for the
//! loop. [`driver`] is the host side of the bus. [`emulator`] is the device side for simulations and rehearsals.
//! [`plugin`] reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod calibration;
pub mod codec;
pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod plugin;

pub use plugin::Bar100Kind;

#[cfg(test)]
mod tests;
