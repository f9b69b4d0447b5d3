//! Units without a preset, described by a DBC file and a table that maps its signals.
//!
//! [`mod@file`] parses the text, [`layout`] extracts signals from frames, [`mapping`] assigns signals to
//! readings and [`keys`] reads the mapping from a vehicle file. [`decoder`] makes readings for the loop, and
//! [`emulator`] is the device side for simulations.

pub mod decoder;
pub mod emulator;
pub mod file;
pub mod keys;
pub mod layout;
pub mod mapping;

#[cfg(test)]
mod tests;
