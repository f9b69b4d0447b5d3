//! What a log tells of how sensors sit, where they count from and how late they are: values for the vehicle file.
//!
//! [`mod@collect`] runs a log through the loop and keeps its readings. Pure estimators go over these after the dive: they
//! allocate, and aren't for the loop. Where a log can't tell something they say why. `docs/calibration.md` derives them.

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
