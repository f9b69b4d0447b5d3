//! Losses of an import: for each reason, the count and the first position.

use std::collections::BTreeMap;

use headrace_geometry::time::MonoNs;

/// Losses of an import so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Losses {
    kinds: BTreeMap<&'static str, Kind>,
    /// End and reason of the latest loss. If the byte directly after this end is lost for the same reason, it belongs
    /// to the same loss.
    last: Option<(u64, &'static str)>,
    cut_off: Option<(u64, usize)>,
    late: u64,
    /// Number of long gaps between timestamps; length of the first gap, ns; and time of the first gap.
    gaps: Option<(u64, u64, MonoNs)>,
}

#[derive(Debug, Clone, Copy)]
struct Kind {
    places: u64,
    bytes: u64,
    first: u64,
}

impl Losses {
    /// Counts bytes lost at an offset in the file.
    pub(super) fn lost(&mut self, at: u64, bytes: usize, why: &'static str) {
        let kind = self.kinds.entry(why).or_insert(Kind { places: 0, bytes: 0, first: at });
        kind.places += u64::from(bytes > 1 || self.last != Some((at, why)));
        kind.bytes += bytes as u64;
        self.last = Some((at + bytes as u64, why));
    }

    /// Notes that the foreign log ends within an entry.
    pub(super) fn cut_off(&mut self, at: u64, bytes: usize) {
        self.cut_off = Some((at, bytes));
    }

    /// Sets the number of dropped entries. They came too late in the file to be put in time order.
    pub(super) fn late(&mut self, count: u64) {
        self.late = count;
    }

    /// Counts a gap of more than an hour between two timestamps of the file.
    pub(super) fn gap(&mut self, gap_ns: u64, at: MonoNs) {
        let (count, first_ns, first_at) = self.gaps.unwrap_or((0, gap_ns, at));
        self.gaps = Some((count + 1, first_ns, first_at));
    }

    /// Returns all losses of the import as text.
    pub(super) fn words(&self) -> Vec<String> {
        let mut all: Vec<String> = self
            .kinds
            .iter()
            .map(|(why, kind)| {
                let Kind { places, bytes, first } = kind;
                format!("{why}: {places} times, {bytes} bytes in all, first at byte {first}")
            })
            .collect();
        if let Some((at, bytes)) = self.cut_off {
            all.push(format!("cut off: the entry at byte {at} has only {bytes} bytes"));
        }
        if self.late > 0 {
            all.push(format!(
                "{} entries out of order: they came too late to be sorted, and were left out",
                self.late
            ));
        }
        if let Some((count, gap_ns, at)) = self.gaps {
            let (gap_s, at_s) = (gap_ns / 1_000_000_000, at.as_secs_f64());
            all.push(format!("the file's clock jumps forward by over an hour {count} times, first by {gap_s} s to {at_s:.3} s of the log: the clock was set, or the file has several recordings"));
        }
        all
    }
}
