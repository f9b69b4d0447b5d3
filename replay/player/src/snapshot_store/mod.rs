//! Stores snapshots of a replay in memory, so that playback can jump back without starting again.
//!
//! Snapshots are cut into blocks by content, and each distinct block is stored once. Consecutive snapshots share most
//! blocks, because most of their state describes wall that the vehicle has already passed.

mod blocks;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use headrace_geometry::time::MonoNs;

/// Snapshots of a replay by time, within a limited amount of memory.
#[derive(Debug)]
pub struct SnapshotStore {
    snapshots: BTreeMap<MonoNs, Vec<Arc<[u8]>>>,
    /// Distinct blocks of all snapshots.
    blocks: BTreeSet<Arc<[u8]>>,
    /// Memory of the blocks and of the references to them, bytes.
    used_bytes: usize,
    max_bytes: usize,
    interval: Duration,
}

impl SnapshotStore {
    /// Creates an empty store for at most `max_bytes`. A snapshot is due after each `interval` of processing time.
    ///
    /// The first snapshot is kept, however large it is.
    pub fn new(max_bytes: usize, interval: Duration) -> Self {
        Self { snapshots: BTreeMap::new(), blocks: BTreeSet::new(), used_bytes: 0, max_bytes, interval }
    }

    /// Returns the processing time between two snapshots. This time doubles whenever the store is full.
    pub fn interval(&self) -> Duration {
        self.interval
    }

    /// Returns the time of the latest snapshot that isn't later than `at`.
    pub fn latest(&self, at: MonoNs) -> Option<MonoNs> {
        self.snapshots.range(..=at).next_back().map(|(time, _)| *time)
    }

    /// Adds a snapshot, unless the store has one of the same time.
    ///
    /// While there is no room, every other snapshot is dropped and the interval is doubled. If only the first snapshot
    /// is left and the new one still doesn't fit, the new one isn't kept.
    pub fn insert(&mut self, at: MonoNs, snapshot: &[u8]) {
        if self.snapshots.contains_key(&at) {
            return;
        }
        let cut: Vec<&[u8]> = blocks::blocks(snapshot).collect();
        let distinct: BTreeSet<&[u8]> = cut.iter().copied().collect();
        let references = cut.len() * size_of::<Arc<[u8]>>();
        while !self.snapshots.is_empty()
            && self.used_bytes + self.growth(&distinct) + references > self.max_bytes
        {
            self.interval = self.interval.saturating_mul(2);
            if self.snapshots.len() == 1 {
                return;
            }
            self.thin();
        }
        let shared = cut.into_iter().map(|block| self.share(block)).collect();
        self.snapshots.insert(at, shared);
        self.used_bytes += references;
    }

    /// Returns the bytes of the snapshot of time `at`, which [`SnapshotStore::latest`] has returned.
    pub fn load(&self, at: MonoNs) -> Option<Vec<u8>> {
        self.snapshots.get(&at).map(|blocks| blocks.concat())
    }

    /// Returns the memory that the blocks not stored yet will need, bytes.
    fn growth(&self, blocks: &BTreeSet<&[u8]>) -> usize {
        blocks.iter().filter(|block| !self.blocks.contains(**block)).map(|block| block_bytes(block)).sum()
    }

    fn share(&mut self, block: &[u8]) -> Arc<[u8]> {
        if let Some(held) = self.blocks.get(block) {
            return held.clone();
        }
        let held: Arc<[u8]> = block.into();
        self.used_bytes += block_bytes(block);
        self.blocks.insert(held.clone());
        held
    }

    /// Drops every other snapshot, beginning with the second, and all blocks that are no longer used.
    fn thin(&mut self) {
        let mut is_kept = false;
        self.snapshots.retain(|_, _| {
            is_kept = !is_kept;
            is_kept
        });
        // `blocks` itself holds one reference to each block, so a count of one means that no snapshot uses the block.
        self.blocks.retain(|block| Arc::strong_count(block) > 1);
        let blocks: usize = self.blocks.iter().map(|block| block_bytes(block)).sum();
        let references: usize = self.snapshots.values().map(Vec::len).sum();
        self.used_bytes = blocks + references * size_of::<Arc<[u8]>>();
    }
}

/// Returns the memory of a block: its bytes, its two reference counts, and its entry in the set.
fn block_bytes(block: &[u8]) -> usize {
    block.len() + 2 * size_of::<usize>() + size_of::<Arc<[u8]>>()
}

#[cfg(test)]
mod tests {
    use super::*;

    const INTERVAL: Duration = Duration::from_millis(300);

    /// Returns incompressible bytes that depend on the seed.
    fn noise(len: usize, seed: u64) -> Vec<u8> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        (0..len).map(|_| next()).collect()
    }

    #[test]
    fn full_store_drops_every_other_snapshot_and_doubles_the_interval() {
        let mut store = SnapshotStore::new(16 << 20, INTERVAL);
        let snapshot = |number: u64| noise(1 << 20, number);
        for number in 0..100 {
            store.insert(MonoNs(number), &snapshot(number));
            assert!(store.used_bytes <= 16 << 20, "{}", store.used_bytes);
            assert_eq!(store.latest(MonoNs(0)), Some(MonoNs(0)));
        }
        let times: Vec<u64> = store.snapshots.keys().map(|at| at.0).collect();
        assert!((8..=15).contains(&times.len()), "{times:?}");
        for at in times {
            assert_eq!(store.load(MonoNs(at)).unwrap(), snapshot(at));
        }
        // The interval has doubled at least three times, because each thinning makes room for only half as many new
        // snapshots.
        assert!(store.interval() > 4 * INTERVAL);
        assert_eq!(store.load(MonoNs(1)), None);
    }

    #[test]
    fn snapshots_share_equal_blocks() {
        let mut store = SnapshotStore::new(16 << 20, INTERVAL);
        let wall = noise(4 << 20, 1);
        for number in 0..100_u64 {
            let snapshot = [&number.to_le_bytes()[..], &wall, &noise(1000, number + 2)].concat();
            store.insert(MonoNs(number), &snapshot);
            assert_eq!(store.load(MonoNs(number)).unwrap(), snapshot);
        }
        assert_eq!((store.snapshots.len(), store.interval()), (100, INTERVAL));
    }

    #[test]
    fn snapshot_that_does_not_fit_beside_the_first_is_dropped() {
        let mut store = SnapshotStore::new(1 << 20, INTERVAL);
        store.insert(MonoNs(5), &noise(2 << 20, 1));
        store.insert(MonoNs(6), &noise(2 << 20, 2));
        assert_eq!(store.latest(MonoNs(9)), Some(MonoNs(5)));
        assert_eq!(store.latest(MonoNs(4)), None);
        assert_eq!(store.interval(), 2 * INTERVAL);
    }
}
