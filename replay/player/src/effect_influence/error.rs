//! Errors of measuring the influence of effects.

use crate::adviser::SimulationError;
use crate::drive::DriveError;

/// Reason why the effects of a scene can't be measured.
#[derive(Debug, thiserror::Error)]
pub enum EffectInfluenceError {
    /// A scene can't be simulated, possibly because an effect was left out.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// A loop can't be armed for the scene's vehicle.
    #[error("arming the loop that judges the scene: {0}")]
    Loop(#[from] headrace_monitor::PluginError),
    /// The loop can't process a simulated dive.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// There are too few seeds for a confidence interval.
    #[error("measuring worth: {0} seeds; an interval needs at least 2")]
    Seeds(usize),
}
