//! Errors of measuring a trade (comparison of error and cost).

use headrace_config::ConfigErrors;
use headrace_oracle::TruthError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;

/// A reason why a trade can't be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CostError {
    /// A scene is invalid.
    #[error("measuring a scene: {0}")]
    Scene(#[from] SceneError),
    /// A vehicle file is invalid.
    #[error("measuring a vehicle: {0}")]
    Vehicle(#[from] ConfigErrors),
    /// A plan can't be made.
    #[error("planning a survey to price: {0}")]
    Planning(#[from] SamplingError),
    /// A dive can't be compared with its truth.
    #[error(transparent)]
    Truth(#[from] TruthError),
    /// The program has no built-in file of the requested name.
    #[error("reading {name:?}: the program contains no such file; expected one of {known}")]
    NoFile {
        /// Name of the requested file.
        name: String,
        /// Names of the built-in files.
        known: String,
    },
    /// A figure that a trade needs isn't available.
    #[error("measuring {what}: {why}")]
    Figure {
        /// Name of the missing figure.
        what: String,
        /// The reason why the figure isn't available.
        why: String,
    },
}
