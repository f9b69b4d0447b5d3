//! Splits a recording into parts, and finds the files of its parts.

use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};

use headrace_geometry::time::DurNs;

use super::error::LogError;
use super::fields::Fields;
use super::format::unseal;
use super::framing::{Found, Item, LogFile, look};
use super::part::{PART, PartHead, named_part};
use crate::atomic_file::folder_of;

/// Condition under which a part of a recording ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Every {
    /// The file reaches this many bytes. The file may exceed this limit by about a second of data.
    Bytes(u64),
    /// The messages of the part reach this span of dive time.
    Span(DurNs),
}

/// How a recording is split into parts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rotation {
    /// Condition under which a part ends; `None` for a single file. After an error, the recording continues in another
    /// part even if `every` is `None`.
    pub every: Option<Every>,
    /// Unique identifier of the recording, see [`super::dive_name`].
    pub dive: String,
}

/// Returns existing files that are this recording, or are named like one of its parts.
///
/// Errors: the folder can't be read.
pub fn in_the_way(recording: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files: Vec<PathBuf> = recording.exists().then(|| recording.to_owned()).into_iter().collect();
    files.extend(parts_of(recording)?);
    Ok(files)
}

/// Returns the files beside a recording that are named like its parts, in order.
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

/// Returns the log files for paths that the user named.
///
/// A path may be a log, a folder of logs, or the given name of a recording in parts. If a log continued in further
/// parts after an error, these parts are included. A file occurs only once, even if it is named twice or is also a
/// part.
///
/// Errors: a folder can't be read, or contains no log.
pub fn files_of(named: &[PathBuf]) -> Result<Vec<PathBuf>, LogError> {
    let mut files: Vec<PathBuf> = Vec::new();
    for path in named {
        let failed = |source| LogError::Open { path: path.to_owned(), source };
        if path.is_dir() {
            let entries = std::fs::read_dir(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
            let entries = entries.map_err(failed)?;
            let mut logs: Vec<_> = entries.into_iter().map(|entry| path.join(entry.file_name())).collect();
            logs.retain(|log| log.extension().is_some_and(|extension| extension == "mcap"));
            logs.sort();
            if logs.is_empty() {
                return Err(LogError::NoLogs { folder: path.to_owned() });
            }
            files.append(&mut logs);
        } else if path.exists() {
            files.push(path.clone());
            files.extend(continuations(path));
        } else {
            // If the recording has no parts either, opening the log reports that it doesn't exist.
            let parts = parts_of(path).unwrap_or_default();
            files.extend(if parts.is_empty() { vec![path.clone()] } else { parts });
        }
    }
    let mut seen = BTreeSet::new();
    files.retain(|file| seen.insert(file.canonicalize().unwrap_or_else(|_| file.clone())));
    Ok(files)
}

/// Returns the later parts of a recording whose first part is at `path`.
fn continuations(path: &Path) -> Vec<PathBuf> {
    let mut parts = parts_of(path).unwrap_or_default();
    if parts.is_empty() {
        return parts;
    }
    let Some(first) = part_head(path).filter(|head| head.number == 1) else { return Vec::new() };
    // A part has no header if the power failed while the part was created. Such a part is kept, because its name shows
    // that it belongs to the recording.
    parts.retain(|part| part_head(part).is_none_or(|head| head.dive == first.dive));
    parts
}

/// Number of records at the beginning of a log that are searched for its part metadata.
const HEAD_RECORDS: usize = 4;
/// Longest record that is read for the part metadata, bytes.
const MAX_HEAD_BYTES: u64 = 1 << 20;

/// Returns the part metadata of a log; `None` if it has none.
pub(super) fn part_head(path: &Path) -> Option<PartHead> {
    let mut file = LogFile::new(File::open(path).ok()?, path.display().to_string()).ok()?;
    let mut at = mcap::MAGIC.len() as u64;
    for _ in 0..HEAD_RECORDS {
        let Found::Record(frame) = look(&mut file, at).ok()? else { return None };
        if matches!(frame.item, Item::Metadata) && frame.end - frame.body <= MAX_HEAD_BYTES {
            let body = file.bytes_at(frame.body, frame.end - frame.body).ok()?;
            let mut fields = Fields::new(&body);
            if fields.text()? == PART {
                let mut entries = fields.map()?;
                return if unseal(PART, &mut entries) { PartHead::read(&entries) } else { None };
            }
        }
        at = frame.end;
    }
    None
}
