//! Puts entries of a foreign log in time order, with bounded memory.

use std::collections::BTreeMap;

use crate::entry::Entry;

/// An entry is held back until another entry's timestamp is later by more than this time, ns, because earlier entries
/// may still follow.
pub(super) const WINDOW_NS: u64 = 2_000_000_000;
/// Maximum number of entries held back for sorting, whatever their timestamps.
const MOST_ENTRIES: usize = 1 << 15;
const MOST_BYTES: usize = 1 << 24;
/// Maximum number of entries held back for formats whose entries may be out of order by more than [`WINDOW_NS`].
const MOST_REACHING: usize = 1 << 18;

/// Sorts entries by their timestamps. Entries with equal timestamps keep their order in the file.
#[derive(Debug)]
pub struct Order {
    window_ns: u64,
    most_entries: usize,
    held: BTreeMap<(u64, u64), Entry>,
    bytes: usize,
    count: u64,
    given_ns: u64,
    late: u64,
}

impl Default for Order {
    fn default() -> Self {
        Self::reaching(WINDOW_NS)
    }
}

impl Order {
    /// Creates an empty order. An entry may come after entries with timestamps that are up to `window_ns` later.
    pub(super) fn reaching(window_ns: u64) -> Self {
        let most_entries = if window_ns > WINDOW_NS { MOST_REACHING } else { MOST_ENTRIES };
        Self { window_ns, most_entries, held: BTreeMap::new(), bytes: 0, count: 0, given_ns: 0, late: 0 }
    }

    /// Adds an entry. If an entry with a later timestamp has already been taken out, the new entry is dropped and
    /// counted.
    pub(super) fn push(&mut self, entry: Entry) {
        if entry.stamp_ns < self.given_ns {
            self.late += 1;
            return;
        }
        self.count += 1;
        self.bytes += entry.bytes.len();
        self.held.insert((entry.stamp_ns, self.count), entry);
    }

    /// Whether an entry must be taken out before another entry is added.
    pub(super) fn is_full(&self) -> bool {
        let ends = self.held.first_key_value().zip(self.held.last_key_value());
        let spans = ends.is_some_and(|((first, _), (last, _))| last.0 - first.0 > self.window_ns);
        spans || self.held.len() >= self.most_entries || self.bytes >= MOST_BYTES
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

    /// Returns the number of entries that were dropped because they came too late.
    pub(super) fn late(&self) -> u64 {
        self.late
    }
}
