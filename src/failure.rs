//! Errors of commands, and their exit codes.

use std::path::{Path, PathBuf};

use crate::calibrate::collect::CollectError;
use headrace_config::{ConfigError, ConfigErrors};
use headrace_dashboard::export::ExportError;
use headrace_deliver::files::PathError;
use headrace_geometry::snapshot::SnapshotError;
use headrace_import::ImportError;
use headrace_import::routing::RoutingError;
use headrace_monitor::PluginError;
use headrace_replay::SimulationError;
use headrace_replay::drive::DriveError;
use headrace_replay::effect_influence::EffectInfluenceError;
use headrace_replay::log::LogError;
use headrace_replay::playback::PlaybackError;
use headrace_replay::smooth::SmoothError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;

/// Exit code: success, with all data.
pub(crate) const OK: u8 = 0;
/// Exit code: the command failed, or the result differs from the expected one.
pub(crate) const FAILED: u8 = 1;
/// Exit code: a file or an argument is wrong.
pub(crate) const USAGE: u8 = 2;
/// Exit code: the command finished, but data was lost.
pub(crate) const DATA_LOST: u8 = 3;
/// Exit code: the replay differs from the dive.
pub(crate) const DIVERGED: u8 = 4;

/// Reason why a command failed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error("reading {}: {source}", path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("writing {}: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("writing {}: {source}", path.display())]
    Unwritable { path: PathBuf, source: std::io::Error },
    #[error(transparent)]
    Config(#[from] ConfigErrors),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
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
    EffectInfluence(#[from] EffectInfluenceError),
    #[error(transparent)]
    Playback(#[from] PlaybackError),
    #[error(transparent)]
    Snapshot(#[from] SnapshotError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Delivery(#[from] PathError),
    #[error("writing the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
    #[error("planning: {0}")]
    Plan(#[from] SamplingError),
    #[error("{what}: {source}")]
    System { what: &'static str, source: std::io::Error },
    #[error(
        "reserving {mib} MiB of address space for the dive: the system refuses it; raise the limit (ulimit -v) or free memory"
    )]
    NoRoom { mib: usize },
    #[error("{0}")]
    Required(String),
    #[error("{0}")]
    Usage(String),
}

impl From<ConfigError> for Failure {
    fn from(error: ConfigError) -> Self {
        Self::Config(error.into())
    }
}

impl Failure {
    /// Text of the error: one line per error of a file, otherwise one line.
    pub(crate) fn lines(&self) -> Vec<String> {
        let words = self.to_string();
        match self {
            Self::Config(_) | Self::Scene(_) | Self::Simulation(_) => {
                words.lines().map(str::to_owned).collect()
            }
            _ => vec![words],
        }
    }

    /// Converts an error from writing a log to `path`. The text names the path.
    pub(crate) fn writing(path: &Path) -> impl Fn(LogError) -> Self {
        move |error| match error {
            LogError::Write { source, .. } => Self::Write { path: path.to_owned(), source },
            error => error.into(),
        }
    }

    /// Exit code for this error.
    pub(crate) fn exit_code(&self) -> u8 {
        match self {
            Self::Config(_)
            | Self::Scene(_)
            | Self::Simulation(_)
            | Self::Usage(_)
            | Self::Plan(_)
            | Self::Read { .. }
            | Self::Unwritable { .. }
            | Self::Routing(_)
            | Self::Collect(CollectError::Backwards { .. } | CollectError::TooLong { .. }) => USAGE,
            Self::Log(error) if is_wrong_file(error) => USAGE,
            // The vehicle file is at fault, except if the schedule can't be built: the schedule doesn't come
            // from the file.
            Self::Plugin(error) if !matches!(error, PluginError::Schedule { .. }) => USAGE,
            _ => FAILED,
        }
    }
}

/// Whether the error is a wrong or unwritable file, rather than a failed medium.
fn is_wrong_file(error: &LogError) -> bool {
    matches!(
        error,
        LogError::Open { .. }
            | LogError::Create { .. }
            | LogError::NotMcap { .. }
            | LogError::TooNew { .. }
            | LogError::NoLogs { .. }
            | LogError::NotAPart { .. }
            | LogError::OtherDive { .. }
            | LogError::PartTwice { .. }
    )
}
