//! Metadata of a log that is one part of a recording.
//!
//! The record `headrace.part` comes before the first message. It has `dive`, `number` (from 1), and the totals of the
//! earlier parts. The totals are `messages` of all channels, `tick` (index of the last tick, or `-`), and
//! `sequence<topic>` (number of each channel's next message).
//!
//! The record `headrace.part.end` comes after the last message. Its totals `messages` and `tick` include this part. Its
//! `follows` is `yes` if the recording continues in the next part, and `no` if the dive has ended.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::format::hex;

/// Name of the metadata record at the start of a part.
pub(super) const PART: &str = "headrace.part";
/// Name of the metadata record at the end of a part.
pub(super) const PART_END: &str = "headrace.part.end";
const DIVE_KEY: &str = "dive";
const NUMBER_KEY: &str = "number";
const MESSAGES_KEY: &str = "messages";
const TICK_KEY: &str = "tick";
const FOLLOWS_KEY: &str = "follows";
const SEQUENCE_PREFIX: &str = "sequence";
/// Text before the part number in a file name.
const NAME_MARK: &str = ".part";
/// Number of hex digits in the identifier of a recording.
const DIVE_DIGITS: usize = 16;

/// Totals of a recording up to a certain point.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Progress {
    /// Number of messages of all channels so far.
    pub messages: u64,
    /// Index of the last tick so far; `None` before the first tick.
    pub tick: Option<u64>,
    /// Number of each topic's next message; empty at the end of a part.
    pub sequences: BTreeMap<String, u32>,
}

/// Metadata at the start of a part of a recording.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PartHead {
    /// Identifier of the recording that the part belongs to, see [`dive_name`].
    pub dive: String,
    /// Number of the part, from 1.
    pub number: u32,
    /// Totals of all earlier parts of the recording.
    pub before: Progress,
}

/// Metadata at the end of a part of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PartEnd {
    /// Totals of the recording up to the end of this part.
    pub after: Progress,
    /// Whether another part follows this part.
    pub follows: bool,
}

/// Position of a log in the recording that it is part of.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Metadata at the start of the part.
    pub head: PartHead,
    /// Metadata at the end of the part; `None` if the log was cut off before it.
    pub end: Option<PartEnd>,
}

/// Returns a unique identifier of a recording: a digest of numbers such as start times.
pub fn dive_name(moment: &[u64]) -> String {
    let mut hasher = Sha256::new();
    for word in moment {
        hasher.update(word.to_le_bytes());
    }
    let mut name = hex(&hasher.finalize());
    name.truncate(DIVE_DIGITS);
    name
}

/// Returns the file name of a part: `dive.part002.mcap` for `dive.mcap`. A folder then lists the parts in order.
pub fn part_path(recording: &Path, number: u32) -> PathBuf {
    let text = |part: Option<&OsStr>| part.unwrap_or_default().to_string_lossy().into_owned();
    let (stem, extension) = (text(recording.file_stem()), text(recording.extension()));
    let dot = if extension.is_empty() { "" } else { "." };
    recording.with_file_name(format!("{stem}{NAME_MARK}{number:03}{dot}{extension}"))
}

/// Returns the recording and the part number that a part's file name states.
pub fn named_part(path: &Path) -> Option<(PathBuf, u32)> {
    let extension = path.extension().map(|e| format!(".{}", e.to_string_lossy())).unwrap_or_default();
    let stem = path.file_stem()?.to_string_lossy().into_owned();
    let (recording, number) = stem.rsplit_once(NAME_MARK)?;
    let number = number.parse().ok().filter(|number| *number > 0)?;
    Some((path.with_file_name(format!("{recording}{extension}")), number))
}

impl Progress {
    fn entries(&self) -> BTreeMap<String, String> {
        let tick = self.tick.map_or_else(|| "-".to_owned(), |tick| tick.to_string());
        let mut entries = BTreeMap::from([
            (MESSAGES_KEY.to_owned(), self.messages.to_string()),
            (TICK_KEY.to_owned(), tick),
        ]);
        let sequences = self.sequences.iter();
        entries
            .extend(sequences.map(|(topic, next)| (format!("{SEQUENCE_PREFIX}{topic}"), next.to_string())));
        entries
    }

    fn read(entries: &BTreeMap<String, String>) -> Option<Self> {
        let sequence = |(key, next): (&String, &String)| {
            Some((key.strip_prefix(SEQUENCE_PREFIX)?.to_owned(), next.parse().ok()?))
        };
        Some(Self {
            messages: entries.get(MESSAGES_KEY)?.parse().ok()?,
            tick: entries.get(TICK_KEY)?.parse().ok(),
            sequences: entries.iter().filter_map(sequence).collect(),
        })
    }

    /// Whether these totals equal `other`, apart from the sequence numbers of topics.
    pub(super) fn meets(&self, other: &Self) -> bool {
        (self.messages, self.tick) == (other.messages, other.tick)
    }
}

impl PartHead {
    pub(super) fn entries(&self) -> BTreeMap<String, String> {
        let mut entries = self.before.entries();
        entries.insert(DIVE_KEY.to_owned(), self.dive.clone());
        entries.insert(NUMBER_KEY.to_owned(), self.number.to_string());
        entries
    }

    pub(super) fn read(entries: &BTreeMap<String, String>) -> Option<Self> {
        Some(Self {
            dive: entries.get(DIVE_KEY)?.clone(),
            number: entries.get(NUMBER_KEY)?.parse().ok().filter(|number| *number > 0)?,
            before: Progress::read(entries)?,
        })
    }
}

impl PartEnd {
    pub(super) fn entries(&self) -> BTreeMap<String, String> {
        let mut entries = self.after.entries();
        let follows = if self.follows { "yes" } else { "no" };
        entries.insert(FOLLOWS_KEY.to_owned(), follows.to_owned());
        entries
    }

    fn read(entries: &BTreeMap<String, String>) -> Option<Self> {
        let follows = entries.get(FOLLOWS_KEY)? == "yes";
        Some(Self { after: Progress::read(entries)?, follows })
    }
}

impl Part {
    /// Returns the number of messages in this part alone, from the totals at its two ends.
    pub(super) fn messages(&self) -> Option<u64> {
        self.end.as_ref()?.after.messages.checked_sub(self.head.before.messages)
    }

    /// Removes the part metadata from a log's metadata, and parses it.
    pub(super) fn take(metadata: &mut BTreeMap<String, String>) -> Option<Self> {
        let (end, head) = (take_record(metadata, PART_END), take_record(metadata, PART));
        Some(Self { head: PartHead::read(&head)?, end: PartEnd::read(&end) })
    }
}

/// Removes the entries of the record `name`, and returns them.
fn take_record(metadata: &mut BTreeMap<String, String>, name: &str) -> BTreeMap<String, String> {
    let prefix = format!("{name}/");
    let (mut taken, mut kept) = (BTreeMap::new(), BTreeMap::new());
    for (key, value) in core::mem::take(metadata) {
        match key.strip_prefix(&prefix) {
            Some(own) => drop(taken.insert(own.to_owned(), value)),
            None => drop(kept.insert(key, value)),
        }
    }
    *metadata = kept;
    taken
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn part_file_names_contain_the_part_number_and_sort_by_it() {
        let recording = Path::new("logs/gate 3.mcap");
        let names: Vec<PathBuf> = [1, 2, 10, 100].map(|number| part_path(recording, number)).into();
        assert_eq!(names.first(), Some(&PathBuf::from("logs/gate 3.part001.mcap")));
        assert!(names.is_sorted());
        for (name, number) in names.iter().zip([1, 2, 10, 100]) {
            assert_eq!(named_part(name), Some((recording.to_owned(), number)));
        }
        for other in ["dive.mcap", "dive.part.mcap", "dive.part000.mcap", "dive.partial.mcap", ""] {
            assert_eq!(named_part(Path::new(other)), None, "{other}");
        }
        assert_eq!(part_path(Path::new("dive"), 7), Path::new("dive.part007"));
    }

    #[test]
    fn part_records_are_read_back_as_written() {
        let before = Progress { messages: 7, tick: None, sequences: [("/raw/a".to_owned(), 3)].into() };
        let head = PartHead { dive: dive_name(&[1, 2]), number: 2, before };
        let after = Progress { messages: 9, tick: Some(4), sequences: BTreeMap::new() };
        let end = PartEnd { after, follows: true };
        let mut metadata = BTreeMap::from([("version".to_owned(), "1".to_owned())]);
        for (name, entries) in [(PART, head.entries()), (PART_END, end.entries())] {
            metadata.extend(entries.into_iter().map(|(key, value)| (format!("{name}/{key}"), value)));
        }
        assert_eq!(Part::take(&mut metadata), Some(Part { head, end: Some(end) }));
        assert_eq!(metadata.len(), 1);
        assert_eq!(Part::take(&mut metadata), None);
        assert_ne!(dive_name(&[1, 2]), dive_name(&[2, 1]));
    }
}
