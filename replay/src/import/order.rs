//! Order of time, within what can be held.

use std::collections::BTreeMap;

use super::Entry;

/// Entries within this of the latest one are held back: what comes after them may be older.
const WINDOW_NS: u64 = 2_000_000_000;
/// However close together, no more are held than this.
const MOST_ENTRIES: usize = 1 << 15;
const MOST_BYTES: usize = 1 << 24;

/// Gives entries in order of their stamps, those with the same one as they came.
#[derive(Debug, Default)]
pub(super) struct Order {
    held: BTreeMap<(u64, u64), Entry>,
    bytes: usize,
    count: u64,
    given_ns: u64,
    late: u64,
}

impl Order {
    /// Takes an entry, unless a later one has been given already.
    pub(super) fn push(&mut self, entry: Entry) {
        if entry.stamp_ns < self.given_ns {
            self.late += 1;
            return;
        }
        self.count += 1;
        self.bytes += entry.bytes.len();
        self.held.insert((entry.stamp_ns, self.count), entry);
    }

    /// Whether an entry has to be given before another is taken.
    pub(super) fn is_full(&self) -> bool {
        let ends = self.held.first_key_value().zip(self.held.last_key_value());
        let spans = ends.is_some_and(|((first, _), (last, _))| last.0 - first.0 > WINDOW_NS);
        spans || self.held.len() >= MOST_ENTRIES || self.bytes >= MOST_BYTES
    }

    pub(super) fn pop(&mut self) -> Option<Entry> {
        let (_, entry) = self.held.pop_first()?;
        self.bytes -= entry.bytes.len();
        self.given_ns = entry.stamp_ns;
        Some(entry)
    }

    pub(super) fn first_ns(&self) -> Option<u64> {
        self.held.first_key_value().map(|((stamp_ns, _), _)| *stamp_ns)
    }

    /// Entries that were left out since they came too late.
    pub(super) fn late(&self) -> u64 {
        self.late
    }
}
