//! Why a dive has no truth.

use headrace_monitor::PluginError;
use headrace_replay::SimulationError;
use headrace_replay::drive::DriveError;

/// Why a dive can't be held against its truth.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TruthError {
    /// A scene can't be simulated.
    #[error("measuring a scene: {0}")]
    Simulation(#[from] SimulationError),
    /// A loop can't be armed.
    #[error("arming a loop to measure: {0}")]
    Arming(#[from] PluginError),
    /// A loop can't be driven.
    #[error("driving a loop to measure: {0}")]
    Driving(#[from] DriveError),
    /// The oracle can't take a truth.
    #[error("taking the true hole of {what}: {why}")]
    Oracle {
        /// Of what.
        what: String,
        /// Why not.
        why: String,
    },
    /// A figure can't be had.
    #[error("measuring {what}: {why}")]
    Figure {
        /// Of what.
        what: String,
        /// Why not.
        why: String,
    },
}
