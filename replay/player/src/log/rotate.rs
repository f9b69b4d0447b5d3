//! When a recording goes on in another part, and the files that are taken for its parts.

use std::path::{Path, PathBuf};

use headrace_geometry::time::DurNs;

use super::part::named_part;
use super::storage::folder_of;

/// When a part of a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Every {
    /// Once its file has that many bytes; the second in which it reaches them is still in it.
    Bytes(u64),
    /// Once its messages span that much of the dive's time.
    Span(DurNs),
}

/// How a recording is split into parts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rotation {
    /// When a part ends; `None` for a single file, which goes on in a second part only after an error.
    pub every: Option<Every>,
    /// Unique identifier of the recording, see [`super::dive_name`].
    pub dive: String,
}

/// An existing file that would be taken for this recording or a part of it.
pub(super) fn in_the_way(recording: &Path) -> std::io::Result<Option<PathBuf>> {
    if recording.exists() {
        return Ok(Some(recording.to_owned()));
    }
    parts_of(recording).map(|parts| parts.into_iter().next())
}

/// The files next to a recording that are named as its parts, in order.
pub(super) fn parts_of(recording: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut parts = Vec::new();
    for entry in std::fs::read_dir(folder_of(recording))? {
        let entry = entry?;
        let path = recording.with_file_name(entry.file_name());
        if let Some((of, number)) = named_part(&path)
            && of == recording
            && !entry.file_type()?.is_dir()
        {
            parts.push((number, path));
        }
    }
    parts.sort();
    Ok(parts.into_iter().map(|(_, path)| path).collect())
}
