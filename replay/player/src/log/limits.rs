//! Limits on what is read of a log, whatever its lengths and counts claim. Each is several times what logs of dives and of robots
//! have; together they keep a reader under some 130 MiB. What lies beyond one is named as a loss, with the limit.
//!
//! The same table, with what is said, is in `docs/reference/limits.md`.

use headrace_geometry::time::MonoNs;

/// Latest timestamp, in 2262 where timestamps count from 1970: a time and a duration after it still fit into 64 bits.
pub(super) const LATEST: MonoNs = MonoNs(i64::MAX as u64);
/// Most bytes of a chunk's records, each taken to be [`RECORD_COST`] longer than it is; and of a record outside chunks.
pub(super) const MAX_UNPACKED_BYTES: u64 = 32 << 20;
/// Memory of a message beside its bytes.
pub(super) const RECORD_COST: u64 = 64;
/// All chunks up to a place in a log may unpack to so many times its distance from the beginning: what is packed best there is
/// repeats itself every few hundred bytes, and nothing but zeros packs to a thirty-thousandth.
pub(super) const MAX_UNPACKED_RATIO: u64 = 512;
/// And to these bytes more, so that short logs may say little at length.
const UNPACKED_ANYWAY: u64 = 64 << 20;
/// Largest window of a chunk packed by zstd, as a power of two: 16 MiB, more than levels up to 19 use.
pub(super) const MAX_WINDOW_LOG: u32 = 24;
/// Most bytes of overlapping pieces held in memory to merge their messages; one piece more may come in.
pub(super) const MAX_HELD_BYTES: usize = 32 << 20;
/// Most pieces: chunks, and runs of messages outside chunks. Three days of half-second chunks.
pub(super) const MAX_PIECES: usize = 1 << 19;
/// Most channels.
pub(super) const MAX_CHANNELS: usize = 4096;
/// Most sources: names after `/raw/` and `/sent/`.
pub(super) const MAX_SOURCES: usize = 1024;
/// Most bytes of all definitions and metadata, each entry of a map taken to be [`ENTRY_COST`] longer than it is.
pub(super) const MAX_HEADER_BYTES: u64 = 8 << 20;
/// Memory of an entry of a map beside its bytes.
const ENTRY_COST: u64 = 128;
/// Most bytes of all attachments together.
pub(super) const MAX_ATTACHMENT_BYTES: u64 = 16 << 20;
/// Longest text that a loss quotes of a log, bytes.
const MAX_QUOTED_BYTES: usize = 100;

/// Most bytes that the chunks of the first `packed` bytes of a log may unpack to.
pub(super) fn unpacked_limit(packed: u64) -> u64 {
    packed.saturating_mul(MAX_UNPACKED_RATIO).saturating_add(UNPACKED_ANYWAY)
}

/// Memory of the entries of a map, of which so many bytes are texts.
pub(super) fn map_cost(entries: u64, bytes: u64) -> u64 {
    entries.saturating_mul(ENTRY_COST).saturating_add(bytes)
}

/// What of [`MAX_HEADER_BYTES`] has been used.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct HeaderBudget(u64);

impl HeaderBudget {
    /// Takes so much; `false` if it isn't there, and nothing is taken.
    pub(super) fn take(&mut self, cost: u64) -> bool {
        let used = self.0.saturating_add(cost);
        let fits = used <= MAX_HEADER_BYTES;
        if fits {
            self.0 = used;
        }
        fits
    }

    /// Gives back what was taken.
    pub(super) fn give_back(&mut self, cost: u64) {
        self.0 = self.0.saturating_sub(cost);
    }
}

/// A text of a log, for quoting in a loss: its beginning, if it is long.
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
    fn headers_fit_or_are_refused_whole() {
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
