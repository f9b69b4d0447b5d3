//! The recorder: a [`LogWriter`] on its own thread, behind a lock-free queue.
//!
//! The loop must neither wait for a disk nor lose a byte. It checks [`RecorderPort::vacant_bytes`] before it consumes
//! more, and leaves packets in their ports' rings while the queue is full.

use std::fs::{File, OpenOptions};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::MonoNs;
use headrace_monitor::byte_ring::ByteProducer as _;
use ringbuf::HeapRb;
use ringbuf::traits::Observer as _;
use ringbuf::wrap::{Cons, Prod};

use super::LogError;
use super::derived_channels::DerivedChannels;
use super::format::{TICK_HEAD_BYTES, order_bytes, tick_head};
use super::part::part_path;
use super::queue::{ENTRY_HEAD_BYTES, Entries, Full, Queue, SentMessage, State};
use super::rotate::{Parts, Rotation, in_the_way};
use super::space::Space;
use super::worker::{Beside, Echoes, Worker};
use super::writer::{Lane, LogHeader, LogWriter, Summary};

/// Minimum queue size: fits the longest packet of a port, and a tick with many packets.
const MIN_QUEUE_BYTES: usize = 64 * 1024;
/// Capacity for messages to devices: some seconds of eight heads.
const SENT_MESSAGES: usize = 2048;

/// Starts recorders.
pub struct Recorder;

/// The loop's end. Its methods don't block, allocate or make system calls.
pub struct RecorderPort {
    /// Without a cached index, so that the port is `Sync` and can be a resource of the loop's world.
    entries: Entries,
    state: Arc<State>,
    result_channels: usize,
}

/// Handle to stop the recorder. If dropped without [`RecorderHandle::finish`] it still completes the file, but errors
/// are discarded.
pub struct RecorderHandle {
    thread: Option<JoinHandle<Result<Summary, LogError>>>,
    state: Arc<State>,
}

/// Logs bytes sent to devices, from any thread. When the queue is full the oldest message is dropped and counted.
#[derive(Clone)]
pub struct SentPort {
    state: Arc<State>,
}

impl SentPort {
    /// Logs bytes sent to `source`. Never blocks.
    pub fn sent(&self, source: u16, at: MonoNs, bytes: &[u8]) {
        let message = SentMessage { source, at, bytes: bytes.to_vec() };
        if self.state.sent.force_push(message).is_some() {
            self.state.sent_dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Number of messages dropped.
    pub fn dropped(&self) -> u64 {
        self.state.sent_dropped.load(Ordering::Relaxed)
    }
}

impl Recorder {
    /// Starts a recorder that writes to `writer`, with a queue of `queue_bytes`. The header is written before this
    /// returns. If flushing `writer` doesn't sync to the medium, a power cut loses more than a second.
    ///
    /// Errors: the header could not be written, or the thread not started.
    pub fn start<W: Write + Send + 'static>(
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        Self::start_within(Space::endless(), writer, header, queue_bytes, None)
    }

    /// The same with limited disk space.
    pub(super) fn start_within<W: Write + Send + 'static>(
        space: Space,
        writer: W,
        header: &LogHeader,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        Self::begin(space, (LogWriter::new(writer, header)?, None), header, queue_bytes, derived)
    }

    /// Starts the thread of a log whose header is written, perhaps in parts.
    fn begin<W: Write + Send + 'static>(
        space: Space,
        (mut log, parts): (LogWriter<W>, Option<Parts<W>>),
        header: &LogHeader,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        log.flush()?;
        let ring = Arc::new(HeapRb::new(queue_bytes.max(MIN_QUEUE_BYTES)));
        let state = Arc::new(State {
            stopping: AtomicBool::new(false),
            failed: AtomicBool::new(false),
            sent: ArrayQueue::new(SENT_MESSAGES),
            sent_dropped: AtomicU64::new(0),
            results_missing: AtomicU64::new(0),
        });
        let queue = Queue { ring: Cons::new(Arc::clone(&ring)), message: Vec::new() };
        let thread_state = Arc::clone(&state);
        let thread = thread::Builder::new().name("recorder".to_owned());
        let echoes = Echoes::of(header);
        let beside = Beside::new(derived);
        let thread =
            thread.spawn(move || Worker::new(log, parts, space, echoes, beside, &thread_state).run(queue));
        let thread = Some(thread.map_err(|source| LogError::Thread { source })?);
        let port = RecorderPort {
            entries: Entries { ring: Prod::new(ring) },
            state: Arc::clone(&state),
            result_channels: header.results.len(),
        };
        Ok((port, RecorderHandle { thread, state }))
    }

    /// Starts a recorder that writes to a new file, synced at each flush. It warns when the disk fills, and then drops
    /// echoes before anything else: [`Summary::left_out`].
    ///
    /// Errors: as for [`Recorder::start`]; the file exists (a dive is never overwritten) or can't be created.
    pub fn create(
        path: &Path,
        header: &LogHeader,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let file = new_file(path)?;
        let space = file.space();
        Self::start_within(space, file, header, queue_bytes, derived)
    }

    /// The same in parts, each a log of its own; `path` names the recording, and [`part_path`] its parts.
    ///
    /// Errors: as for [`Recorder::create`]; also if a file exists that would be taken for a part of this recording.
    pub fn create_in_parts(
        path: &Path,
        header: &LogHeader,
        rotation: &Rotation,
        queue_bytes: usize,
        derived: Option<Box<dyn DerivedChannels>>,
    ) -> Result<(RecorderPort, RecorderHandle), LogError> {
        let failed = |path: &Path, source| LogError::Create { path: path.to_owned(), source };
        if let Some(other) = in_the_way(path).map_err(|source| failed(path, source))? {
            return Err(failed(&other, ErrorKind::AlreadyExists.into()));
        }
        let recording = path.to_owned();
        let open = Box::new(move |number| {
            let path = part_path(&recording, number);
            new_file(&path).map(|file| (path, file))
        });
        let (parts, log) = Parts::begin(rotation, header, open)?;
        // All parts are on one disk.
        let first = part_path(path, 1);
        let space = File::open(&first).map_or_else(|_| Space::endless(), Space::of);
        Self::begin(space, (log, Some(parts)), header, queue_bytes, derived)
    }
}

/// Creates a new file for a log.
fn new_file(path: &Path) -> Result<SyncedFile, LogError> {
    let failed = |source| LogError::Create { path: path.to_owned(), source };
    let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(failed)?;
    sync_folder_of(path).map_err(failed)?;
    tracing::info!(path = %path.display(), "log created");
    Ok(SyncedFile(BufWriter::new(file)))
}

/// Makes a new file's directory entry survive a power cut. Only on Unix: other systems don't open folders.
fn sync_folder_of(path: &Path) -> std::io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if cfg!(unix) { File::open(folder.unwrap_or(Path::new(".")))?.sync_all() } else { Ok(()) }
}

/// A file whose flush syncs to the medium.
struct SyncedFile(BufWriter<File>);

impl SyncedFile {
    fn space(&self) -> Space {
        self.0.get_ref().try_clone().map_or_else(|_| Space::endless(), Space::of)
    }
}

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

    /// A tick, and the numbers of the sources in the order of consumption of their packets.
    ///
    /// Errors: no room; nothing was written.
    pub fn tick(&mut self, index: u64, now: MonoNs, order: &[u16]) -> Result<(), Full> {
        let len = TICK_HEAD_BYTES.saturating_add(order.len().saturating_mul(2));
        self.entries.begin(Lane::Tick, now, now, len)?;
        // `begin` has reserved room for the whole entry, whose length is a u32, so the count fits as well.
        self.entries.put(&tick_head(index, now, u32::try_from(order.len()).unwrap_or(u32::MAX)));
        self.entries.ring.push_each(order_bytes(order));
        Ok(())
    }

    /// A message of result channel `channel`.
    ///
    /// Errors: no room; nothing was written.
    pub fn result(&mut self, channel: u16, time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.push(Lane::Result(channel), time, time, bytes)
    }

    /// Counts a tick whose results didn't all fit.
    pub fn miss_results(&mut self) {
        self.state.results_missing.fetch_add(1, Ordering::Relaxed);
    }

    /// Number of result channels in the log.
    pub fn result_channels(&self) -> usize {
        self.result_channels
    }

    /// Free bytes of the queue.
    pub fn vacant_bytes(&self) -> usize {
        self.entries.ring.vacant_len()
    }

    /// Capacity of the queue, bytes; a larger entry never fits.
    pub fn capacity_bytes(&self) -> usize {
        self.entries.ring.capacity().get()
    }

    /// Bytes in the queue of an entry with a message of `len` bytes.
    pub const fn entry_bytes(len: usize) -> usize {
        ENTRY_HEAD_BYTES.saturating_add(len)
    }

    /// Bytes in the queue of the entry of a tick that consumed `packets`.
    pub const fn tick_entry_bytes(packets: usize) -> usize {
        Self::entry_bytes(TICK_HEAD_BYTES.saturating_add(packets.saturating_mul(2)))
    }

    /// Whether the recorder has failed. It then discards its input, so that the dive can go on.
    pub fn failed(&self) -> bool {
        self.state.failed.load(Ordering::Acquire)
    }

    fn push(&mut self, lane: Lane, log_time: MonoNs, publish_time: MonoNs, bytes: &[u8]) -> Result<(), Full> {
        self.entries.begin(lane, log_time, publish_time, bytes.len())?;
        self.entries.put(bytes);
        Ok(())
    }
}

impl RecorderHandle {
    /// Whether the recorder has failed; [`RecorderHandle::finish`] returns the cause.
    pub fn failed(&self) -> bool {
        self.state.failed.load(Ordering::Acquire)
    }

    /// A port for bytes sent to the devices.
    pub fn sent_port(&self) -> SentPort {
        SentPort { state: Arc::clone(&self.state) }
    }

    /// Writes the rest of the queue and the summary, and ends the thread.
    ///
    /// Errors: any error on the thread since its start.
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
