//! Puts the messages of all lines into one order: (time, source, index on the line).

use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Direction;

use crate::sensing::Line;

/// Bytes of one message on the line of a source.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Message<'a> {
    /// Time at which the bytes crossed the line.
    pub at: MonoNs,
    /// Number of the message's source in the vehicle file.
    pub source: u16,
    /// Direction of the bytes: to or from the device.
    pub direction: Direction,
    /// The bytes that crossed the line.
    pub bytes: &'a [u8],
}

const NEVER: MonoNs = MonoNs(u64::MAX);

/// Messages of all lines. Each waits until all earlier messages of other lines are known.
///
/// Messages are merged on demand. Their bytes stay in the devices' buffers.
#[derive(Debug, Default)]
pub(crate) struct Outbox {
    /// Waiting messages of each source, in the order of the sources.
    lanes: Vec<Lane>,
    /// For each source, the time at which its next message is due; `NEVER` if none waits.
    due: Vec<MonoNs>,
    /// Messages with timestamps before this time are released, which means that no earlier message can still come.
    until: MonoNs,
    /// Index in `lanes` of the source with the next released message.
    front: Option<usize>,
}

/// Messages that wait on one line.
#[derive(Debug, Default)]
struct Lane {
    /// Messages of the line in order of time.
    line: Line,
    next: usize,
}

impl Lane {
    /// Time at which the next message on the line is due.
    fn due(&self) -> MonoNs {
        self.line.messages.get(self.next).map_or(NEVER, |message| message.at)
    }

    /// Takes over the messages of a time slice. Messages of earlier slices that still wait stay in front of the new
    /// ones.
    fn take(&mut self, line: &mut Line) {
        std::mem::swap(&mut self.line, line);
        self.line.put_first(line, self.next);
        self.next = 0;
        line.clear();
        // Messages that have lost all their bytes are dropped.
        self.line.messages.retain(|message| message.bytes.0 < message.bytes.1);
        // The next request may cross the line before the reply to the previous request, so the messages need sorting.
        if !self.line.messages.is_sorted_by_key(|message| message.at) {
            self.line.messages.sort_by_key(|message| message.at);
        }
    }
}

impl Outbox {
    /// Creates an outbox for the messages of this many sources.
    pub(crate) fn new(sources: usize) -> Self {
        let lanes = (0..sources).map(|_| Lane::default()).collect();
        Self { lanes, due: vec![NEVER; sources], ..Self::default() }
    }

    /// Whether [`Outbox::next`] returns a message.
    pub(crate) fn has_next(&self) -> bool {
        self.front.is_some()
    }

    /// Removes and returns the next released message. No earlier message can follow it.
    pub(crate) fn next(&mut self) -> Option<Message<'_>> {
        let front = self.front?;
        let lane = self.lanes.get_mut(front)?;
        let sent = lane.next;
        lane.next += 1;
        *self.due.get_mut(front)? = lane.due();
        self.find_front();
        self.message(front, sent)
    }

    /// The message that [`Outbox::next`] would return.
    pub(crate) fn peek(&self) -> Option<Message<'_>> {
        let front = self.front?;
        self.message(front, self.lanes.get(front)?.next)
    }

    fn message(&self, lane: usize, number: usize) -> Option<Message<'_>> {
        let line = &self.lanes.get(lane)?.line;
        let message = line.messages.get(number)?;
        let source = u16::try_from(lane).ok()?;
        Some(Message { at: message.at, source, direction: message.direction, bytes: line.bytes_of(message) })
    }

    /// Takes the messages of a time slice from the line of `source`, and leaves the line empty.
    pub(crate) fn take(&mut self, source: usize, line: &mut Line) {
        if let Some(lane) = self.lanes.get_mut(source) {
            lane.take(line);
        }
    }

    /// Releases messages that crossed their line before `until`.
    pub(crate) fn release(&mut self, until: MonoNs) {
        self.until = until;
        self.look();
    }

    /// Releases all messages. Returns false if all had been released already.
    pub(crate) fn finish(&mut self) -> bool {
        let more = self.until < NEVER;
        self.release(NEVER);
        more
    }

    /// Skips all messages that are released but not yet taken.
    pub(crate) fn skip(&mut self) {
        let until = self.until;
        for lane in &mut self.lanes {
            lane.next = lane.line.messages.partition_point(|message| message.at < until);
        }
        self.look();
    }

    /// Updates the times at which messages are due, and finds the source whose released message is next.
    fn look(&mut self) {
        for (due, lane) in self.due.iter_mut().zip(&self.lanes) {
            *due = lane.due();
        }
        self.find_front();
    }

    fn find_front(&mut self) {
        let first = self.due.iter().enumerate().min_by_key(|(_, at)| **at);
        self.front = first.filter(|(_, at)| **at < self.until).map(|(number, _)| number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENT: Direction = Direction::Sent;

    fn line(times: &[u64]) -> Line {
        let mut line = Line::default();
        for (sample, at) in times.iter().enumerate() {
            line.send(MonoNs(*at), SENT, &[u8::try_from(sample).unwrap()], sample);
        }
        line
    }

    /// Time, source and the single byte of each released message.
    fn going(outbox: &mut Outbox) -> Vec<(u64, u16, u8)> {
        let mut gone = Vec::new();
        while outbox.has_next() {
            let peeked = outbox.peek().unwrap();
            let expected = (peeked.at.0, peeked.source, peeked.bytes[0]);
            let next = outbox.next().unwrap();
            assert_eq!((next.at.0, next.source, next.bytes[0]), expected);
            gone.push(expected);
        }
        gone
    }

    #[test]
    fn messages_are_ordered_by_time_source_and_index() {
        let mut outbox = Outbox::new(2);
        outbox.take(0, &mut line(&[1, 5, 5, 12]));
        outbox.take(1, &mut line(&[0, 11, 5, 1]));
        outbox.release(MonoNs(10));
        assert_eq!(going(&mut outbox), [(0, 1, 0), (1, 0, 0), (1, 1, 3), (5, 0, 1), (5, 0, 2), (5, 1, 2)]);
        outbox.take(0, &mut line(&[10, 13]));
        outbox.release(MonoNs(13));
        assert_eq!(going(&mut outbox), [(10, 0, 0), (11, 1, 1), (12, 0, 3)]);
        assert!(outbox.finish());
        assert_eq!(going(&mut outbox), [(13, 0, 1)]);
        assert!(!outbox.finish());
    }

    #[test]
    fn empty_and_skipped_messages_are_dropped() {
        let mut outbox = Outbox::new(1);
        let mut with_empty = line(&[1, 3]);
        with_empty.send(MonoNs(2), SENT, &[], 2);
        outbox.take(0, &mut with_empty);
        outbox.release(MonoNs(3));
        outbox.skip();
        assert!(!outbox.has_next());
        outbox.take(0, &mut line(&[4]));
        outbox.release(MonoNs(10));
        assert_eq!(going(&mut outbox), [(3, 0, 1), (4, 0, 0)]);
    }
}
