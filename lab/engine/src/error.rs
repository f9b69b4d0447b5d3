//! Errors that stop a campaign. A log that can't be replayed does not stop it: the log becomes a row of `dives`.

use std::path::{Path, PathBuf};

use datafusion::error::DataFusionError;

/// An error that stops a campaign.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The given place of the logs is not a valid folder or URL.
    #[error("opening {place}: {why}")]
    Place {
        /// Text of the invalid folder or URL.
        place: String,
        /// The reason why the folder or URL is invalid.
        why: String,
    },
    /// The place contains no log.
    #[error("looking for logs (*.mcap) in {0}: none found")]
    NoLogs(String),
    /// A store can't be listed or read.
    #[error("reading {what}: {source}")]
    Store {
        /// Folder or file that was listed or read.
        what: String,
        /// Error returned by the store.
        source: object_store::Error,
    },
    /// A file can't be read or written.
    #[error("{doing} {}: {source}", path.display())]
    File {
        /// Attempted action: `reading`, `writing`, ...
        doing: &'static str,
        /// The file that failed.
        path: PathBuf,
        /// Error returned by the operating system.
        source: std::io::Error,
    },
    /// `dives.csv` of the folder is invalid.
    #[error("{file}:{line}: {why}")]
    About {
        /// The file that failed.
        file: String,
        /// Number of the invalid line, from 1.
        line: usize,
        /// The problem with the line, and the allowed values.
        why: String,
    },
    /// A parameter is invalid, or a table can't be made.
    #[error(transparent)]
    Tables(#[from] headrace_tables::Error),
    /// A query can't be answered.
    #[error("{0}")]
    Query(#[from] DataFusionError),
    /// A Parquet file can't be written or read.
    #[error("{doing} {}: {source}", path.display())]
    Parquet {
        /// Attempted action: `reading` or `writing`.
        doing: &'static str,
        /// The file that failed.
        path: PathBuf,
        /// Error returned by the Parquet library.
        source: datafusion::parquet::errors::ParquetError,
    },
    /// An argument is invalid.
    #[error("{0}")]
    Usage(String),
}

/// Returns a function that turns an I/O error into one that names the file.
pub(crate) fn of_file(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { doing, path, source }
}
