//! Limits on the content read from a log, whatever lengths and counts the log claims.
//!
//! Each limit is several times the value found in logs of dives and robots. Together they keep a reader below about
//! 130 MiB. Content beyond a limit is reported as a loss that states the limit.
//!
//! `docs/reference/limits.md` lists the same limits for users.

use headrace_geometry::time::MonoNs;

/// Latest valid timestamp: the year 2262 if timestamps count from 1970. The sum of a time and a duration then fits into
/// 64 bits.
pub(super) const LATEST: MonoNs = MonoNs(i64::MAX as u64);
/// Maximum length of a record outside chunks, bytes.
///
/// It is also the maximum for all records of a chunk together, with [`RECORD_COST`] added for each record.
pub(super) const MAX_UNPACKED_BYTES: u64 = 32 << 20;
/// Memory that a message takes in addition to its content, bytes.
pub(super) const RECORD_COST: u64 = 64;
/// Maximum ratio of unpacked bytes to file bytes, summed over all chunks up to any position in the file.
///
/// Content that repeats every few hundred bytes reaches this ratio. Runs of zeros reach a ratio of about 30,000.
pub(super) const MAX_UNPACKED_RATIO: u64 = 512;
/// Unpacked bytes that are allowed in addition to the ratio, so that a short log may be highly compressed.
const UNPACKED_ANYWAY: u64 = 64 << 20;
/// Maximum window of a chunk packed by zstd, as a power of two: 16 MiB. zstd's compression levels up to 19 use smaller
/// windows.
pub(super) const MAX_WINDOW_LOG: u32 = 24;
/// Memory limit for pieces of a log that are in memory at once because their times overlap, bytes. One piece may exceed
/// it.
pub(super) const MAX_HELD_BYTES: usize = 32 << 20;
/// Maximum number of pieces, which are chunks and runs of messages outside chunks. Three days of half-second chunks
/// fit.
pub(super) const MAX_PIECES: usize = 1 << 19;
/// Maximum number of channels in a log.
pub(super) const MAX_CHANNELS: usize = 4096;
/// Maximum number of sources, which are the names after `/raw/` and `/sent/`.
pub(super) const MAX_SOURCES: usize = 1024;
/// Maximum memory of all definitions and metadata, bytes, with [`ENTRY_COST`] added for each map entry.
pub(super) const MAX_HEADER_BYTES: u64 = 8 << 20;
/// Memory that a map entry takes in addition to its texts, bytes.
const ENTRY_COST: u64 = 128;
/// Maximum total length of all attachments of a log, bytes.
pub(super) const MAX_ATTACHMENT_BYTES: u64 = 16 << 20;
/// Maximum length of a text from the log that a loss quotes, bytes.
const MAX_QUOTED_BYTES: usize = 100;

/// Returns how many bytes the chunks in the first `packed` bytes of a log may unpack to.
pub(super) fn unpacked_limit(packed: u64) -> u64 {
    packed.saturating_mul(MAX_UNPACKED_RATIO).saturating_add(UNPACKED_ANYWAY)
}

/// Returns the memory of a map with `entries` entries whose texts take `bytes`.
pub(super) fn map_cost(entries: u64, bytes: u64) -> u64 {
    entries.saturating_mul(ENTRY_COST).saturating_add(bytes)
}

/// Memory in use by definitions and metadata, bytes, at most [`MAX_HEADER_BYTES`].
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HeaderBudget(u64);

impl HeaderBudget {
    /// Reserves memory for definitions or metadata. Returns `false`, and reserves nothing, if there isn't enough.
    pub(super) fn take(&mut self, cost: u64) -> bool {
        let used = self.0.saturating_add(cost);
        let fits = used <= MAX_HEADER_BYTES;
        if fits {
            self.0 = used;
        }
        fits
    }

    /// Releases memory reserved for definitions or metadata.
    pub(super) fn give_back(&mut self, cost: u64) {
        self.0 = self.0.saturating_sub(cost);
    }
}

/// Returns a text from the log in the form in which a loss quotes it: shortened if it is too long.
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
    fn reservation_beyond_the_header_limit_reserves_nothing() {
        let mut budget = HeaderBudget::default();
        assert!(budget.take(MAX_HEADER_BYTES - 10));
        assert!(!budget.take(11) && !budget.take(u64::MAX));
        assert!(budget.take(10) && !budget.take(1));
        assert!(map_cost(100_000, 300_000) > MAX_HEADER_BYTES, "an entry costs more than its bytes");
    }

    #[test]
    fn long_quotations_are_cut_between_characters() {
        assert_eq!(quoted("depth"), "depth");
        assert_eq!(quoted(&"ä".repeat(60)), format!("{}...", "ä".repeat(50)));
    }
}
