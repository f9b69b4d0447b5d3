//! Bounded queue for the steps of the filter. The recorder empties it between ticks.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;

use super::step::{Placed, Step, Words};
use headrace_geometry::frames::{Body, Vec3};
use headrace_geometry::time::DurNs;

/// Writing end of the queue of filter steps, held by the filter.
pub struct Journal {
    queue: Arc<Shared>,
    piece: u32,
    clock: u32,
}

/// Reading end of the queue of filter steps; returns records in the order of writing.
#[derive(Clone)]
pub struct JournalReader {
    queue: Arc<Shared>,
}

struct Shared {
    records: ArrayQueue<Words>,
    dropped: AtomicU64,
}

impl Journal {
    /// Creates a queue for `capacity` records; returns both ends.
    ///
    /// Allocates: the whole queue.
    pub fn new(capacity: usize) -> (Self, JournalReader) {
        let queue =
            Arc::new(Shared { records: ArrayQueue::new(capacity.max(1)), dropped: AtomicU64::new(0) });
        (Self { queue: Arc::clone(&queue), piece: 0, clock: 0 }, JournalReader { queue })
    }

    /// Begins a new piece of the track, because its first estimate is unrelated to earlier estimates.
    pub fn begin(&mut self) {
        self.piece = self.piece.saturating_add(1);
    }

    /// Counts a reset of the clock to an earlier time.
    pub fn clock_set(&mut self) {
        self.clock = self.clock.saturating_add(1);
    }

    /// Writes a step of the filter to the queue.
    ///
    /// A step is dropped if it is not finite or if the queue is full. The track then breaks, because later steps can no
    /// longer correct earlier ones.
    ///
    /// Allocates: never.
    pub fn write(&mut self, step: &Step, unit_at: Vec3<Body>, gap: DurNs) {
        let placed = Placed { step: *step, unit_at, gap, piece: self.piece, clock: self.clock };
        let is_sound = step.is_sound();
        if is_sound && self.queue.records.push(placed.words()).is_ok() {
            return;
        }
        self.begin();
        if is_sound {
            self.queue.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

impl JournalReader {
    /// Removes and returns the oldest record in the queue.
    pub fn next(&self) -> Option<Words> {
        self.queue.records.pop()
    }

    /// Number of records dropped because the queue was full.
    pub fn dropped(&self) -> u64 {
        self.queue.dropped.load(Ordering::Relaxed)
    }
}
