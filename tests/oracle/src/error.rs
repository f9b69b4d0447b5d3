//! Errors of a comparison with the truth.

use headrace_monitor::PluginError;
use headrace_replay::SimulationError;
use headrace_replay::drive::DriveError;

/// Reason why a dive can't be compared with its truth.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TruthError {
    /// The scene can't be simulated.
    #[error("measuring a scene: {0}")]
    Simulation(#[from] SimulationError),
    /// The loop can't be armed.
    #[error("arming a loop to measure: {0}")]
    Arming(#[from] PluginError),
    /// The loop can't be driven.
    #[error("driving a loop to measure: {0}")]
    Driving(#[from] DriveError),
    /// The oracle rejects the truth that the simulator gives.
    #[error("taking the true hole of {what}: {why}")]
    Oracle {
        /// Part of the truth that is rejected.
        what: String,
        /// Reason for the rejection.
        why: String,
    },
    /// A figure of the comparison can't be computed.
    #[error("measuring {what}: {why}")]
    Figure {
        /// Name of the figure.
        what: String,
        /// Reason why the figure can't be computed.
        why: String,
    },
}
