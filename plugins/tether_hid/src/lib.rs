//! Counters of cable paid out: configurable USB HID reports, and the text lines of MTNW LCI-90 monitors.
//!
//! [`report`] and [`mod@line`] convert bytes to values and back. [`tracker`] follows a counter that wraps, jumps or
//! restarts. [`decoder`] makes readings for the loop, [`emulator`] is the device side for simulations, and [`plugin`]
//! reads the vehicle file.

#![cfg_attr(not(test), warn(clippy::indexing_slicing))]

pub mod decoder;
pub mod driver;
pub mod emulator;
pub mod line;
pub mod plugin;
pub mod report;
pub mod tracker;

pub use plugin::TetherHidKind;

#[cfg(test)]
mod tests;
