//! Why worth can't be measured.

use crate::adviser::SimulationError;
use crate::drive::DriveError;

/// Why worth can't be measured.
#[derive(Debug, thiserror::Error)]
pub enum WorthError {
    /// A scene can't be simulated, perhaps without one of its effects.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A loop can't be armed for the scene's vehicle.
    #[error("arming the loop that judges the scene: {0}")]
    Loop(#[from] headrace_monitor::PluginError),
    /// A simulated dive doesn't go through the loop.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// Too few seeds for an interval.
    #[error("measuring worth: {0} seeds; an interval needs at least 2")]
    Seeds(usize),
}
