//! Missing samples: places where a ping would have left a sample, and the causes of the loss.
//!
//! To find the hole without a factor, the samples that are missing because of it are put back. Only the most recent
//! missing samples are kept, because a fail is explained soon after the vehicle has left the section.

use serde::{Deserialize, Serialize};

use super::cause::{Cause, Causes};
use headrace_geometry::snapshot::stateful;

/// Maximum number of missing samples kept. Four heads without any return fill the list in five minutes.
const ROOM: usize = 1 << 16;
/// Number of missing samples per block. For each block, its extent along the tunnel is stored.
///
/// A search over a few metres skips the blocks whose extent is elsewhere. The capacity is a multiple of this number.
const BLOCK: usize = 1 << 8;

/// A missing sample: a place where a ping would have left a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MissingSample {
    /// Chainage at which the sample would lie, m.
    pub x_m: f64,
    /// Arc length at which the sample would lie, m.
    pub arc_m: f64,
    /// Number of the head that would have made the sample.
    pub head: u8,
    /// Causes of the missing sample. It would exist only if all of them had been absent.
    pub why: Causes,
    /// Whether there was a doubtful return, which may be wall.
    pub may_be_wall: bool,
}

/// List of the most recent missing samples.
#[derive(Debug)]
pub struct MissingSamples {
    ring: Vec<MissingSample>,
    /// Smallest and largest chainage in each block of the ring, m.
    extents_m: Vec<[f64; 2]>,
    /// Position of the next entry in the ring buffer once it is full.
    next: u32,
}

stateful!(MissingSamples { state: next; lists: ring, extents_m; });

impl Default for MissingSamples {
    /// Creates an empty list. Allocates: at startup, all memory that the list will ever use.
    fn default() -> Self {
        Self { ring: Vec::with_capacity(ROOM), extents_m: Vec::with_capacity(ROOM / BLOCK), next: 0 }
    }
}

impl MissingSamples {
    /// Adds a missing sample to the list. If the list is full, the new sample replaces the oldest one.
    ///
    /// Allocates: never.
    pub fn add(&mut self, missing: MissingSample) {
        let at = if self.ring.len() < ROOM { self.ring.len() } else { self.next as usize };
        if let Some(oldest) = self.ring.get_mut(at) {
            *oldest = missing;
            self.next = if at + 1 >= ROOM { 0 } else { self.next + 1 };
        } else {
            self.ring.push(missing);
        }
        self.extend(at, missing.x_m);
        let (kept, blocks) = (self.ring.len(), self.extents_m.len());
        debug_assert!(
            kept <= ROOM && blocks == kept.div_ceil(BLOCK),
            "{kept} samples are in {blocks} blocks"
        );
    }

    /// Extends a block's extent by the entry at position `at` of the ring buffer.
    ///
    /// Once all entries of the block have been overwritten, its extent is that of the new entries only.
    fn extend(&mut self, at: usize, x_m: f64) {
        let block = at / BLOCK;
        let wider_m = |[from_m, to_m]: [f64; 2], x_m: f64| [from_m.min(x_m), to_m.max(x_m)];
        let Some(extent_m) = self.extents_m.get_mut(block) else {
            self.extents_m.push([x_m; 2]);
            return;
        };
        *extent_m = wider_m(*extent_m, x_m);
        if (at + 1).is_multiple_of(BLOCK) {
            let latest = self.ring.get(block * BLOCK..=at);
            debug_assert!(latest.is_some(), "sample {at} is one of {}", self.ring.len());
            let latest = latest.unwrap_or_default();
            *extent_m = latest.iter().fold([x_m; 2], |extent_m, missing| wider_m(extent_m, missing.x_m));
        }
    }

    /// Changes the cause of up to `count` of a head's latest missing samples.
    ///
    /// Returns the chainages between which the changed samples lie, m, if there are any.
    ///
    /// Allocates: never.
    pub fn revise(&mut self, head: u8, count: usize, [from, to]: [Cause; 2]) -> Option<[f64; 2]> {
        let at = if self.ring.len() < ROOM { self.ring.len() } else { self.next as usize };
        let (newer, older) = self.ring.split_at_mut(at);
        let latest = newer.iter_mut().rev().chain(older.iter_mut().rev());
        let of_head =
            latest.filter(|missing| missing.head == head && missing.why == Causes::of(from)).take(count);
        of_head.fold(None, |between_m: Option<[f64; 2]>, missing| {
            missing.why = Causes::of(to);
            let [least_m, most_m] = between_m.unwrap_or([missing.x_m; 2]);
            Some([least_m.min(missing.x_m), most_m.max(missing.x_m)])
        })
    }

    /// Returns the missing samples between two chainages, in no particular order.
    pub fn between(&self, from_m: f64, to_m: f64) -> impl Iterator<Item = &MissingSample> {
        let meets = move |extent_m: &[f64; 2]| extent_m[0] <= to_m && extent_m[1] >= from_m;
        let blocks =
            self.ring.chunks(BLOCK).zip(&self.extents_m).filter(move |(_, extent_m)| meets(extent_m));
        let missing_samples = blocks.flat_map(|(block, _)| block);
        missing_samples.filter(move |missing| (from_m..=to_m).contains(&missing.x_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_list_drops_the_oldest_missing_samples() {
        let mut missing_samples = MissingSamples::default();
        let missing = |x_m: f64| MissingSample {
            x_m,
            arc_m: 1.0,
            head: 0,
            why: Causes::of(Cause::HeadSilent),
            may_be_wall: false,
        };
        for k in 0..2 * ROOM + 10 {
            missing_samples.add(missing(k as f64));
        }
        assert_eq!(missing_samples.between(0.0, f64::INFINITY).count(), ROOM);
        let first = (ROOM + 10) as f64;
        assert_eq!(missing_samples.between(0.0, first - 1.0).count(), 0);
        assert_eq!(missing_samples.between(first, first + 4.0).count(), 5);
    }

    #[test]
    fn only_the_latest_missing_samples_of_a_head_get_the_new_cause() {
        let mut missing_samples = MissingSamples::default();
        let (missing, silent) = (Cause::MissingReturns, Cause::HeadSilent);
        for k in 0..ROOM + 100 {
            let (head, why) = (u8::from(k % 2 == 1), if k % 5 == 0 { Cause::Occluded } else { missing });
            missing_samples.add(MissingSample {
                x_m: k as f64,
                arc_m: 0.0,
                head,
                why: Causes::of(why),
                may_be_wall: false,
            });
        }
        let last = (ROOM + 99) as f64;
        // Every second missing sample is of head 1. Every fifth of those is occluded, including the very last.
        assert_eq!(missing_samples.revise(1, 8, [missing, silent]), Some([last - 18.0, last - 2.0]));
        let revised = |missing: &&MissingSample| missing.why == Causes::of(silent);
        let revised: Vec<MissingSample> =
            missing_samples.between(0.0, f64::INFINITY).filter(revised).copied().collect();
        assert!(
            revised.len() == 8
                && revised.iter().all(|missing| missing.head == 1 && missing.x_m >= last - 18.0)
        );
        assert_eq!(missing_samples.revise(2, 8, [missing, silent]), None);
    }

    /// While the ring fills and while it is overwritten, a search by blocks finds the same samples as a full search.
    ///
    /// The vehicle drives to and fro over 90 m.
    #[test]
    fn block_search_finds_every_missing_sample() {
        let mut missing_samples = MissingSamples::default();
        for k in 0..ROOM + 5 * BLOCK + 77 {
            let along_m = (k % 9000) as f64 * 0.01;
            let x_m = if (k / 9000).is_multiple_of(2) { along_m } else { 90.0 - along_m };
            missing_samples.add(MissingSample {
                x_m,
                arc_m: k as f64,
                head: 0,
                why: Causes::of(Cause::HeadSilent),
                may_be_wall: false,
            });
            if k % 977 == 0 || k >= ROOM && k % 101 == 0 {
                let [from_m, to_m] = [x_m - 0.3, x_m + 0.1 * (k % 7) as f64];
                let all =
                    missing_samples.ring.iter().filter(|missing| (from_m..=to_m).contains(&missing.x_m));
                assert!(missing_samples.between(from_m, to_m).eq(all), "after {k}");
            }
        }
        assert!(missing_samples.between(90.1, 100.0).next().is_none());
    }
}
