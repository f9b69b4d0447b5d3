//! headrace's pure core: geometry, sampling theory, fusion, coverage and the loop.
//!
//! No I/O, no threads, no clock, no randomness: time and bytes come in, results go out, the same on every machine.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod app;
pub mod codec;
pub mod config;
pub mod coverage;
pub mod frames;
pub mod fusion;
pub mod math;
pub mod sampling;
pub mod site;
pub mod snapshot;
pub mod time;
pub mod tunnel;
