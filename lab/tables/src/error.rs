//! Errors of making a dive's tables.

use std::path::PathBuf;

use arrow_schema::ArrowError;
use headrace_config::ConfigErrors;
use headrace_monitor::PluginError;
use headrace_replay::drive::DriveError;
use headrace_replay::log::LogError;
use headrace_replay::smooth::SmoothError;

/// A reason why a dive's tables can't be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A parameter is out of its range.
    #[error("{name} = {value}: must be from {from} to {to}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Invalid value of the parameter.
        value: f64,
        /// Least value allowed.
        from: f64,
        /// Greatest value allowed.
        to: f64,
    },
    /// The request names no log file.
    #[error("replaying a dive: no log was named")]
    NoLog,
    /// A vehicle file can't be read.
    #[error("reading {}: {source}", path.display())]
    Read {
        /// The vehicle file that can't be read.
        path: PathBuf,
        /// Error that occurred while reading the file.
        source: std::io::Error,
    },
    /// The log can't be opened or read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// Neither the log nor the parameters have a vehicle file.
    #[error("reading {}: no vehicle file {}; give one as the parameter vehicle", log.display(), match loss {
        Some(loss) => format!("can be read from this damaged log ({loss})"),
        None => "is attached to this log".to_owned(),
    })]
    NoVehicle {
        /// Path of the log.
        log: PathBuf,
        /// The first loss of data in the log, which may be the cause.
        loss: Option<String>,
    },
    /// The vehicle file is invalid.
    #[error(transparent)]
    Vehicle(#[from] ConfigErrors),
    /// The live loop can't be started with the vehicle file's settings.
    #[error(transparent)]
    Arming(#[from] PluginError),
    /// The replay stopped early.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// The replay was stopped before the log's end.
    #[error("replaying {}: stopped before its end", log.display())]
    Stopped {
        /// Path of the log.
        log: PathBuf,
    },
    /// Smoothing was requested for a vehicle without a navigation filter.
    #[error("replaying {}: smooth needs [navigation] way = \"filter\"; the vehicle file has way = \"direct\"", log.display())]
    NoFilter {
        /// Path of the log.
        log: PathBuf,
    },
    /// Smoothing failed.
    #[error("smoothing: {0}")]
    Smooth(#[from] SmoothError),
    /// The columns don't form a valid Arrow table, which is a defect of this library.
    #[error("making table {table}: {source}")]
    Table {
        /// Name of the table.
        table: &'static str,
        /// Error returned by the Arrow library.
        source: ArrowError,
    },
}
