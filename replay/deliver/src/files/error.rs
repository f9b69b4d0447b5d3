//! Errors of the encoders.

use std::fs::{File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Reason why a file could not be encoded.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The stream failed.
    #[error("{what} can't be written or read: {source}")]
    Io {
        /// Contents of the file.
        what: &'static str,
        /// Error that the stream reported.
        source: io::Error,
    },
    /// A value does not fit the format.
    #[error("{what} is {value}; the file holds {least} to {most}")]
    Value {
        /// Name and place of the value.
        what: String,
        /// The value.
        value: f64,
        /// Least value that the file can hold.
        least: f64,
        /// Largest value that the file can hold.
        most: f64,
    },
    /// The contents are inconsistent, or the format's encoder refused them.
    #[error("{what} can't be encoded: {text}")]
    Encoding {
        /// Contents of the file.
        what: &'static str,
        /// Reason why the contents can't be encoded.
        text: String,
    },
}

impl FileError {
    /// Returns a function that adds the contents of the file to a stream's error.
    pub(crate) fn io(what: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self::Io { what, source }
    }

    /// Returns a function that adds the contents of the file to an encoder's error.
    pub(super) fn encoding<E: ToString>(what: &'static str) -> impl Fn(E) -> Self {
        move |error| Self::Encoding { what, text: error.to_string() }
    }
}

/// Reason why a file could not be written, with its path.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct PathError {
    /// Path of the file.
    pub path: PathBuf,
    /// Reason why the file could not be written.
    pub source: FileError,
}

/// Creates or empties the file at `path` and encodes into it. The file can be read as well, which E57 needs.
///
/// Errors: the file can't be created; an error of the encoder.
pub fn encode_to<T>(
    path: &Path,
    encode: impl FnOnce(&mut File) -> Result<T, FileError>,
) -> Result<T, PathError> {
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(path);
    file.map_err(FileError::io("a new file"))
        .and_then(|mut file| encode(&mut file))
        .map_err(|source| PathError { path: path.to_owned(), source })
}
