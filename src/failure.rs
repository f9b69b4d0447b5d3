//! What ends a command, and with which exit code.

use std::path::PathBuf;

use headrace_calibration::collect::CollectError;
use headrace_config::ConfigError;
use headrace_import::ImportError;
use headrace_import::routing::RoutingError;
use headrace_monitor::PluginError;
use headrace_replay::drive::DriveError;
use headrace_replay::log::LogError;
use headrace_replay::playback::PlaybackError;
use headrace_replay::smooth::SmoothError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;

/// Exit code of a command that did all it was asked, on all the data.
pub(crate) const OK: u8 = 0;
/// The command failed, or what was expected differs.
pub(crate) const FAILED: u8 = 1;
/// A file or an argument is wrong.
pub(crate) const USAGE: u8 = 2;
/// The command finished, but data was lost.
pub(crate) const DATA_LOST: u8 = 3;

/// The replay isn't the dive.
pub(crate) const DIVERGED: u8 = 4;

/// Why a command could not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error("reading {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("writing {}: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error(transparent)]
    Config(#[from] ConfigError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Plugin(#[from] PluginError),
    #[error(transparent)]
    Log(#[from] LogError),
    #[error(transparent)]
    Import(#[from] ImportError),
    #[error(transparent)]
    Collect(#[from] CollectError),
    #[error("import: {0}")]
    Routing(#[from] RoutingError),
    #[error("smoothing: {0}")]
    Smooth(#[from] SmoothError),
    #[error(transparent)]
    Drive(#[from] DriveError),
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    #[error("making JSON of the report: {0}")]
    Json(#[from] serde_json::Error),
    #[error("planning: {0}")]
    Plan(#[from] SamplingError),
    #[error("{what}: {source}")]
    System { what: &'static str, source: std::io::Error },
    #[error("{0}")]
    Required(String),
    #[error("{0}")]
    Usage(String),
}

impl Failure {
    /// The exit code that goes with it.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Config(_)
            | Self::Scene(_)
            | Self::Usage(_)
            | Self::Plan(_)
            | Self::Read { .. }
            | Self::Routing(_)
            | Self::Collect(CollectError::Backwards { .. } | CollectError::TooLong { .. }) => USAGE,
            _ => FAILED,
        }
    }
}
