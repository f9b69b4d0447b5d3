//! Why a campaign can't go on. A log that can't be replayed is no such reason: it is a row of `dives`.

use std::path::{Path, PathBuf};

use datafusion::error::DataFusionError;

/// Why a campaign can't go on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The folder or URL isn't one.
    #[error("opening {place}: {why}")]
    Place {
        /// As given.
        place: String,
        /// Why not.
        why: String,
    },
    /// There is no log in it.
    #[error("looking for logs (*.mcap) in {0}: there are none")]
    NoLogs(String),
    /// A store can't be listed or read.
    #[error("reading {what}: {source}")]
    Store {
        /// What of it.
        what: String,
        /// What the store says.
        source: object_store::Error,
    },
    /// A file can't be read or written.
    #[error("{doing} {}: {source}", path.display())]
    File {
        /// `reading`, `writing`, ...
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// `dives.csv` of the folder is wrong.
    #[error("{file}:{line}: {why}")]
    About {
        /// The file.
        file: String,
        /// The line, from 1.
        line: usize,
        /// What is wrong, and what is allowed.
        why: String,
    },
    /// A parameter is wrong, or a table can't be made.
    #[error(transparent)]
    Tables(#[from] headrace_tables::Error),
    /// A question can't be answered.
    #[error("{0}")]
    Query(#[from] DataFusionError),
    /// A Parquet file can't be written or read.
    #[error("{doing} {}: {source}", path.display())]
    Parquet {
        /// `reading` or `writing`.
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// What Parquet says.
        source: datafusion::parquet::errors::ParquetError,
    },
    /// An argument is wrong.
    #[error("{0}")]
    Usage(String),
}

/// Turns an I/O error into one that names the file.
pub(crate) fn of_file(doing: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Error {
    let path = path.to_owned();
    move |source| Error::File { doing, path, source }
}
