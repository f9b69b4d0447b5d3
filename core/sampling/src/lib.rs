//! Sampling theory: spacing of samples on the wall, layouts of heads, and the allowed speed.
//!
//! [`section`] and [`spacing`] contain the closed forms of Jorge et al. 2021, [`ring`] the general case by ray
//! casting. [`layout`] and [`schedule`] define how several heads turn, [`passes`] how often they pass a place.
//! [`swing`] adds the effect of the vehicle's own rotation, and [`losses`] the effect of lost returns. [`advice`]
//! combines all effects for the pilot during the dive, [`plan`] for the engineer before the dive.
//!
//! ```
//! use headrace_sampling::head::Turn;
//! use headrace_sampling::section::t_y2_m;
//! use headrace_sampling::spacing::{Spiral, speed_for_target_mps};
//!
//! // Four heads in phase shift, steps of 0.9 degrees, 8 s a turn; a flat floor 3 m below, seen up to 45 degrees.
//! let turn = Turn::new(0.9_f64.to_radians(), 8.0)?;
//! let t_y_m = t_y2_m(3.0, turn.step_rad(), 50)?;
//! let v_mps = speed_for_target_mps(0.5, t_y_m, turn.period_s() / 4.0, turn.ping_period_s()).unwrap();
//! let spiral = Spiral::new(v_mps, turn, 4.0)?;
//! assert!((spiral.t_max_m(t_y_m) - 0.5).abs() < 1e-12);
//! # Ok::<(), headrace_sampling::SamplingError>(())
//! ```

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
pub mod losses;
pub mod margin;
pub mod occlusion;
pub mod passes;
pub mod plan;
pub mod ring;
pub mod schedule;
pub mod section;
pub mod spacing;
pub mod strips;
pub mod swing;
mod swung_passes;
pub mod target;

pub use error::SamplingError;
pub use target::Target;
