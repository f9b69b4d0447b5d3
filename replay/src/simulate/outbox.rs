//! Messages of all lines in one order: (time, source, sequence).

use headrace_core::app::device::Direction;
use headrace_core::time::MonoNs;

use super::sensing::Line;

/// Bytes on the line of one source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message<'a> {
    /// When they crossed the line.
    pub at: MonoNs,
    /// The source, in the order of the vehicle file.
    pub source: u16,
    /// Which way they went.
    pub direction: Direction,
    /// The bytes.
    pub bytes: &'a [u8],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Waiting {
    at: MonoNs,
    source: u16,
    sequence: u64,
    direction: Direction,
    bytes: (usize, usize),
}

/// Messages that wait for those of other lines before them.
#[derive(Debug, Default)]
pub(super) struct Outbox {
    /// In order up to `released`.
    waiting: Vec<Waiting>,
    bytes: Vec<u8>,
    /// Bytes that messages of later slices keep.
    kept: Vec<u8>,
    next: usize,
    released: usize,
    sequence: u64,
    finished: bool,
}

impl Outbox {
    /// Whether [`Outbox::next`] gives a message.
    pub(super) fn has_next(&self) -> bool {
        self.next < self.released
    }

    /// The next message that nothing can come before any more.
    pub(super) fn next(&mut self) -> Option<Message<'_>> {
        self.next += usize::from(self.has_next());
        self.message(self.next.checked_sub(1)?)
    }

    /// What [`Outbox::next`] would give.
    pub(super) fn peek(&self) -> Option<Message<'_>> {
        self.message(self.next)
    }

    fn message(&self, number: usize) -> Option<Message<'_>> {
        let waiting = self.waiting.get(..self.released)?.get(number)?;
        let (from, to) = waiting.bytes;
        let bytes = self.bytes.get(from..to).unwrap_or_default();
        Some(Message { at: waiting.at, source: waiting.source, direction: waiting.direction, bytes })
    }

    /// Takes what a slice has put on a line.
    pub(super) fn take(&mut self, source: u16, line: &Line) {
        if self.next > 0 && self.next == self.released {
            self.forget_sent();
        }
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(&line.bytes);
        // A message without bytes is none.
        for message in line.messages.iter().filter(|message| message.bytes.0 < message.bytes.1) {
            self.sequence += 1;
            let (from, to) = message.bytes;
            self.waiting.push(Waiting {
                at: message.at,
                source,
                sequence: self.sequence,
                direction: message.direction,
                bytes: (offset + from, offset + to),
            });
        }
    }

    /// Releases what crossed its line before `until`.
    pub(super) fn release(&mut self, until: MonoNs) {
        // Each line's messages are in order, or nearly: a sort that finds runs merges them.
        self.waiting.sort_by_key(|waiting| (waiting.at, waiting.source, waiting.sequence));
        self.released = self.waiting.partition_point(|waiting| waiting.at < until);
    }

    /// Releases everything; false when it had done so before, and there is nothing more to come.
    pub(super) fn finish(&mut self) -> bool {
        let more = !self.finished;
        self.finished = true;
        self.released = self.waiting.len();
        more
    }

    /// Passes over what is released.
    pub(super) fn skip(&mut self) {
        self.next = self.released;
    }

    fn forget_sent(&mut self) {
        self.waiting.drain(..self.released);
        self.kept.clear();
        for waiting in &mut self.waiting {
            let (from, to) = waiting.bytes;
            let at = self.kept.len();
            self.kept.extend_from_slice(self.bytes.get(from..to).unwrap_or_default());
            waiting.bytes = (at, self.kept.len());
        }
        std::mem::swap(&mut self.bytes, &mut self.kept);
        (self.next, self.released) = (0, 0);
    }
}
