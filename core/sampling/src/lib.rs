//! Sampling theory: the spacing of samples on the wall, layouts of several heads, and how fast one may go.
//!
//! `section` and `spacing` have the paper's closed forms; `ring` is the general case beside them. `layout` and `schedule`
//! say what several heads do, `passes` what comes of it, `swing` how
//! the vehicle's own turning adds to that. `advice` puts them together for the pilot, `plan` for the engineer.

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
