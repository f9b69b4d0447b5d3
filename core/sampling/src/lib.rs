//! Sampling theory: spacing of samples on the wall, layouts of several heads, and the largest speed for a target.
//!
//! `section` and `spacing` hold the paper's closed forms; `ring` is the general case. `layout` and `schedule` define
//! how several heads turn, `passes` gives the times between their passes, `swing` the effect of the vehicle's rotation.
//! `advice` combines them for the pilot, `plan` for the engineer.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod advice;
pub mod error;
#[cfg(test)]
mod fixtures;
pub mod head;
pub mod head_set;
pub mod interference;
pub mod layout;
pub mod occlusion;
pub mod passes;
pub mod plan;
pub mod ring;
pub mod schedule;
pub mod section;
pub mod spacing;
pub mod strips;
pub mod swing;

pub use error::SamplingError;
