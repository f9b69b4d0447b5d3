//! The recorder: a log writer on its own thread, behind a lock-free queue.
//!
//! The loop must neither wait for a disk nor lose a byte. It checks [`RecorderPort::vacant_bytes`] before it consumes
//! packets. While the queue is full, the loop leaves packets in the rings of their ports.

use std::io::{ErrorKind, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::byte_ring::ByteProducer as _;
use ringbuf::HeapRb;
use ringbuf::traits::Observer as _;
use ringbuf::wrap::{Cons, Prod};

use super::error::LogError;
use super::fault::RecordingEvent;
use super::format::{TICK_HEAD_BYTES, order_bytes, tick_head};
use super::queue::{ENTRY_HEAD_BYTES, Entries, Full, Gap, LinePort, Queue, State, until_stopped};
use super::recording::Recording;
use super::rotate::{Every, Rotation, in_the_way};
use super::storage::{Disk, OneWriter, Storage};
use super::unfinished::Interrupted;
use super::voice::VoicePort;
use super::worker::{DerivedChannels, RecorderWorker};
use super::writer::{Lane, LogHeader, Summary};

/// Time that the thread sleeps while the queue is empty. The loop doesn't wake it, because this takes a system call.
const NAP: Duration = Duration::from_millis(2);
/// Minimum size of the queue: room for the longest packet of a port, and for a tick with many packets.
const MIN_QUEUE_BYTES: usize = 64 * 1024;
/// Capacity for messages to devices, which is enough for some seconds of a dive with eight heads.
const SENT_MESSAGES: usize = 2048;
/// Capacity for voice recordings. Each lasts a minute at most, and takes 4 MiB at most.
const VOICES: usize = 8;
/// Time to wait at the end for a medium that accepts no data but reports no error.
const PATIENCE: Duration = Duration::from_secs(30);
/// Maximum number of events that wait to be read.
const EVENTS: usize = 64;

/// Starts recorders on threads of their own.
pub struct Recorder;

/// The end of a recorder's queue that the loop uses. Its methods don't block, allocate or make system calls.
pub struct RecorderPort {
    /// Writing end of the queue. It doesn't cache its index, so that the port is `Sync` and can be a resource of the
    /// loop.
    entries: Entries,
    state: Arc<State>,
    result_channels: usize,
    /// Ticks that were skipped since the latest recorded tick.
    gap: Option<Gap>,
}

/// Handle that ends the recorder.
///
/// If the handle is dropped without [`RecorderHandle::finish`], all data is synced, and errors are discarded. The
/// recording gets no end mark, so it can be continued ([`Recorder::go_on`]).
pub struct RecorderHandle {
    thread: Option<JoinHandle<Summary>>,
    state: Arc<State>,
    /// Time to wait at the end for a medium that accepts no data but reports no error.
    pub(super) patience: Duration,
    /// Time at which the end of the recording was requested, and whether the total wait is limited.
    ending: Option<(Instant, bool)>,
}

impl Recorder {
    /// Starts a recorder that writes to `writer`, with a queue of `queue_bytes`.
    ///
    /// The header is written before this function returns. If flushing `writer` doesn't sync to the medium, a power cut
    /// loses more than a second. The recording ends after a write error, because it can't continue in another part.
    ///
    /// Errors: the header can't be written, or the thread can't be started.
    pub fn start<W: Write + Send + 'static>(
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let storage = Box::new(OneWriter(Some(writer)));
        let path = Path::new("the log");
        let begun = Self::unthreaded(storage, path, header, &Rotation::default(), queue_bytes, None)?;
        Self::spawn(begun)
    }

    /// Starts a recorder that writes to new files on disk, and syncs them every half second.
    ///
    /// When the disk fills, the recorder warns, and then drops echoes before other messages: [`Summary::left_out`].
    /// `path` names the recording's file or, with [`Rotation::every`], its parts, see [`super::part_path`]. After an
    /// error the recording continues in another part: [`Summary::faults`].
    ///
    /// Errors: as for [`Recorder::start`]; a file can't be created; the recording, or a file named like one of its
    /// parts, exists. A dive is never overwritten.
    pub fn create(
        path: &Path,
        header: &LogHeader,
        rotation: &Rotation,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let failed = |path: &Path, source| LogError::Create { path: path.to_owned(), source };
        if let [other, ..] = in_the_way(path).map_err(|source| failed(path, source))?.as_slice() {
            return Err(failed(other, ErrorKind::AlreadyExists.into()));
        }
        Self::spawn(Self::unthreaded(Box::new(Disk), path, header, rotation, queue_bytes, derived)?)
    }

    /// Starts a recorder that continues an interrupted recording in a new part. The new part states the interruption.
    ///
    /// Errors: as for [`Recorder::create`]. The earlier parts are never modified.
    pub fn go_on(
        earlier: &Interrupted,
        header: &LogHeader,
        every: Option<Every>,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let rotation = Rotation { every, dive: String::new() };
        let recording = Recording::go_on(Box::new(Disk), &rotation, header, earlier)?;
        Self::spawn(Self::of_recording(recording, header, queue_bytes, derived))
    }

    /// Creates a recorder without a thread, on any storage. The caller runs its steps.
    ///
    /// The header is written and synced before this function returns.
    ///
    /// Errors: the first part can't be created, or its header can't be written.
    pub fn unthreaded(
        storage: Box<dyn Storage>,
        path: &Path,
        header: &LogHeader,
        rotation: &Rotation,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderWorker), LogError> {
        Ok(Self::of_recording(
            Recording::begin(storage, path, rotation, header)?,
            header,
            queue_bytes,
            derived,
        ))
    }

    fn of_recording(
        recording: Recording,
        header: &LogHeader,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> (RecorderPort, RecorderWorker) {
        let ring = Arc::new(HeapRb::new(queue_bytes.max(MIN_QUEUE_BYTES)));
        let state = Arc::new(State {
            stopping: AtomicBool::new(false),
            abandoned: AtomicBool::new(false),
            closed: AtomicBool::new(false),
            failing: AtomicBool::new(false),
            gaps: ArrayQueue::new(EVENTS),
            handed_ns: AtomicU64::new(0),
            certain_ns: AtomicU64::new(0),
            steps: AtomicU64::new(0),
            events: ArrayQueue::new(EVENTS),
            sent: ArrayQueue::new(SENT_MESSAGES),
            sent_dropped: AtomicU64::new(0),
            dropped: ArrayQueue::new(EVENTS),
            dropped_besides: AtomicU64::new(0),
            voices: ArrayQueue::new(VOICES),
            voices_end: AtomicBool::new(false),
            results_missing: AtomicU64::new(0),
        });
        let port = RecorderPort {
            entries: Entries { ring: Prod::new(Arc::clone(&ring)) },
            state: Arc::clone(&state),
            result_channels: header.results.len(),
            gap: None,
        };
        let queue = Queue { ring: Cons::new(ring), message: Vec::new() };
        (port, RecorderWorker::new(queue, recording, header, derived, state))
    }

    /// Runs a recorder's steps on a thread of its own.
    ///
    /// Errors: the thread can't be started.
    pub(super) fn spawn(
        (port, worker): (RecorderPort, RecorderWorker),
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let state = Arc::clone(&port.state);
        let thread = thread::Builder::new().name("recorder".to_owned());
        let thread = thread.spawn(move || run(worker)).map_err(|source| LogError::Thread { source })?;
        Ok((port, RecorderHandle { thread: Some(thread), state, patience: PATIENCE, ending: None }))
    }
}

/// Main function of the recorder's thread.
#[expect(
    clippy::disallowed_methods,
    reason = "how long a chunk stays open is wall time, and no result depends on it"
)]
fn run(mut worker: RecorderWorker) -> Summary {
    let began = Instant::now();
    let state = Arc::clone(worker.state());
    let work = || usize::from(worker.step(began.elapsed()));
    until_stopped(|| state.stopping.load(Ordering::Acquire), work, || thread::park_timeout(NAP));
    worker.finish(began.elapsed())
}

impl RecorderPort {
    /// Records bytes from `source` that were received at `received` and whose content is valid at `valid`.
    ///
    /// Errors: there is no room; nothing was written.
    pub fn raw(&mut self, source: u16, received: MonoNs, valid: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Raw(source), received, valid, bytes)
    }

    /// Records bytes sent to `source`.
    ///
    /// Errors: there is no room; nothing was written.
    pub fn sent(&mut self, source: u16, at: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Sent(source), at, at, bytes)
    }

    /// Records a tick, with the source numbers of its packets in the order of consumption.
    ///
    /// Errors: there is no room; nothing was written.
    pub fn tick(&mut self, index: u64, now: MonoNs, order: &[u16]) -> Result<(), Full> {
        let len = TICK_HEAD_BYTES.saturating_add(order.len().saturating_mul(2));
        self.begin(Lane::Tick, now, now, len)?;
        // `begin` has reserved room for the entry, so the entry's length fits into a u32. The packet count is smaller,
        // so it fits too.
        self.entries.put(&tick_head(index, now, u32::try_from(order.len()).unwrap_or(u32::MAX)));
        self.entries.ring.push_each(order_bytes(order));
        self.state.hand(now);
        Ok(())
    }

    /// Records a message of result channel `channel`.
    ///
    /// Errors: there is no room; nothing was written.
    pub fn result(&mut self, channel: u16, time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Result(channel), time, time, bytes)
    }

    /// Counts a tick whose results didn't all fit in the queue.
    pub fn miss_results(&mut self) {
        self.state.results_missing.fetch_add(1, Ordering::Relaxed);
    }

    /// Skips a tick of `packets` packets for which there is no room.
    ///
    /// The log records the skipped ticks. The first tick of a series is also reported as an event.
    pub fn skip(&mut self, at: MonoNs, packets: u64) {
        self.state.hand(at);
        if self.gap.is_none() {
            // The queue of events is full only if nothing reads the events, so this event may be dropped.
            self.state.events.push(RecordingEvent::Behind).ok();
        }
        let gap = self.gap.get_or_insert(Gap { span: (at, at), packets: 0 });
        gap.span.1 = at;
        gap.packets += packets;
    }

    /// Whether the recorder skipped the latest tick.
    pub fn is_behind(&self) -> bool {
        self.gap.is_some()
    }

    /// Returns the number of result channels in the log.
    pub fn result_channels(&self) -> usize {
        self.result_channels
    }

    /// Returns the number of free bytes in the queue.
    pub fn vacant_bytes(&self) -> usize {
        self.entries.ring.vacant_len()
    }

    /// Returns the capacity of the queue, bytes. A larger entry never fits.
    pub fn capacity_bytes(&self) -> usize {
        self.entries.ring.capacity().get()
    }

    /// Returns the bytes of the queue taken by an entry with a message of `len` bytes.
    pub const fn entry_bytes(len: usize) -> usize {
        ENTRY_HEAD_BYTES.saturating_add(len)
    }

    /// Returns the bytes of the queue taken by the entry of a tick with `packets` packets.
    pub const fn tick_entry_bytes(packets: usize) -> usize {
        Self::entry_bytes(TICK_HEAD_BYTES.saturating_add(packets.saturating_mul(2)))
    }

    /// Whether the recorder has ended, and accepts nothing more.
    pub fn is_closed(&self) -> bool {
        self.state.closed.load(Ordering::Acquire)
    }

    fn push(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.begin(lane, log_time, publish_time, bytes.len())?;
        self.entries.put(bytes);
        Ok(())
    }

    /// Ends a series of skipped ticks. If there is no room to record the series, it is recorded together with the next
    /// series.
    fn end_gap(&mut self) {
        if let Some(gap) = self.gap.take() {
            self.gap = self.state.gaps.push(gap).err();
            if self.gap.is_none() {
                self.state.events.push(RecordingEvent::CaughtUp { packets: gap.packets }).ok();
            }
        }
    }

    /// Begins an entry whose message has `len` bytes. If ticks were skipped before, first reports these ticks to the
    /// recorder's thread.
    fn begin(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, len: usize) -> Result<(), Full> {
        if Self::entry_bytes(len) <= self.vacant_bytes() {
            self.end_gap();
        }
        self.entries.begin(lane, log_time, publish_time, len)?;
        Ok(())
    }
}

impl Drop for RecorderPort {
    fn drop(&mut self) {
        self.end_gap();
    }
}

impl RecorderHandle {
    /// Whether an error keeps the recorder from recording at present.
    pub fn is_failing(&self) -> bool {
        self.state.failing.load(Ordering::Acquire)
    }

    /// Returns the oldest event of the recording that has not been returned yet.
    pub fn next_event(&self) -> Option<RecordingEvent> {
        self.state.events.pop()
    }

    /// Returns the dive time that a power cut would lose now: from the latest synced message to the latest tick.
    ///
    /// Messages that were lost through an error count as synced.
    pub fn unsafe_for(&self) -> DurNs {
        self.state.unsafe_for()
    }

    /// Returns a port that records messages to devices, and losses of packets, which don't pass through the loop.
    pub fn line_port(&self) -> LinePort {
        LinePort { state: Arc::clone(&self.state) }
    }

    /// Returns a port for recordings of voice notes.
    pub fn voice_port(&self) -> VoicePort {
        VoicePort { state: Arc::clone(&self.state) }
    }

    /// Tells the thread to end, without waiting for it. Several recorders can then end at the same time.
    ///
    /// If `in_time` is true, the program waits 30 s at most for the thread's end. Otherwise it waits as long as there
    /// is progress.
    #[expect(clippy::disallowed_methods, reason = "how long a medium is waited for is wall time")]
    pub fn begin_to_end(&mut self, in_time: bool) {
        self.ending.get_or_insert((Instant::now(), in_time));
        self.state.stopping.store(true, Ordering::Release);
        if let Some(thread) = &self.thread {
            thread.thread().unpark();
        }
    }

    /// Tells the thread to end within 30 s without an end mark, unless it has been told to end already.
    pub fn begin_to_abandon(&mut self) {
        if self.ending.is_none() {
            self.state.abandoned.store(true, Ordering::Release);
            self.begin_to_end(true);
        }
    }

    /// Writes the rest of the queue and the summary, and ends the thread. Write errors are in [`Summary::faults`].
    ///
    /// Errors: the thread panicked, or its medium accepts no data but reports no error.
    pub fn finish(mut self) -> Result<Summary, LogError> {
        self.stop().unwrap_or(Err(LogError::Panicked))
    }

    #[expect(clippy::disallowed_methods, reason = "how long a medium is waited for is wall time")]
    fn stop(&mut self) -> Option<Result<Summary, LogError>> {
        self.begin_to_end(false);
        let thread = self.thread.take()?;
        let (mut since, in_time) = self.ending?;
        let mut steps = 0;
        while !thread.is_finished() {
            let now = self.state.steps.load(Ordering::Relaxed);
            if now != steps && !in_time {
                (steps, since) = (now, Instant::now());
            } else if since.elapsed() > self.patience {
                // A thread that waits for its medium can't be stopped. The thread ends together with the program.
                return Some(Err(LogError::Stuck { waited_s: self.patience.as_secs() }));
            }
            thread::sleep(NAP);
        }
        Some(thread.join().map_err(|_| LogError::Panicked))
    }
}

impl Drop for RecorderHandle {
    fn drop(&mut self) {
        self.begin_to_abandon();
        self.stop();
    }
}
