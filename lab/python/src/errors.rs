//! Failures, converted to the exceptions of `headrace._errors`. Each exception has the file and the place in the file.

use std::io;
use std::path::PathBuf;

use headrace_config::ConfigErrors;
use headrace_geometry::tunnel::ProfileError;
use headrace_replay::drive::DriveError;
use headrace_replay::log::LogError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;
use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

mod python {
    pyo3::import_exception!(headrace._errors, ConfigError);
    pyo3::import_exception!(headrace._errors, LogError);
    pyo3::import_exception!(headrace._errors, ReplayError);
    pyo3::import_exception!(headrace._errors, SamplingError);
}

/// A reason why a call fails.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// The log as a whole can't be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The log doesn't have the requested source.
    #[error("reading messages of source {source_id:?} of {file}: the log has no such source; it has {known}")]
    NoSource {
        /// The requested source.
        source_id: String,
        /// Path of the log.
        file: String,
        /// The sources in the log.
        known: String,
    },
    /// The log has no vehicle file.
    #[error("reading the vehicle file attached to {file}: none is attached, or it can't be read")]
    NoVehicleFile {
        /// Path of the log.
        file: String,
    },
    /// The vehicle file has invalid keys.
    #[error(transparent)]
    Config(#[from] ConfigErrors),
    /// A file can't be read.
    #[error("reading {}: {source}", path.display())]
    File {
        /// The file that can't be read.
        path: PathBuf,
        /// Error that occurred while reading the file.
        source: io::Error,
    },
    /// The settings of the vehicle file are inconsistent.
    #[error("planning with {file}: {why}")]
    Vehicle {
        /// The vehicle file.
        file: String,
        /// The inconsistency in the settings.
        why: String,
    },
    /// A dive can't be replayed.
    #[error(transparent)]
    Replay(headrace_tables::Error),
    /// The formulas of the sampling theory have no solution.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The dimensions don't give a profile.
    #[error("making a tunnel's profile: {0}")]
    Profile(#[from] ProfileError),
    /// An argument is out of range.
    #[error("{0}")]
    Argument(String),
}

/// Converts an error of making tables. Errors of the log, the vehicle file or an argument keep their kind.
impl From<headrace_tables::Error> for Failure {
    fn from(error: headrace_tables::Error) -> Self {
        use headrace_tables::Error;
        match error {
            Error::Log(error) | Error::Drive(DriveError::Log(error)) => Self::Log(error),
            Error::Vehicle(errors) => Self::Config(errors),
            Error::Parameter { .. } | Error::NoLog => Self::Argument(error.to_string()),
            other => Self::Replay(other),
        }
    }
}

impl Failure {
    /// Converts an error of computing position errors: the vehicle can't be simulated.
    pub(crate) fn of_scene(file: &str, error: SceneError) -> Self {
        match error {
            SceneError::Config(errors) => Self::Config(errors),
            other => Self::Vehicle { file: file.to_owned(), why: other.to_string() },
        }
    }

    /// The file that the failure concerns, and the place in the file.
    fn place(&self) -> (Option<String>, Option<String>) {
        match self {
            Self::Log(error) => place_in_log(error),
            Self::NoSource { file, .. } | Self::NoVehicleFile { file } | Self::Vehicle { file, .. } => {
                (Some(file.clone()), None)
            }
            Self::Config(errors) => errors.errors().first().map_or((None, None), |first| {
                (Some(first.file.clone()), Some(format!("line {}, {}", first.line, first.key)))
            }),
            Self::Replay(
                headrace_tables::Error::NoVehicle { log, .. }
                | headrace_tables::Error::NoFilter { log }
                | headrace_tables::Error::Stopped { log },
            ) => (Some(log.display().to_string()), None),
            Self::File { path, .. } => (Some(path.display().to_string()), None),
            Self::Replay(_) | Self::Sampling(_) | Self::Profile(_) | Self::Argument(_) => (None, None),
        }
    }
}

/// The log that an error concerns, and the byte position in the log.
fn place_in_log(error: &LogError) -> (Option<String>, Option<String>) {
    match error {
        LogError::Open { path, .. } | LogError::NotAPart { path } => (Some(path.display().to_string()), None),
        LogError::Read { name, offset, .. } => (Some(name.clone()), Some(format!("byte {offset}"))),
        LogError::NotMcap { name, .. } => (Some(name.clone()), Some("byte 0".to_owned())),
        LogError::TooNew { name, .. } => (Some(name.clone()), None),
        LogError::NoLogs { folder } => (Some(folder.display().to_string()), None),
        LogError::OtherDive { other, .. } | LogError::PartTwice { other, .. } => {
            (Some(other.display().to_string()), None)
        }
        _ => (None, None),
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        let (file, place) = failure.place();
        let words = (failure.to_string(), file, place);
        match failure {
            Failure::Log(_) | Failure::NoSource { .. } | Failure::NoVehicleFile { .. } => {
                python::LogError::new_err(words)
            }
            Failure::Config(_) | Failure::File { .. } | Failure::Vehicle { .. } => {
                python::ConfigError::new_err(words)
            }
            Failure::Replay(_) => python::ReplayError::new_err(words),
            Failure::Sampling(_) | Failure::Profile(_) => python::SamplingError::new_err(words),
            Failure::Argument(_) => PyValueError::new_err(words.0),
        }
    }
}
