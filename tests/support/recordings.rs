//! Recordings made by others.
//!
//! Trimmed copies are in `tests/recordings`. Full-length ones have the same names in a folder outside, which the
//! environment variable `HEADRACE_RECORDINGS` gives as an absolute path.

use std::path::{Path, PathBuf};

use crate::skipped;

/// Path of a trimmed recording.
pub fn trimmed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name)
}

/// Path of a full-length recording; `None`, with a notice, if `HEADRACE_RECORDINGS` isn't set. If it is set, a
/// missing file fails the test that reads it.
pub fn full_length(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HEADRACE_RECORDINGS");
    if folder.is_none() {
        skipped(&format!("{name} at full length: HEADRACE_RECORDINGS names no folder"));
    }
    folder.map(|folder| Path::new(&folder).join(name))
}

/// A recording trimmed and, if available, at full length, each with its expected result.
pub fn both<T>(name: &str, of_trimmed: T, of_full_length: T) -> Vec<(PathBuf, T)> {
    let full_length = full_length(name).map(|path| (path, of_full_length));
    [(trimmed(name), of_trimmed)].into_iter().chain(full_length).collect()
}
