//! The loop: the state of a dive as entities and resources, the stages of a tick, and the results for outlets.
//!
//! [`App`] is built from a vehicle's devices and from plugins; armed, it is a [`run::Loop`] that turns packets into
//! positions, samples, verdicts and advice. Pure: no I/O, no thread, no clock; time comes in with the packets.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod advice_log;
pub mod alerts;
mod app;
mod arm;
pub mod digest;
pub mod entities;
mod error;
pub mod feed;
mod head_motion;
mod loop_snapshot;
pub mod merge;
pub mod messages;
pub mod outlet;
pub mod pilot_text;
pub mod report;
pub mod resources;
pub mod result_stream;
pub mod ring;
pub mod run;
pub mod stage;
mod stages;
pub mod what_if;

pub use app::{App, Plugin, SourceInfo, SourceSpec};
pub use error::PluginError;
