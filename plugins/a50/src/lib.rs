//! Water Linked DVL A50 velocity log over TCP: decodes and encodes lines of JSON with velocity over ground.
//!
//! [`report`] parses velocity reports, [`decoder`] makes readings for the loop, [`emulator`] is the device side for
//! simulations and [`plugin`] reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod plugin;
pub mod report;

pub use plugin::A50Kind;

#[cfg(test)]
mod tests;
