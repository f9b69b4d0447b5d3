//! Units that aren't known by name, by a DBC file and a table that says which signals are what.
//!
//! [`mod@file`] reads the text, [`layout`] takes signals out of frames, [`mapping`] says what each of them is, [`keys`] reads
//! that from a vehicle file; [`decoder`] is the loop's and [`emulator`] the device's side.

pub mod decoder;
pub mod emulator;
pub mod file;
pub mod keys;
pub mod layout;
pub mod mapping;

#[cfg(test)]
mod tests;
