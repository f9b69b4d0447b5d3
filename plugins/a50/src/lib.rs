//! Water Linked DVL A50, a velocity log, over TCP: lines of JSON to velocity over ground, and back.
//!
//! [`report`] reads velocity reports out of lines, [`decoder`] makes readings for the loop, [`emulator`] is the device's side
//! for simulations and [`plugin`] reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod plugin;
pub mod report;

pub use plugin::Kind;

#[cfg(test)]
mod tests;
