//! States of a live dive's loop, saved so that an interrupted dive can be continued quickly.
//!
//! A state is valid only for the program that saved it and for the packets that led to it. It only saves time, because
//! without it the whole log is replayed.

use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crossbeam::channel::{Sender, bounded};
use headrace_geometry::snapshot::{Restorer, Saver, SnapshotError};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::merge::Inbox;
use headrace_monitor::run::Loop;
use headrace_sensor::reading::SourceId;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh64::xxh64;

use crate::atomic_file::AtomicFile;
use crate::log::file_digest;

/// Interval between two saved states. Replaying ten minutes of a log takes only some seconds.
const INTERVAL: DurNs = DurNs::from_millis(600_000);
/// Bytes of a state written at a time.
const PIECE_BYTES: usize = 1 << 20;
/// Maximum size of a state, bytes.
const MAX_BYTES: u64 = 1 << 30;

/// Number of packets that a loop has consumed, and their digest in the order of consumption.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Consumed {
    /// Number of packets.
    pub packets: u64,
    digest: u64,
}

impl Consumed {
    /// Adds a packet to the number and the digest.
    pub fn add(&mut self, source: SourceId, received: MonoNs, bytes: &[u8]) {
        self.packets += 1;
        let head = xxh64(&u64::from(source.0).to_le_bytes(), self.digest);
        self.digest = xxh64(bytes, xxh64(&received.0.to_le_bytes(), head));
    }

    /// Adds the packets of a tick to the number and the digest.
    pub fn add_tick(&mut self, inbox: &Inbox) {
        inbox.iter().for_each(|(source, packet)| self.add(source, packet.received, packet.bytes));
    }
}

/// A saved state.
#[derive(Debug)]
pub struct SavedState {
    /// Packets that led to the state.
    pub consumed: Consumed,
    /// Snapshot of the loop in this state.
    pub snapshot: Vec<u8>,
}

impl SavedState {
    /// Returns the path at which the state for a recording is saved.
    pub fn path(recording: &Path) -> PathBuf {
        let name = recording.file_name().unwrap_or_default().to_string_lossy();
        recording.with_file_name(format!("{name}.state"))
    }

    /// Reads a state. `None` if there is none, or if another program saved it.
    pub fn read(path: &Path) -> Option<Self> {
        let bytes = crate::regular_file::read(path, MAX_BYTES).ok()?;
        let mut from = Restorer::new(&bytes);
        let read = Self::restore(&mut from);
        if let Err(error) = &read {
            tracing::warn!("{} can't be used: {error}", path.display());
        }
        read.ok()
    }

    fn restore(from: &mut Restorer<'_>) -> Result<Self, SnapshotError> {
        from.part("saved state")?;
        let program: String = from.value()?;
        if program.is_empty() || program != this_program() {
            return Err(from.unfit("another program saved it".to_owned()));
        }
        let (consumed, checksum): (Consumed, u64) = (from.value()?, from.value()?);
        let snapshot = from.raw()?;
        if xxh64(snapshot, 0) != checksum {
            return Err(from.unfit("its checksum is wrong".to_owned()));
        }
        Ok(Self { consumed, snapshot: snapshot.to_vec() })
    }

    /// Writes the state for the running program.
    ///
    /// Errors: system errors.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        self.write_for(&this_program(), path, &AtomicBool::new(false))
    }

    /// Writes the state in pieces, so that the recording can be written to the medium between two pieces.
    fn write_for(&self, program: &str, path: &Path, ended: &AtomicBool) -> std::io::Result<()> {
        let mut to = Saver::default();
        to.part("saved state");
        to.value(program);
        to.value(&self.consumed);
        to.value(&xxh64(&self.snapshot, 0));
        to.raw(&self.snapshot);
        let bytes = to.finish().map_err(std::io::Error::other)?;
        let mut file = AtomicFile::create(path)?;
        for piece in bytes.chunks(PIECE_BYTES) {
            file.write_all(piece)?;
            file.sync()?;
            if ended.load(Ordering::Relaxed) {
                return Ok(());
            }
        }
        file.complete()
    }
}

/// Digest of the running program; empty if its file can't be read.
fn this_program() -> String {
    std::env::current_exe().ok().and_then(|path| file_digest(&path).ok()).unwrap_or_default()
}

/// Saves states of a live dive's loop on a thread of its own.
pub struct StateKeeper {
    path: PathBuf,
    consumed: Consumed,
    /// Time at which the next state is to be saved.
    due: Option<MonoNs>,
    /// A state, and its time. The state is written once all its packets are on the recording's medium.
    waiting: Option<(MonoNs, SavedState)>,
    states: Sender<SavedState>,
    ended: Arc<AtomicBool>,
}

impl StateKeeper {
    /// Starts to save states of a dive beside its recording. The dive has no packets yet.
    ///
    /// Errors: the thread can't be started.
    pub fn start(recording: &Path) -> std::io::Result<Self> {
        let path = SavedState::path(recording);
        let (states, received) = bounded::<SavedState>(0);
        let ended = Arc::new(AtomicBool::new(false));
        let (to, is_over) = (path.clone(), Arc::clone(&ended));
        std::thread::Builder::new().name("states".to_owned()).spawn(move || {
            let program = this_program();
            for state in &received {
                if let Err(error) = state.write_for(&program, &to, &is_over) {
                    tracing::warn!(
                        "writing {}: {error}; continuing the dive would take longer",
                        to.display()
                    );
                }
                if is_over.load(Ordering::Relaxed) {
                    remove(&to);
                }
            }
        })?;
        Ok(Self { path, consumed: Consumed::default(), due: None, waiting: None, states, ended })
    }

    /// Sets the number and digest of the dive's packets, after its state has been rebuilt. The next tick saves the
    /// state.
    pub fn counted(&mut self, consumed: Consumed) {
        (self.consumed, self.due) = (consumed, Some(MonoNs(0)));
    }

    /// Counts the packets of a tick, and saves the loop's state if that is due. Call it after every tick.
    ///
    /// Data up to `safe_to` is on the medium. A state is written only once all its packets are on the medium.
    pub fn after_tick(&mut self, dive: &Loop, safe_to: MonoNs) {
        self.consumed.add_tick(&dive.view().placed().inbox);
        if let Some((_, state)) = self.waiting.take_if(|(at, _)| safe_to >= *at) {
            // If the thread is still writing the previous state, this state is dropped.
            drop(self.states.try_send(state));
        }
        let now = dive.now();
        if now < *self.due.get_or_insert(now + INTERVAL) {
            return;
        }
        self.due = Some(now + INTERVAL);
        match dive.save() {
            Ok(snapshot) => self.waiting = Some((now, SavedState { consumed: self.consumed, snapshot })),
            Err(error) => tracing::warn!("{error}"),
        }
    }

    /// Removes the state of a dive that has ended in order.
    pub fn end(self) {
        self.ended.store(true, Ordering::Relaxed);
        remove(&self.path);
    }
}

fn remove(path: &Path) {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            tracing::warn!("{} is left behind: {error}", path.display());
        }
        Ok(()) | Err(_) => {}
    }
}
