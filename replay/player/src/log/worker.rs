//! The work of a recorder, which takes entries from the queue and writes them to the log.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use headrace_geometry::time::MonoNs;

use super::fault::RecordingEvent;
use super::queue::{ClosedWhenDropped, Dropped, Entry, Gap, LinePort, Queue, State};
use super::recording::Recording;
use super::space::{LONGEST_KEPT_BYTES, Space};
use super::voice::VoicePort;
use super::writer::{Lane, LogHeader, Summary};

/// Interval at which a chunk is closed and synced.
///
/// A power cut may lose one second of data. The interval is only half a second, because closing and syncing take time
/// too.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);
/// Minimum interval at which the log records how many packets the connections to devices dropped.
const DROPPED_PERIOD: Duration = Duration::from_secs(5);
/// Maximum number of queue entries written in one step.
const BATCH: usize = 256;

/// A message derived from results, such as one for viewers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Made {
    /// Number of the result channel to which the message is written. The message is ignored if the log has no such
    /// channel.
    pub channel: u16,
    /// Log time of the derived message.
    pub at: MonoNs,
    /// Content of the derived message.
    pub bytes: Vec<u8>,
}

/// Derives messages from results. This runs on the recorder's thread, so that the loop has no extra work.
pub trait DerivedChannels: Send {
    /// Processes a message of result channel `channel`. It is called even if the disk has no room for the message
    /// itself.
    fn take(&mut self, channel: u16, at: MonoNs, message: &[u8], made: &mut Vec<Made>);

    /// Called at the end of the dive.
    fn end(&mut self, made: &mut Vec<Made>);
}

/// A recorder without its thread. The caller runs its steps, and supplies the time.
pub struct RecorderWorker {
    queue: Queue,
    recording: Recording,
    flushed: Duration,
    /// Whether any data has been written since the latest flush.
    open: bool,
    space: Space,
    echoes: Echoes,
    beside: Beside,
    /// Number of packets in the ticks that were skipped.
    skipped: u64,
    /// Ids of the sources.
    ids: Vec<String>,
    /// Packets that the connections to devices dropped and that the log doesn't state yet, by source. `dropped_stated`
    /// is the time of the latest statement in the log.
    dropped: BTreeMap<u16, Dropped>,
    dropped_stated: Duration,
    /// Log time of the latest entry. A voice recording has no log time of its own, so it gets this time.
    last: Option<MonoNs>,
    state: Arc<State>,
    _closed: ClosedWhenDropped,
}

/// Derived channels, and a buffer for their messages.
struct Beside {
    derived: Option<Box<dyn DerivedChannels>>,
    made: Vec<Made>,
}

/// Recognises messages that are dropped while the disk is nearly full.
struct Echoes {
    sonars: Vec<u16>,
    /// For each result channel, whether its messages are dropped together with echoes.
    results: Vec<bool>,
}

impl Echoes {
    fn of(header: &LogHeader) -> Self {
        let results = header.results.iter().map(|result| result.follows_echoes).collect();
        Self { sonars: header.sonars.clone(), results }
    }

    fn is_echo(&self, lane: Lane, len: usize) -> bool {
        match lane {
            Lane::Raw(source) => len > LONGEST_KEPT_BYTES && self.sonars.contains(&source),
            Lane::Result(number) => self.results.get(usize::from(number)).copied().unwrap_or_default(),
            Lane::Sent(_) | Lane::Tick | Lane::Voice => false,
        }
    }
}

impl RecorderWorker {
    pub(super) fn new(
        queue: Queue,
        recording: Recording,
        header: &LogHeader,
        derived: Option<Box<dyn DerivedChannels>>,
        state: Arc<State>,
    ) -> Self {
        let closed = ClosedWhenDropped(Arc::clone(&state));
        Self {
            queue,
            recording,
            flushed: Duration::ZERO,
            open: false,
            space: Space::default(),
            echoes: Echoes::of(header),
            beside: Beside { derived, made: Vec::new() },
            skipped: 0,
            ids: header.sources.iter().map(|source| source.id.clone()).collect(),
            dropped: BTreeMap::new(),
            dropped_stated: Duration::ZERO,
            last: None,
            state,
            _closed: closed,
        }
    }

    /// Returns a port that records two things that bypass the loop: messages to devices, and losses of packets.
    pub fn line_port(&self) -> LinePort {
        LinePort { state: Arc::clone(&self.state) }
    }

    /// Returns a port for recordings of voice notes.
    pub fn voice_port(&self) -> VoicePort {
        VoicePort { state: Arc::clone(&self.state) }
    }

    /// Returns the oldest event of the recording that has not been returned yet.
    pub fn next_event(&self) -> Option<RecordingEvent> {
        self.state.events.pop()
    }

    /// Returns the state that the worker shares with its port.
    pub(super) fn state(&self) -> &Arc<State> {
        &self.state
    }

    /// Writes some entries of the queue. If due, also syncs, or tries again after an error.
    ///
    /// `now` is the time since the recording began, which never goes back. Returns whether the queue had entries.
    pub fn step(&mut self, now: Duration) -> bool {
        let recording = &mut self.recording;
        self.space.look(now, || recording.free_bytes());
        recording.look(now);
        let mut taken = 0;
        while taken < BATCH
            && let Some(entry) = self.queue.take()
        {
            self.write_all(&entry);
            self.last = Some(entry.log_time);
            taken += 1;
        }
        let is_behind = taken == BATCH;
        taken += self.write_sent();
        taken += self.write_voices();
        self.state_gaps();
        self.state_dropped(now, false);
        // After a full batch the recorder is behind, so it doesn't sync yet. The next sync then covers all entries that
        // have arrived meanwhile. If the recorder is behind all the time, the amount of unsynced data still triggers a
        // sync.
        if !is_behind {
            self.flush_in_time(now);
        }
        self.tell();
        taken > 0
    }

    /// Writes the rest of the queue, and ends the log.
    pub fn finish(mut self, now: Duration) -> Summary {
        self.state.voices_end.store(true, Ordering::SeqCst);
        // No sync is needed before the end, because ending the log syncs the rest.
        self.flushed = now;
        while self.step(now) {}
        self.state_dropped(now, true);
        self.write_made(|derived, made| derived.end(made));
        let left_out = self.space.left_out();
        if let Some((from, to)) = left_out.span {
            self.recording.state(Some(from), Some(to), &left_out.words());
        }
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let (sent_dropped, results_missing) =
            (count(&self.state.sent_dropped), count(&self.state.results_missing));
        let skipped = self.skipped;
        let is_abandoned = self.state.abandoned.load(Ordering::Acquire);
        let ended = if is_abandoned { self.recording.abandon() } else { self.recording.finish() };
        let summary = Summary { left_out, sent_dropped, skipped, results_missing, ..ended };
        let Summary { messages, bytes, faults, .. } = &summary;
        tracing::info!(
            messages,
            bytes,
            faults = faults.len(),
            left_out = left_out.messages,
            sent_dropped,
            results_missing,
            "recording finished"
        );
        summary
    }

    /// Records skipped ticks in the log.
    fn state_gaps(&mut self) {
        while let Some(Gap { span: (from, to), packets }) = self.state.gaps.pop() {
            self.skipped += packets;
            let words = format!("{packets} packets not recorded: the recorder was behind");
            self.recording.state(Some(from), Some(to), &words);
        }
    }

    /// Records in the log how many packets the connections to devices dropped, every few seconds and at the end.
    ///
    /// Because these records are at least some seconds apart, even hours of dropped packets give few records.
    fn state_dropped(&mut self, now: Duration, at_end: bool) {
        let dropped = core::iter::from_fn(|| self.state.dropped.pop());
        for Dropped { source, span: (from, to), packets } in dropped {
            let sum = self.dropped.entry(source).or_insert(Dropped { source, span: (from, to), packets: 0 });
            sum.span.1 = to;
            sum.packets += packets;
        }
        if !at_end && now.saturating_sub(self.dropped_stated) < DROPPED_PERIOD {
            return;
        }
        let besides = self.state.dropped_besides.swap(0, Ordering::Relaxed);
        if self.dropped.is_empty() && besides == 0 {
            return;
        }
        self.dropped_stated = now;
        for Dropped { source, span: (from, to), packets } in core::mem::take(&mut self.dropped).into_values()
        {
            let id = self.ids.get(usize::from(source)).map_or("an unknown source", String::as_str);
            let words = format!(
                "{packets} packets of {id} dropped by the kernel or a full queue: the computer stalled"
            );
            self.recording.state(Some(from), Some(to), &words);
        }
        if besides > 0 {
            let words =
                format!("{besides} packets dropped by the kernel or a full queue: the computer stalled");
            self.recording.state(None, Some(self.last.unwrap_or_default()), &words);
        }
    }

    fn tell(&mut self) {
        for event in self.recording.take_events() {
            self.state.events.force_push(event);
        }
        if let Some(certain) = self.recording.certain_to() {
            self.state.certain_ns.fetch_max(certain.0, Ordering::Relaxed);
        }
        self.state.steps.fetch_add(1, Ordering::Relaxed);
        self.state.failing.store(self.recording.is_failing(), Ordering::Release);
    }

    /// Writes the entry that was taken most recently, and the messages derived from it.
    fn write_all(&mut self, entry: &Entry) {
        let message = core::mem::take(&mut self.queue.message);
        self.write(entry, &message);
        if let Lane::Result(number) = entry.lane {
            self.write_made(|derived, made| derived.take(number, entry.log_time, &message, made));
        }
        self.queue.message = message;
    }

    fn write_made(&mut self, make: impl FnOnce(&mut dyn DerivedChannels, &mut Vec<Made>)) {
        let Some(derived) = self.beside.derived.as_mut() else { return };
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
        self.open = true;
        if self.space.is_scarce() && self.echoes.is_echo(entry.lane, message.len()) {
            if let Some(words) = self.space.leave_out(entry.log_time, message.len()) {
                self.recording.state(Some(entry.log_time), None, &words);
            }
            return;
        }
        self.recording.message(entry.lane, entry.log_time, entry.publish_time, message);
    }

    /// Writes the bytes sent to devices. Returns the number of messages.
    fn write_sent(&mut self) -> usize {
        let mut written = 0;
        while let Some(message) = self.state.sent.pop() {
            let entry =
                Entry { lane: Lane::Sent(message.source), log_time: message.at, publish_time: message.at };
            self.write(&entry, &message.bytes);
            written += 1;
        }
        written
    }

    /// Writes voice recordings, once the dive has begun. Returns their number.
    fn write_voices(&mut self) -> usize {
        let mut written = 0;
        while let Some(at) = self.last
            && let Some(message) = self.state.voices.pop()
        {
            self.write(&Entry { lane: Lane::Voice, log_time: at, publish_time: at }, &message);
            written += 1;
        }
        written
    }

    fn flush_in_time(&mut self, now: Duration) {
        if !self.open {
            self.flushed = now;
        } else if now.saturating_sub(self.flushed) >= FLUSH_PERIOD {
            self.recording.sync();
            (self.flushed, self.open) = (now, false);
        }
    }
}
