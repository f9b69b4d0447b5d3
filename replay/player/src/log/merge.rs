//! Merges the messages of several pieces in memory into one order.
//!
//! A piece is a chunk of a log file, or a run of messages outside chunks.

use core::cmp::Reverse;
use std::collections::BinaryHeap;
use std::collections::binary_heap::PeekMut;

use super::fields::{Fields, MessageHead};

/// Number of used batches kept for reuse, and maximum memory of each. The messages of a chunk in this program's logs
/// fit.
const KEPT: usize = 4;
const KEPT_BYTES: usize = 3 << 20;

/// A message in a [`Batch`]: its header, its sort rank and its range of bytes.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    pub(super) head: MessageHead,
    /// Sort rank of the message's channel, see [`super::channels::Channel::rank`].
    pub(super) rank: u32,
    start: usize,
    end: usize,
}

/// Batch with the messages of one piece of the log: a chunk, or a run of messages outside chunks.
#[derive(Debug, Default)]
pub(super) struct Batch {
    bytes: Vec<u8>,
    pub(super) entries: Vec<Entry>,
    next: usize,
}

impl Batch {
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.entries.clear();
        self.next = 0;
    }

    /// Adds a message record. Returns `false` if it doesn't parse.
    pub(super) fn push(&mut self, record: &[u8]) -> bool {
        let mut fields = Fields::new(record);
        let Some(head) = MessageHead::read(&mut fields) else { return false };
        let start = self.bytes.len();
        self.bytes.extend_from_slice(fields.rest());
        self.entries.push(Entry { head, rank: 0, start, end: self.bytes.len() });
        true
    }

    fn memory(&self) -> usize {
        self.bytes.capacity() + self.entries.capacity() * size_of::<Entry>()
    }
}

/// Sort key of a message: time, rank and sequence number, then position in the file. The first three are zero if the
/// log is read in file order.
type Key = (u64, u32, u32, usize, usize);

/// Pieces of the log in memory, whose messages are being merged.
#[derive(Debug)]
pub(super) struct Merge {
    by_time: bool,
    heads: BinaryHeap<Reverse<(Key, usize)>>,
    batches: Vec<Batch>,
    /// Indexes of empty batches that can be reused.
    spare: Vec<usize>,
    /// Indexes of batches used up since the latest piece was read.
    released: Vec<usize>,
    memory: usize,
}

impl Merge {
    pub(super) fn new(by_time: bool) -> Self {
        Self {
            by_time,
            heads: BinaryHeap::new(),
            batches: Vec::new(),
            spare: Vec::new(),
            released: Vec::new(),
            memory: 0,
        }
    }

    /// Returns the memory of the pieces being merged, bytes.
    pub(super) fn memory(&self) -> usize {
        self.memory
    }

    /// Returns the log time of the next message in the merged order.
    pub(super) fn next_time(&self) -> Option<u64> {
        self.heads.peek().map(|Reverse(((time, ..), _))| *time)
    }

    /// Returns an empty batch, which reuses the memory of a used one.
    pub(super) fn empty_batch(&mut self) -> Batch {
        // Batches are released only here, because the latest returned message may still be in one of them.
        for slot in self.released.drain(..) {
            if let Some(batch) = self.batches.get_mut(slot)
                && (batch.memory() > KEPT_BYTES || self.spare.len() >= KEPT)
            {
                *batch = Batch::default();
            }
            self.spare.push(slot);
        }
        let spare = self.spare.last().and_then(|slot| self.batches.get_mut(*slot));
        let mut batch = spare.map(core::mem::take).unwrap_or_default();
        batch.clear();
        batch
    }

    /// Adds the messages of the log's piece with index `span`, beginning with the message with index `next`.
    pub(super) fn add(&mut self, span: usize, mut batch: Batch, next: usize) {
        if self.by_time {
            batch.entries.sort_by_key(|entry| (entry.head.log_time, entry.rank, entry.head.sequence));
        }
        batch.next = next;
        let slot = self.spare.pop().unwrap_or(self.batches.len());
        let key = key(self.by_time, span, &batch);
        self.memory += batch.memory();
        if slot == self.batches.len() {
            self.batches.push(batch);
        } else if let Some(place) = self.batches.get_mut(slot) {
            *place = batch;
        }
        match key {
            Some(key) => self.heads.push(Reverse((key, slot))),
            None => self.release(slot),
        }
    }

    /// Returns the pieces in memory, each with the number of messages taken from it.
    pub(super) fn open(&self) -> impl Iterator<Item = (usize, usize)> {
        self.heads.iter().map(|Reverse(((_, _, _, span, next), _))| (*span, *next))
    }

    /// Drops all pieces being merged.
    pub(super) fn clear(&mut self) {
        while let Some(Reverse((_, slot))) = self.heads.pop() {
            self.release(slot);
        }
    }

    /// Takes the next message. Its bytes stay valid until the next call of [`Merge::empty_batch`].
    pub(super) fn pop(&mut self) -> Option<(Entry, usize)> {
        let mut head = self.heads.peek_mut()?;
        let Reverse(((_, _, _, span, _), slot)) = *head;
        let batch = self.batches.get_mut(slot)?;
        let entry = *batch.entries.get(batch.next)?;
        batch.next += 1;
        // The next message is usually from the same batch, whose new key then stays at the top of the heap.
        if let Some(key) = key(self.by_time, span, batch) {
            *head = Reverse((key, slot));
        } else {
            PeekMut::pop(head);
            self.release(slot);
        }
        Some((entry, slot))
    }

    /// Returns the bytes of a message that [`Merge::pop`] has returned.
    pub(super) fn bytes(&self, entry: &Entry, slot: usize) -> &[u8] {
        self.batches.get(slot).and_then(|batch| batch.bytes.get(entry.start..entry.end)).unwrap_or_default()
    }

    fn release(&mut self, slot: usize) {
        self.memory -= self.batches.get(slot).map_or(0, Batch::memory);
        self.released.push(slot);
    }
}

/// Returns the sort key of a batch's next message.
fn key(by_time: bool, span: usize, batch: &Batch) -> Option<Key> {
    let Entry { head, rank, .. } = batch.entries.get(batch.next)?;
    let (time, rank, sequence) = if by_time { (head.log_time, *rank, head.sequence) } else { (0, 0, 0) };
    Some((time, rank, sequence, span, batch.next))
}
