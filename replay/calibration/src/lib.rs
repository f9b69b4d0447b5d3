//! Calibration from a log: mounts, zeros and latencies of sensors, as values for the vehicle file.
//!
//! [`mod@collect`] runs a log through the loop and keeps its readings. Pure estimators process these after the dive: they
//! allocate, and aren't for the loop. Where a log doesn't suffice they return the reason. Derivation: `docs/calibration.md`.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod collect;
mod estimate;
pub mod findings;
pub mod fit;
pub mod heads;
mod material;
pub mod scan;
pub mod still;
pub mod table;
#[cfg(test)]
mod tests;
pub mod timing;
pub mod zero;

pub use estimate::{Estimate, Untold};
pub use material::Material;
