//! The recorder: a [`LogWriter`] on a thread of its own, behind a lock-free queue.
//!
//! The loop must neither wait for a disk nor lose a byte. It asks [`RecorderPort::vacant_bytes`] before it takes in
//! more, and leaves packets in their ports' rings while the queue is full.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crossbeam::queue::ArrayQueue;
use headrace_core::time::MonoNs;
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer as _, Observer as _, Producer as _};
use ringbuf::wrap::{Cons, Prod};

use super::LogError;
use super::companion::{Companion, Made};
use super::fields::Fields;
use super::format::{TICK_HEAD_BYTES, order_bytes, tick_head};
use super::space::{LONGEST_KEPT_BYTES, Space};
use super::writer::{Lane, LogHeader, LogWriter, Summary};

/// Bytes before each entry in the queue: kind, a spare byte, number, length, log time, publish time.
const ENTRY_HEAD_BYTES: usize = 24;
/// A queue is never smaller than that: the longest packet of a port, and a tick that names many.
const MIN_QUEUE_BYTES: usize = 64 * 1024;
/// How long the thread sleeps when the queue is empty. The loop can't wake it: that would be a system call.
const NAP: Duration = Duration::from_millis(2);
/// How often a chunk is closed and brought to the medium. Half of the second that a power cut may cost, since closing
/// and syncing take their time too.
const FLUSH_PERIOD: Duration = Duration::from_millis(500);
/// Messages to devices that may wait: some seconds of eight heads.
const SENT_MESSAGES: usize = 2048;
/// Entries between two looks at the clock.
const BATCH: usize = 256;

/// An entry that the queue has no room for; nothing of it was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the recorder's queue has room for {free} bytes and an entry needs {needed}")]
pub struct Full {
    /// Free bytes.
    pub free: usize,
    /// Bytes needed.
    pub needed: usize,
}

/// Starts recorders.
pub struct Recorder;

/// The loop's end. Its methods neither block, nor allocate, nor call the system.
pub struct RecorderPort {
    /// Without a cached index, so that the port can be a resource of the loop's world, which wants `Sync`.
    ring: Prod<Arc<HeapRb<u8>>>,
    state: Arc<State>,
    result_channels: usize,
}

/// The end for those who start and finish the recorder. Dropped without [`RecorderHandle::finish`] it still completes
/// the file, but nobody hears of errors.
pub struct RecorderHandle {
    thread: Option<JoinHandle<Result<Summary, LogError>>>,
    state: Arc<State>,
}

struct State {
    stopping: AtomicBool,
    failed: AtomicBool,
    /// What the ports' threads have sent to the devices: it doesn't pass the loop.
    sent: ArrayQueue<SentMessage>,
    sent_dropped: AtomicU64,
}

/// Bytes sent to a device.
struct SentMessage {
    source: u16,
    at: MonoNs,
    bytes: Vec<u8>,
}

/// Takes what is sent to devices into the log, from any thread. When the queue is full the oldest is dropped, and counted.
#[derive(Clone)]
pub struct SentPort {
    state: Arc<State>,
}

impl SentPort {
    /// Bytes sent to `source`. Never blocks.
    pub fn sent(&self, source: u16, at: MonoNs, bytes: &[u8]) {
        let message = SentMessage { source, at, bytes: bytes.to_vec() };
        if self.state.sent.force_push(message).is_some() {
            self.state.sent_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// How many messages were dropped.
    pub fn dropped(&self) -> u64 {
        self.state.sent_dropped.load(Ordering::Relaxed)
    }
}

impl Recorder {
    /// Starts a recorder that writes to `writer`, with a queue of `queue_bytes`. The header is written before this
    /// returns. Where flushing `writer` doesn't bring the bytes to the medium, a power cut costs more than a second.
    ///
    /// Errors: the header could not be written, or the thread not be started.
    pub fn start<W: Write + Send + 'static>(
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        Self::start_within(Space::endless(), writer, header, queue_bytes, None)
    }

    /// The same with a companion, which makes more messages of the results that are written.
    ///
    /// Errors: as for [`Recorder::start`].
    pub fn start_with<W: Write + Send + 'static>(
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
        companion: Box<dyn Companion>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        Self::start_within(Space::endless(), writer, header, queue_bytes, Some(companion))
    }

    /// The same where room may end.
    pub(super) fn start_within<W: Write + Send + 'static>(
        space: Space,
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
        companion: Option<Box<dyn Companion>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let mut log = LogWriter::new(writer, header)?;
        log.flush()?;
        let ring = Arc::new(HeapRb::new(queue_bytes.max(MIN_QUEUE_BYTES)));
        let state = Arc::new(State {
            stopping: AtomicBool::new(false),
            failed: AtomicBool::new(false),
            sent: ArrayQueue::new(SENT_MESSAGES),
            sent_dropped: AtomicU64::new(0),
        });
        let queue = Queue { ring: Cons::new(Arc::clone(&ring)), message: Vec::new() };
        let thread_state = Arc::clone(&state);
        let thread = thread::Builder::new().name("recorder".to_owned());
        let echoes = header.results.iter().map(|result| result.follows_echoes).collect();
        let beside = Beside { companion, made: Vec::new() };
        let thread = thread.spawn(move || Worker::new(log, space, echoes, beside, &thread_state).run(queue));
        let thread = Some(thread.map_err(|source| LogError::Thread { source })?);
        let port = RecorderPort {
            ring: Prod::new(ring),
            state: Arc::clone(&state),
            result_channels: header.results.len(),
        };
        Ok((port, RecorderHandle { thread, state }))
    }

    /// Starts a recorder that writes to a new file, which is brought to the medium at each flush. It warns when the disk fills,
    /// and then leaves out echoes before anything else: [`Summary::left_out`].
    ///
    /// Errors: as for [`Recorder::start`]; the file exists (a dive is never overwritten) or can't be made.
    pub fn create(
        path: &Path,
        header: &LogHeader,
        queue_bytes: usize,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let (space, file) = new_file(path)?;
        Self::start_within(space, file, header, queue_bytes, None)
    }

    /// The same with a companion.
    ///
    /// Errors: as for [`Recorder::create`].
    pub fn create_with(
        path: &Path,
        header: &LogHeader,
        queue_bytes: usize,
        companion: Box<dyn Companion>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let (space, file) = new_file(path)?;
        Self::start_within(space, file, header, queue_bytes, Some(companion))
    }
}

fn new_file(path: &Path) -> Result<(Space, SyncedFile), LogError> {
    let failed = |source| LogError::Create { path: path.to_owned(), source };
    let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(failed)?;
    sync_folder_of(path).map_err(failed)?;
    let space = file.try_clone().map_or_else(|_| Space::endless(), Space::of);
    Ok((space, SyncedFile(BufWriter::new(file))))
}

/// Makes the entry of a new file in its folder survive a power cut. Other systems than Unix don't open folders.
fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if cfg!(unix) { File::open(folder.unwrap_or(Path::new(".")))?.sync_all() } else { Ok(()) }
}

/// A file whose flush reaches the medium.
struct SyncedFile(BufWriter<File>);

impl Write for SyncedFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()?;
        self.0.get_ref().sync_data()
    }
}

impl RecorderPort {
    /// Bytes from `source`, received at `received` and valid for `valid`.
    ///
    /// Errors: no room; nothing was written.
    pub fn raw(&mut self, source: u16, received: MonoNs, valid: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Raw(source), received, valid, bytes)
    }

    /// Bytes sent to `source`.
    ///
    /// Errors: no room; nothing was written.
    pub fn sent(&mut self, source: u16, at: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Sent(source), at, at, bytes)
    }

    /// A tick, and the numbers of the sources in the order in which it consumed their packets.
    ///
    /// Errors: no room; nothing was written.
    pub fn tick(&mut self, index: u64, now: MonoNs, order: &[u16]) -> Result<(), Full> {
        let len = TICK_HEAD_BYTES.saturating_add(order.len().saturating_mul(2));
        self.begin(Lane::Tick, now, now, len)?;
        // `begin` has found room for the whole entry, whose length is a u32; so the count is one too.
        self.ring.push_slice(&tick_head(index, now, u32::try_from(order.len()).unwrap_or(u32::MAX)));
        self.ring.push_iter(order_bytes(order));
        Ok(())
    }

    /// A message of the result with that number.
    ///
    /// Errors: no room; nothing was written.
    pub fn result(&mut self, channel: u16, time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Result(channel), time, time, bytes)
    }

    /// How many channels for results the log has.
    pub fn result_channels(&self) -> usize {
        self.result_channels
    }

    /// Free bytes of the queue.
    pub fn vacant_bytes(&self) -> usize {
        self.ring.vacant_len()
    }

    /// Bytes of the queue when it is empty: an entry that needs more never fits.
    pub fn capacity_bytes(&self) -> usize {
        self.ring.capacity().get()
    }

    /// Bytes that an entry takes in the queue for a message of `len` bytes.
    pub const fn entry_bytes(len: usize) -> usize {
        ENTRY_HEAD_BYTES.saturating_add(len)
    }

    /// Bytes that the entry of a tick takes which consumed `packets`.
    pub const fn tick_entry_bytes(packets: usize) -> usize {
        Self::entry_bytes(TICK_HEAD_BYTES.saturating_add(packets.saturating_mul(2)))
    }

    /// Whether the recorder has failed. It then discards what it is given, so that the dive can go on.
    pub fn failed(&self) -> bool {
        self.state.failed.load(Ordering::Acquire)
    }

    fn push(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.begin(lane, log_time, publish_time, bytes.len())?;
        self.ring.push_slice(bytes);
        Ok(())
    }

    /// Finds room for an entry whose message has `len` bytes, and writes its head. The thread takes an entry only when
    /// all of it is there.
    fn begin(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, len: usize) -> Result<(), Full> {
        let (free, needed) = (self.vacant_bytes(), Self::entry_bytes(len));
        let len = u32::try_from(len).ok().filter(|_| needed <= free).ok_or(Full { free, needed })?;
        let (kind, number) = match lane {
            Lane::Raw(source) => (0_u8, source),
            Lane::Sent(source) => (1, source),
            Lane::Tick => (2, 0),
            Lane::Result(channel) => (3, channel),
        };
        let mut head = [0; ENTRY_HEAD_BYTES];
        let values = [kind, 0].into_iter().chain(number.to_le_bytes()).chain(len.to_le_bytes());
        let values = values.chain(log_time.0.to_le_bytes()).chain(publish_time.0.to_le_bytes());
        head.iter_mut().zip(values).for_each(|(byte, value)| *byte = value);
        self.ring.push_slice(&head);
        Ok(())
    }
}

impl RecorderHandle {
    /// Whether the recorder has failed; [`RecorderHandle::finish`] says why.
    pub fn failed(&self) -> bool {
        self.state.failed.load(Ordering::Acquire)
    }

    /// An end for what is sent to the devices.
    pub fn sent_port(&self) -> SentPort {
        SentPort { state: Arc::clone(&self.state) }
    }

    /// Writes what is in the queue and the summary, and ends the thread.
    ///
    /// Errors: whatever went wrong on the thread since its start.
    pub fn finish(mut self) -> Result<Summary, LogError> {
        self.stop().unwrap_or(Err(LogError::Panicked))
    }

    fn stop(&mut self) -> Option<Result<Summary, LogError>> {
        self.state.stopping.store(true, Ordering::Release);
        let thread = self.thread.take()?;
        thread.thread().unpark();
        Some(thread.join().unwrap_or(Err(LogError::Panicked)))
    }
}

impl Drop for RecorderHandle {
    fn drop(&mut self) {
        self.stop();
    }
}

/// The thread's end of the queue.
struct Queue {
    ring: Cons<Arc<HeapRb<u8>>>,
    /// The message of the entry taken last.
    message: Vec<u8>,
}

struct Entry {
    lane: Lane,
    log_time: MonoNs,
    publish_time: MonoNs,
}

impl Queue {
    /// The next entry, if all of it is there; its message is then in `message`.
    fn take(&mut self) -> Option<Entry> {
        let mut head = [0; ENTRY_HEAD_BYTES];
        if self.ring.peek_slice(&mut head) < ENTRY_HEAD_BYTES {
            return None;
        }
        let mut fields = Fields::new(&head);
        let (kind, _, number) = (fields.u8()?, fields.u8()?, fields.u16()?);
        let len = usize::try_from(fields.u32()?).ok()?;
        if self.ring.occupied_len() < ENTRY_HEAD_BYTES + len {
            return None;
        }
        let lane = match kind {
            0 => Lane::Raw(number),
            1 => Lane::Sent(number),
            2 => Lane::Tick,
            _ => Lane::Result(number),
        };
        self.ring.skip(ENTRY_HEAD_BYTES);
        self.message.resize(len, 0);
        self.ring.pop_slice(&mut self.message);
        Some(Entry { lane, log_time: MonoNs(fields.u64()?), publish_time: MonoNs(fields.u64()?) })
    }
}

/// What the thread does.
struct Worker<'a, W: Write> {
    /// `None` once it has failed.
    log: Option<LogWriter<W>>,
    error: Option<LogError>,
    discarded: u64,
    flushed: Instant,
    /// Whether something was written since.
    open: bool,
    space: Space,
    /// Which results follow echo by echo.
    echoes: Vec<bool>,
    beside: Beside,
    state: &'a State,
}

/// A companion, and room for what it makes.
struct Beside {
    companion: Option<Box<dyn Companion>>,
    made: Vec<Made>,
}

#[expect(
    clippy::disallowed_methods,
    reason = "how long a chunk stays open is wall time, and no result depends on it"
)]
fn wall_clock() -> Instant {
    Instant::now()
}

impl<'a, W: Write> Worker<'a, W> {
    fn new(log: LogWriter<W>, space: Space, echoes: Vec<bool>, beside: Beside, state: &'a State) -> Self {
        let flushed = wall_clock();
        Self { log: Some(log), error: None, discarded: 0, flushed, open: false, space, echoes, beside, state }
    }

    fn run(mut self, mut queue: Queue) -> Result<Summary, LogError> {
        loop {
            self.space.look(wall_clock());
            // Read before the queue is looked at: what was pushed before the flag was set is then taken.
            let stopping = self.state.stopping.load(Ordering::Acquire);
            let taken =
                (0..BATCH).map_while(|_| queue.take().map(|entry| self.write_all(&entry, &queue.message)));
            let taken = taken.count() + self.write_sent();
            self.flush_in_time();
            if taken == 0 && stopping {
                return self.finish();
            }
            if taken == 0 {
                thread::park_timeout(NAP);
            }
        }
    }

    /// Writes an entry and what the companion makes of it.
    fn write_all(&mut self, entry: &Entry, message: &[u8]) {
        self.write(entry, message);
        if let Lane::Result(number) = entry.lane {
            self.write_made(|companion, made| companion.take(number, entry.log_time, message, made));
        }
    }

    fn write_made(&mut self, make: impl FnOnce(&mut dyn Companion, &mut Vec<Made>)) {
        // Of a dive that goes on unrecorded nothing is to be made.
        let Some(companion) = self.beside.companion.as_mut().filter(|_| self.log.is_some()) else { return };
        let mut made = core::mem::take(&mut self.beside.made);
        make(companion.as_mut(), &mut made);
        for Made { channel, at, bytes } in made.drain(..) {
            if usize::from(channel) < self.echoes.len() {
                self.write(&Entry { lane: Lane::Result(channel), log_time: at, publish_time: at }, &bytes);
            }
        }
        self.beside.made = made;
    }

    fn write(&mut self, entry: &Entry, message: &[u8]) {
        self.discarded += u64::from(self.log.is_none());
        self.open = true;
        let result = |number: u16| self.echoes.get(usize::from(number)).copied().unwrap_or_default();
        let is_echo = match entry.lane {
            Lane::Raw(_) => message.len() > LONGEST_KEPT_BYTES,
            Lane::Result(number) => result(number),
            Lane::Sent(_) | Lane::Tick => false,
        };
        if is_echo && self.space.is_scarce() {
            return self.attempt(|log, space| space.leave_out(entry.log_time, message.len(), log));
        }
        self.attempt(|log, _| log.message(entry.lane, entry.log_time, entry.publish_time, message));
    }

    /// Writes what has been sent to the devices; gives the number of messages.
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
            self.attempt(|log, _| log.flush());
            (self.flushed, self.open) = (now, false);
        }
    }

    fn attempt(&mut self, action: impl FnOnce(&mut LogWriter<W>, &mut Space) -> Result<(), LogError>) {
        let Some(log) = self.log.as_mut() else { return };
        if let Err(error) = action(log, &mut self.space) {
            tracing::error!("the dive goes on unrecorded: {error}");
            self.error = Some(error);
            self.log = None;
            self.state.failed.store(true, Ordering::Release);
        }
    }

    fn finish(mut self) -> Result<Summary, LogError> {
        self.write_made(|companion, made| companion.end(made));
        let left_out = self.space.left_out();
        if let Some((from, to)) = left_out.span {
            self.attempt(|log, _| log.lost(Some(from), Some(to), &left_out.words()));
        }
        let finished = match (self.log, self.error) {
            (Some(log), _) => log.finish().map(|(_, summary)| Summary { left_out, ..summary }),
            (None, Some(error)) => {
                Err(LogError::Stopped { discarded: self.discarded, source: Box::new(error) })
            }
            (None, None) => Err(LogError::Panicked),
        };
        if finished.is_err() {
            self.state.failed.store(true, Ordering::Release);
        }
        finished
    }
}
