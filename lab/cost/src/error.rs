//! Why a trade can't be measured.

use headrace_config::ConfigErrors;
use headrace_oracle::TruthError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;

/// Why a trade can't be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CostError {
    /// A scene is wrong.
    #[error("measuring a scene: {0}")]
    Scene(#[from] SceneError),
    /// A vehicle file is wrong.
    #[error("measuring a vehicle: {0}")]
    Vehicle(#[from] ConfigErrors),
    /// A plan can't be made.
    #[error("planning a survey to price: {0}")]
    Planning(#[from] SamplingError),
    /// A dive can't be held against its truth.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// A file that comes with the program isn't there.
    #[error("reading {name:?}: no such file comes with the program; it has {known}")]
    NoFile {
        /// Its name.
        name: String,
        /// Those that do.
        known: String,
    },
    /// A figure that a trade needs can't be had.
    #[error("measuring {what}: {why}")]
    Figure {
        /// Of what.
        what: String,
        /// Why not.
        why: String,
    },
}
