//! Recording, reading and replaying dive logs.
//!
//! Contains the recorder, the log reader, the driver that feeds a loop from a log or a simulation, and playback. Also
//! contains verification, smoothing and viewer output for a recorded dive.

mod adviser;
pub mod atomic_file;
pub mod clocks;
pub mod drive;
pub mod effect_influence;
pub mod log;
pub mod notes;
pub mod playback;
pub mod player;
pub mod rebuild;
pub mod record;
pub mod regular_file;
pub mod saved_state;
mod simulation_feed;
pub mod smooth;
pub mod snapshot_store;
pub mod threads;
pub mod verify;
pub mod view;

pub use adviser::{SimulationError, simulation, simulation_believing};
pub use simulation_feed::SimulationFeed;
