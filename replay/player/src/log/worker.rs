//! The recorder's thread: takes entries from the queue and writes them.

use std::io::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use super::LogError;
use super::derived_channels::{DerivedChannels, Made};
use super::queue::{Entry, Queue, State, until_stopped};
use super::rotate::Parts;
use super::space::{LONGEST_KEPT_BYTES, Space};
use super::writer::{Lane, LogHeader, LogWriter, Summary};

/// Sleep of the thread when the queue is empty. The loop can't wake it: that would be a system call.
const NAP: Duration = Duration::from_millis(2);
/// Interval at which a chunk is closed and synced. Half of the second that a power cut may cost, since closing
/// and syncing take time too.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);
/// Entries between two clock readings.
const BATCH: usize = 256;

/// State of the thread.
pub(super) struct Worker<'a, W: Write> {
    /// `None` once it has failed.
    log: Option<LogWriter<W>>,
    error: Option<LogError>,
    discarded: u64,
    flushed: Instant,
    /// Whether anything was written since the last flush.
    open: bool,
    /// Parts, where the recording has several.
    parts: Option<Parts<W>>,
    space: Space,
    echoes: Echoes,
    beside: Beside,
    state: &'a State,
}

/// Derived channels, and a buffer for their messages.
pub(super) struct Beside {
    derived: Option<Box<dyn DerivedChannels>>,
    made: Vec<Made>,
}

impl Beside {
    pub(super) fn new(derived: Option<Box<dyn DerivedChannels>>) -> Self {
        Self { derived, made: Vec::new() }
    }
}

/// Messages dropped when the disk fills.
pub(super) struct Echoes {
    sonars: Vec<u16>,
    /// Which results are one per echo.
    results: Vec<bool>,
}

impl Echoes {
    pub(super) fn of(header: &LogHeader) -> Self {
        let results = header.results.iter().map(|result| result.follows_echoes).collect();
        Self { sonars: header.sonars.clone(), results }
    }

    fn is_echo(&self, lane: Lane, len: usize) -> bool {
        match lane {
            Lane::Raw(source) => len > LONGEST_KEPT_BYTES && self.sonars.contains(&source),
            Lane::Result(number) => self.results.get(usize::from(number)).copied().unwrap_or_default(),
            Lane::Sent(_) | Lane::Tick => false,
        }
    }
}

#[expect(
    clippy::disallowed_methods,
    reason = "how long a chunk stays open is wall time, and no result depends on it"
)]
fn wall_clock() -> Instant {
    Instant::now()
}

impl<'a, W: Write> Worker<'a, W> {
    pub(super) fn new(
        log: LogWriter<W>,
        parts: Option<Parts<W>>,
        space: Space,
        echoes: Echoes,
        beside: Beside,
        state: &'a State,
    ) -> Self {
        let (log, flushed) = (Some(log), wall_clock());
        Self { log, error: None, discarded: 0, flushed, open: false, parts, space, echoes, beside, state }
    }

    pub(super) fn run(mut self, mut queue: Queue) -> Result<Summary, LogError> {
        let state = self.state;
        let work = || {
            self.space.look(wall_clock());
            let taken =
                (0..BATCH).map_while(|_| queue.take().map(|entry| self.write_all(&entry, &queue.message)));
            let taken = taken.count() + self.write_sent();
            self.flush_in_time();
            taken
        };
        until_stopped(|| state.stopping.load(Ordering::Acquire), work, || thread::park_timeout(NAP));
        self.finish()
    }

    /// Writes an entry and the messages derived from it.
    fn write_all(&mut self, entry: &Entry, message: &[u8]) {
        self.write(entry, message);
        if let Lane::Result(number) = entry.lane {
            self.write_made(|derived, made| derived.take(number, entry.log_time, message, made));
        }
    }

    fn write_made(&mut self, make: impl FnOnce(&mut dyn DerivedChannels, &mut Vec<Made>)) {
        // Nothing is derived while a dive is not being recorded.
        let Some(derived) = self.beside.derived.as_mut().filter(|_| self.log.is_some()) else { return };
        let mut made = core::mem::take(&mut self.beside.made);
        make(derived.as_mut(), &mut made);
        for Made { channel, at, bytes } in made.drain(..) {
            if usize::from(channel) < self.echoes.results.len() {
                self.write(&Entry { lane: Lane::Result(channel), log_time: at, publish_time: at }, &bytes);
            }
        }
        self.beside.made = made;
    }

    fn write(&mut self, entry: &Entry, message: &[u8]) {
        self.discarded += u64::from(self.log.is_none());
        self.open = true;
        self.rotate_in_time(entry);
        if self.space.is_scarce() && self.echoes.is_echo(entry.lane, message.len()) {
            if let Some(words) = self.space.leave_out(entry.log_time, message.len()) {
                self.attempt(|log| log.lost(Some(entry.log_time), None, &words));
            }
            return;
        }
        self.attempt(|log| log.message(entry.lane, entry.log_time, entry.publish_time, message));
    }

    fn rotate_in_time(&mut self, entry: &Entry) {
        let (Some(mut parts), Some(log)) = (self.parts.take(), self.log.as_ref()) else { return };
        if parts.is_due(entry.lane, entry.log_time, log) {
            self.attempt(|log| parts.rotate(entry.log_time, log));
        }
        self.parts = Some(parts);
    }

    /// Writes the bytes sent to the devices; returns the number of messages.
    fn write_sent(&mut self) -> usize {
        let state = self.state;
        let mut written = 0;
        while let Some(message) = state.sent.pop() {
            let entry =
                Entry { lane: Lane::Sent(message.source), log_time: message.at, publish_time: message.at };
            self.write(&entry, &message.bytes);
            written += 1;
        }
        written
    }

    fn flush_in_time(&mut self) {
        let now = wall_clock();
        if !self.open {
            self.flushed = now;
        } else if now.duration_since(self.flushed) >= FLUSH_PERIOD {
            self.attempt(LogWriter::flush);
            (self.flushed, self.open) = (now, false);
        }
    }

    fn attempt(&mut self, action: impl FnOnce(&mut LogWriter<W>) -> Result<(), LogError>) {
        let Some(log) = self.log.as_mut() else { return };
        if let Err(error) = action(log) {
            tracing::error!("the dive goes on unrecorded: {error}");
            self.error = Some(error);
            self.log = None;
            self.state.failed.store(true, Ordering::Release);
        }
    }

    fn finish(mut self) -> Result<Summary, LogError> {
        self.write_made(|derived, made| derived.end(made));
        let left_out = self.space.left_out();
        if let Some((from, to)) = left_out.span {
            self.attempt(|log| log.lost(Some(from), Some(to), &left_out.words()));
        }
        let finished = match (self.log, self.error) {
            (Some(log), _) => match self.parts {
                Some(parts) => parts.finish(log),
                None => log.finish().map(|(_, summary)| summary),
            },
            (None, Some(error)) => {
                Err(LogError::Stopped { discarded: self.discarded, source: Box::new(error) })
            }
            (None, None) => Err(LogError::Panicked),
        };
        if finished.is_err() {
            self.state.failed.store(true, Ordering::Release);
        }
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let (sent_dropped, results_missing) =
            (count(&self.state.sent_dropped), count(&self.state.results_missing));
        let summary =
            finished.map(|summary| Summary { left_out, sent_dropped, results_missing, ..summary })?;
        let Summary { messages, bytes, .. } = summary;
        tracing::info!(
            messages,
            bytes,
            left_out = left_out.messages,
            sent_dropped,
            results_missing,
            "recording finished"
        );
        Ok(summary)
    }
}
