//! Recordings made by others.
//!
//! Trimmed copies are in `tests/recordings`. Full-length recordings have the same names in another folder. The
//! environment variable `HEADRACE_RECORDINGS` gives the absolute path of that folder.

use std::path::{Path, PathBuf};

use crate::skip_notice::skipped;

/// Path of a trimmed recording.
pub fn trimmed(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../recordings").join(name)
}

/// Path of a full-length recording; `None`, with a notice, if `HEADRACE_RECORDINGS` isn't set.
///
/// If the variable is set but the file is missing, the test that reads the file fails.
pub fn full_length(name: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("HEADRACE_RECORDINGS");
    if folder.is_none() {
        skipped(&format!("{name} at full length: HEADRACE_RECORDINGS names no folder"));
    }
    folder.map(|folder| Path::new(&folder).join(name))
}

/// A trimmed recording and, if available, the full-length one, each with its expected result.
pub fn both<T>(name: &str, of_trimmed: T, of_full_length: T) -> Vec<(PathBuf, T)> {
    let full_length = full_length(name).map(|path| (path, of_full_length));
    [(trimmed(name), of_trimmed)].into_iter().chain(full_length).collect()
}
