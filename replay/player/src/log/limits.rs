//! Limits on the content read from a log, whatever its lengths and counts claim.
//!
//! Each limit is several times the value found in logs of dives and robots. Together they keep a reader below about 130
//! MiB. Content beyond a limit is reported as a loss that states the limit.
//!
//! `docs/reference/limits.md` has the same table with the messages.

use headrace_geometry::time::MonoNs;

/// Latest timestamp, in 2262 if timestamps count from 1970. The sum of a time and a duration then still fits into 64
/// bits.
pub(super) const LATEST: MonoNs = MonoNs(i64::MAX as u64);
/// Maximum number of bytes of a record outside chunks, and of all records of a chunk with [`RECORD_COST`] added to each.
pub(super) const MAX_UNPACKED_BYTES: u64 = 32 << 20;
/// Memory of a message in addition to its bytes.
pub(super) const RECORD_COST: u64 = 64;
/// Largest ratio of the unpacked length of all chunks up to a place to the place's offset in the file.
///
/// The ratio is that of content that repeats itself every few hundred bytes. Runs of zeros reach about 30,000.
pub(super) const MAX_UNPACKED_RATIO: u64 = 512;
/// Unpacked bytes allowed in addition, so that short logs may be highly compressed.
const UNPACKED_ANYWAY: u64 = 64 << 20;
/// Largest window of a chunk packed by zstd, as a power of two: 16 MiB, more than levels up to 19 use.
pub(super) const MAX_WINDOW_LOG: u32 = 24;
/// Maximum number of bytes of overlapping pieces held in memory for merging; may be exceeded by one piece.
pub(super) const MAX_HELD_BYTES: usize = 32 << 20;
/// Maximum number of pieces: chunks, and runs of messages outside chunks. Enough for three days of half-second chunks.
pub(super) const MAX_PIECES: usize = 1 << 19;
/// Maximum number of channels.
pub(super) const MAX_CHANNELS: usize = 4096;
/// Maximum number of sources: names after `/raw/` and `/sent/`.
pub(super) const MAX_SOURCES: usize = 1024;
/// Maximum number of bytes of all definitions and metadata, with [`ENTRY_COST`] added for each entry of a map.
pub(super) const MAX_HEADER_BYTES: u64 = 8 << 20;
/// Memory of an entry of a map in addition to its bytes.
const ENTRY_COST: u64 = 128;
/// Maximum number of bytes of all attachments together.
pub(super) const MAX_ATTACHMENT_BYTES: u64 = 16 << 20;
/// Longest text that a loss quotes of a log, bytes.
const MAX_QUOTED_BYTES: usize = 100;

/// Maximum number of bytes that the chunks in the first `packed` bytes of a log may unpack to.
pub(super) fn unpacked_limit(packed: u64) -> u64 {
    packed.saturating_mul(MAX_UNPACKED_RATIO).saturating_add(UNPACKED_ANYWAY)
}

/// Memory of `entries` entries of a map whose texts take `bytes`.
pub(super) fn map_cost(entries: u64, bytes: u64) -> u64 {
    entries.saturating_mul(ENTRY_COST).saturating_add(bytes)
}

/// Used share of [`MAX_HEADER_BYTES`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HeaderBudget(u64);

impl HeaderBudget {
    /// Reserves memory; returns `false` and reserves nothing if there isn't enough.
    pub(super) fn take(&mut self, cost: u64) -> bool {
        let used = self.0.saturating_add(cost);
        let fits = used <= MAX_HEADER_BYTES;
        if fits {
            self.0 = used;
        }
        fits
    }

    /// Releases reserved memory.
    pub(super) fn give_back(&mut self, cost: u64) {
        self.0 = self.0.saturating_sub(cost);
    }
}

/// A text of a log for quoting in a loss; long texts are cut.
pub(super) fn quoted(text: &str) -> String {
    if text.len() <= MAX_QUOTED_BYTES {
        return text.to_owned();
    }
    format!("{}...", text.get(..text.floor_char_boundary(MAX_QUOTED_BYTES)).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_beyond_the_limit_are_refused_whole() {
        let mut budget = HeaderBudget::default();
        assert!(budget.take(MAX_HEADER_BYTES - 10));
        assert!(!budget.take(11) && !budget.take(u64::MAX));
        assert!(budget.take(10) && !budget.take(1));
        assert!(map_cost(100_000, 300_000) > MAX_HEADER_BYTES, "entries count more than their bytes");
    }

    #[test]
    fn long_names_are_cut_between_characters() {
        assert_eq!(quoted("depth"), "depth");
        assert_eq!(quoted(&"ä".repeat(60)), format!("{}...", "ä".repeat(50)));
    }
}
