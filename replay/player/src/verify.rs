//! Compares the results that a live dive published with those of its replay, record by record and bit by bit.

use std::collections::VecDeque;
use std::path::PathBuf;

use headrace_monitor::result_stream::{Record, RecordKind, WordKind, first_record};
use headrace_monitor::run::Loop;

use crate::log::format::{RESULT_PREFIX, STREAMS, read_results, stream_of};
use crate::log::{DiveLog, LogError, MessageKind};

/// Maximum memory of one stream's live results that wait for the replay, bytes.
///
/// With an intact log, the live results are only one tick ahead of the replay.
const MOST_WAITING: usize = 16 << 20;

/// Result streams that logs of earlier program versions don't have.
const LATER: [&str; 2] = ["states", "alerts"];

/// The first difference between a live dive and its replay.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Tick of the live dive that published the record.
    pub tick: u64,
    /// Name of the stream: poses, pings, judgements, advice, states or alerts.
    pub stream: &'static str,
    /// Number of the record in its stream, from zero.
    pub record: u64,
    /// Kind of difference.
    pub what: What,
}

/// Difference between two records.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum What {
    /// A field of the record has different values.
    Field {
        /// Kind of the record with the field.
        kind: RecordKind,
        /// Source number, if the record is a ping.
        source: Option<u64>,
        /// Name of the field that differs.
        field: &'static str,
        /// Type of the field that differs.
        word: WordKind,
        /// Bits of the field in the live dive's record.
        live: u64,
        /// Bits of the field in the replay's record.
        replayed: u64,
    },
    /// The records are of different kinds, or have different numbers of fields.
    Kind {
        /// Kind of the record in the live dive.
        live: &'static str,
        /// Kind of the record in the replay.
        replayed: &'static str,
    },
    /// The live dive published a record that the replay doesn't have.
    Missing,
    /// The replay has a record that the live dive didn't publish.
    Added,
}

/// Compares a replay with its live dive while the replay runs.
pub struct Verifier {
    reader: DiveLog,
    streams: [Stream; STREAMS.len()],
    /// Tick of the live results that were read most recently.
    last_tick: u64,
    has_results: bool,
    at_end: bool,
}

/// A stream of the live dive's results, and its comparison.
#[derive(Default)]
struct Stream {
    waiting: VecDeque<Batch>,
    /// Memory of the live results that wait for the replay, bytes.
    waiting_bytes: usize,
    /// Number that the replay's next record has in this stream.
    next: u64,
    same: u64,
    unrecorded: u64,
    difference: Option<Difference>,
}

/// Records of one tick, as read from the log.
struct Batch {
    tick: u64,
    /// Number of the record at position `at`, counted in its stream.
    next: u64,
    words: Vec<u64>,
    at: usize,
}

impl Batch {
    fn rest(&self) -> &[u64] {
        self.words.get(self.at..).unwrap_or_default()
    }

    fn memory(&self) -> usize {
        size_of::<Self>() + size_of_val(self.words.as_slice())
    }
}

impl Stream {
    /// Returns the live record at the front of the queue, if it has the number of the replay's next record.
    fn front(&self) -> Option<(u64, Record<'_>)> {
        let batch = self.waiting.front().filter(|batch| batch.next == self.next)?;
        first_record(batch.rest()).map(|(record, _)| (batch.tick, record))
    }

    /// Advances to the next live record.
    fn step(&mut self) {
        self.next += 1;
        if let Some(batch) = self.waiting.front_mut()
            && batch.next < self.next
        {
            let rest = first_record(batch.rest()).map_or(0, |(_, rest)| rest.len());
            batch.at = batch.words.len() - rest;
            batch.next += 1;
        }
        self.drop_empty();
    }

    fn drop_empty(&mut self) {
        while let Some(done) = self.waiting.pop_front_if(|batch| first_record(batch.rest()).is_none()) {
            self.waiting_bytes -= done.memory();
        }
    }

    /// Adds the live results of a tick. If too many live results wait, the replay evidently doesn't have these records,
    /// so a difference is reported.
    fn wait(&mut self, batch: Batch, name: &'static str) {
        // After the first difference in a stream, the rest of the stream isn't compared.
        if self.difference.is_some() {
            return;
        }
        self.waiting_bytes += batch.memory();
        self.waiting.push_back(batch);
        self.drop_empty();
        if self.waiting_bytes > MOST_WAITING {
            let tick = self.waiting.front().map_or(0, |batch| batch.tick);
            self.part(tick, name, What::Missing);
            self.waiting.clear();
            self.waiting_bytes = 0;
        }
    }

    fn part(&mut self, tick: u64, stream: &'static str, what: What) {
        self.difference = Some(Difference { tick, stream, record: self.next, what });
    }
}

/// Result of comparing a replay with its live dive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verified {
    /// Number of records that are identical in live dive and replay.
    pub same: u64,
    /// Number of replay records that the live dive's log doesn't have.
    pub unrecorded: u64,
    /// The first difference of each stream that has one, ordered by tick.
    pub differences: Vec<Difference>,
    /// Whether the log has live results to compare.
    pub has_results: bool,
}

impl Verifier {
    /// Opens a log for comparison.
    ///
    /// The log is read along with the replay. Only live records that the replay hasn't reached are in memory.
    ///
    /// Errors: the log can't be read.
    pub fn open(log: &[PathBuf]) -> Result<Self, LogError> {
        let streams = core::array::from_fn(|_| Stream::default());
        Ok(Self { reader: DiveLog::open(log)?, streams, last_tick: 0, has_results: false, at_end: false })
    }

    /// Compares the results of the replay's latest tick with the live results.
    ///
    /// Errors: reading the log fails.
    pub fn after_tick(&mut self, dive: &Loop) -> Result<(), LogError> {
        for (number, (name, trail)) in dive.view().streams().into_iter().enumerate() {
            let mut rest = trail.words();
            while let Some((record, after)) = first_record(rest) {
                rest = after;
                self.compare(number, name, record)?;
            }
        }
        Ok(())
    }

    /// Completes the comparison at the end of the replay.
    ///
    /// Errors: reading the log fails.
    pub fn finish(mut self) -> Result<Verified, LogError> {
        while self.read()? {}
        let topics = self.reader.result_topics();
        let has_channel =
            |name: &str| topics.iter().any(|topic| topic.strip_prefix(RESULT_PREFIX) == Some(name));
        let has_results = self.has_results;
        let mut verified = Verified { same: 0, unrecorded: 0, differences: Vec::new(), has_results };
        for (stream, name) in self.streams.iter_mut().zip(STREAMS) {
            let left = stream.waiting.front().map(|batch| batch.tick).filter(|_| stream.difference.is_none());
            if let Some(tick) = left {
                stream.part(tick, name, What::Missing);
            }
            // Logs of earlier program versions have no channel for states or alerts. A log without any results isn't
            // the log of a live dive.
            let is_reported = has_results && (has_channel(name) || !LATER.contains(&name));
            verified.same += stream.same;
            verified.unrecorded += stream.unrecorded;
            verified.differences.extend(stream.difference.take().filter(|_| is_reported));
        }
        verified.differences.sort_by_key(|difference| difference.tick);
        Ok(verified)
    }

    /// Compares a record of the replay with the live record of the same number.
    fn compare(&mut self, number: usize, name: &'static str, record: Record<'_>) -> Result<(), LogError> {
        while self.streams.get(number).is_some_and(|stream| stream.waiting.is_empty()) && self.read()? {}
        // A truncated log ends before its dive did. Live records missing at the end are therefore no difference.
        let cut_off = self.reader.has_losses();
        let Some(stream) = self.streams.get_mut(number).filter(|stream| stream.difference.is_none()) else {
            return Ok(());
        };
        match stream.front() {
            Some((tick, live)) => match difference(live, record) {
                None => stream.same += 1,
                Some(what) => stream.part(tick, name, what),
            },
            None if cut_off || !stream.waiting.is_empty() => stream.unrecorded += 1,
            None => stream.part(self.last_tick, name, What::Added),
        }
        if stream.difference.is_none() {
            stream.step();
        }
        Ok(())
    }

    /// Reads the live results of another tick. Returns `false` at the end of the log.
    fn read(&mut self) -> Result<bool, LogError> {
        while !self.at_end {
            let Some(message) = self.reader.next()? else {
                self.at_end = true;
                return Ok(false);
            };
            let MessageKind::Result { topic } = message.kind else { continue };
            let found =
                stream_of(topic).and_then(|number| self.streams.get_mut(number).zip(STREAMS.get(number)));
            let (Some((stream, name)), Some((tick, next, words))) = (found, read_results(message.data))
            else {
                continue;
            };
            self.has_results = true;
            self.last_tick = tick;
            stream.wait(Batch { tick, next, words, at: 0 }, name);
            return Ok(true);
        }
        Ok(false)
    }
}

/// Returns the difference between a live record and a replayed one.
fn difference(live: Record<'_>, replayed: Record<'_>) -> Option<What> {
    let (Some(kind), true) =
        (live.kind, live.kind == replayed.kind && live.words.len() == replayed.words.len())
    else {
        let name = |record: Record<'_>| record.kind.map_or("an unknown kind", RecordKind::as_str);
        return Some(What::Kind { live: name(live), replayed: name(replayed) });
    };
    let place = live.words.iter().zip(replayed.words).position(|(live, replayed)| live != replayed)?;
    let (field, word) = kind.field(place);
    let is_ping = matches!(kind, RecordKind::Sample | RecordKind::NoSample | RecordKind::Doubtful);
    Some(What::Field {
        kind,
        source: live.words.get(1).copied().filter(|_| is_ping),
        field,
        word,
        live: live.words.get(place).copied()?,
        replayed: replayed.words.get(place).copied()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(x_m: f64) -> Vec<u64> {
        vec![17, 2, 0, x_m.to_bits(), 0, 0, 0]
    }

    fn record(words: &[u64]) -> Record<'_> {
        Record { kind: Some(RecordKind::Sample), words }
    }

    #[test]
    fn difference_of_one_bit_is_reported_with_its_field() {
        let (live, replayed) = (sample(12.5), sample(12.5_f64.next_up()));
        assert_eq!(difference(record(&live), record(&live)), None);
        let expected = What::Field {
            kind: RecordKind::Sample,
            source: Some(2),
            field: "x_m",
            word: WordKind::Number,
            live: 12.5_f64.to_bits(),
            replayed: 12.5_f64.to_bits() + 1,
        };
        assert_eq!(difference(record(&live), record(&replayed)), Some(expected));
        let shorter = record(&live[..4]);
        assert_eq!(
            difference(record(&live), shorter),
            Some(What::Kind { live: "sample", replayed: "sample" })
        );
    }

    #[test]
    fn live_records_missing_from_the_log_are_skipped_in_the_comparison() {
        let mut stream = Stream::default();
        let head = RecordKind::Run as u64 | (1 << 8);
        stream.wait(Batch { tick: 4, next: 0, words: vec![head, 7], at: 0 }, "poses");
        stream.wait(Batch { tick: 9, next: 2, words: vec![head, 8], at: 0 }, "poses");
        assert_eq!(stream.front().map(|(tick, record)| (tick, record.words.to_vec())), Some((4, vec![7])));
        stream.step();
        assert_eq!(stream.front(), None);
        stream.step();
        assert_eq!(stream.front().map(|(tick, record)| (tick, record.words.to_vec())), Some((9, vec![8])));
        stream.step();
        assert!(stream.waiting.is_empty());
    }

    #[test]
    fn live_results_far_ahead_of_the_replay_are_reported_in_bounded_memory() {
        let mut stream = Stream::default();
        let batch =
            |tick| Batch { tick, next: tick, words: vec![RecordKind::Run as u64 | 2047 << 8; 4096], at: 0 };
        for tick in 3..1000 {
            stream.wait(batch(tick), "poses");
            assert!(stream.waiting_bytes <= MOST_WAITING);
        }
        let difference = Difference { tick: 3, stream: "poses", record: 0, what: What::Missing };
        assert_eq!((stream.difference, stream.waiting.len()), (Some(difference), 0));
    }
}
