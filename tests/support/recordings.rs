//! Recordings of others: trimmed ones in `tests/recordings`, and the same at full length where the
//! environment variable `HEADRACE_RECORDINGS` names a folder (by its absolute path) that has them under the same names.

use std::path::{Path, PathBuf};

use crate::skipped;

/// A trimmed recording.
pub fn trimmed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name)
}

/// A recording at full length; `None`, and said to be skipped, where `HEADRACE_RECORDINGS` isn't set. Where it is set, the
/// file must be there, or whoever reads it fails.
pub fn full_length(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HEADRACE_RECORDINGS");
    if folder.is_none() {
        skipped(&format!("{name} at full length: HEADRACE_RECORDINGS names no folder"));
    }
    folder.map(|folder| Path::new(&folder).join(name))
}

/// A recording trimmed and, where it can be had, at full length, each with what is expected of it.
pub fn both<T>(name: &str, of_trimmed: T, of_full_length: T) -> Vec<(PathBuf, T)> {
    let full_length = full_length(name).map(|path| (path, of_full_length));
    [(trimmed(name), of_trimmed)].into_iter().chain(full_length).collect()
}
