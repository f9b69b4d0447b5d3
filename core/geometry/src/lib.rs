//! Units, integer time, frames, mathematics, site constants and tunnel profiles, shared by all other crates.
//!
//! Pure: no I/O, no threads, no clock, no randomness. Transcendental functions come from [`math`] alone.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod frames;
pub mod math;
pub mod site;
pub mod time;
pub mod tunnel;
