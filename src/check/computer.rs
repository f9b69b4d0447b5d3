//! Tests of the computer before a dive: sync time of the recording's disk, free space, and spare CPU.

use std::fs::{File, OpenOptions};
use std::io::{self, Write as _};
use std::path::Path;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crossbeam::channel::{Receiver, RecvTimeoutError, Sender, bounded};
use headrace_geometry::time::DurNs;

use crate::failure::Failure;

/// Bytes that are written before each sync. Four heads and their results take about as much in half a second.
static PIECE: [u8; 64 << 10] = [0; 64 << 10];
/// Interval between syncs, as in a recording (docs/reference/recorder.md).
const EVERY: Duration = Duration::from_millis(500);

/// Test of the disk on which a folder is: a thread writes and syncs a file, as a recorder does.
pub(super) struct DiskTest {
    stop: Sender<()>,
    thread: JoinHandle<Disk>,
}

/// Result of the disk's test.
pub(super) struct Disk {
    /// Median and longest duration of a sync.
    pub(super) syncs: io::Result<[DurNs; 2]>,
    /// Free space, bytes; `None` if the system doesn't report it.
    pub(super) free_bytes: Option<u64>,
}

impl DiskTest {
    /// Starts the test. It removes its file at the end.
    ///
    /// Errors: the folder doesn't exist, no file can be created in it, or the thread can't be started.
    pub(super) fn start(folder: &Path) -> Result<Self, Failure> {
        let path = folder.join(format!("headrace-check-{}.tmp", std::process::id()));
        let file = OpenOptions::new().write(true).create_new(true).open(&path);
        let file = file.map_err(|source| Failure::Unwritable { path: path.clone(), source })?;
        let (stop, stopped) = bounded(0);
        let test = move || {
            let disk = Disk::test(file, &stopped);
            if let Err(error) = std::fs::remove_file(&path) {
                tracing::warn!(%error, path = %path.display(), "the disk test's file could not be removed");
            }
            disk
        };
        let thread = thread::Builder::new().name("disk".to_owned()).spawn(test);
        let thread = thread.map_err(|source| Failure::System { what: "starting the disk's test", source })?;
        Ok(Self { stop, thread })
    }

    /// Ends the test.
    pub(super) fn end(self) -> Disk {
        drop(self.stop);
        let ended_early =
            |_| Disk { syncs: Err(io::Error::other("its thread has ended early")), free_bytes: None };
        self.thread.join().unwrap_or_else(ended_early)
    }
}

impl Disk {
    fn test(mut file: File, stopped: &Receiver<()>) -> Self {
        let mut syncs = Vec::new();
        let mut failed = None;
        while failed.is_none() {
            let begun = headrace_ports::now();
            failed = file.write_all(&PIECE).and_then(|()| file.sync_data()).err();
            syncs.push(headrace_ports::now().since(begun));
            if stopped.recv_timeout(EVERY) != Err(RecvTimeoutError::Timeout) {
                break;
            }
        }
        syncs.sort();
        let median = syncs.get(syncs.len() / 2).copied().unwrap_or_default();
        let longest = syncs.last().copied().unwrap_or_default();
        let space = rustix::fs::fstatvfs(&file).ok();
        Self {
            syncs: failed.map_or(Ok([median, longest]), Err),
            free_bytes: space.map(|space| space.f_bavail.saturating_mul(space.f_frsize)),
        }
    }
}

/// Time that all cores together have worked and have been idle since the system started, in the kernel's ticks.
pub(super) struct CpuTimes {
    idle: u64,
    all: u64,
    cores: usize,
}

impl CpuTimes {
    /// Reads the times; `None` if the system doesn't report them. Source: `proc_stat(5)`.
    pub(super) fn read() -> Option<Self> {
        let text = std::fs::read_to_string("/proc/stat").ok()?;
        let all = text.lines().next()?.strip_prefix("cpu ")?;
        // Only eight times are added, because the first two already contain the times that follow.
        let times: Vec<u64> = all.split_whitespace().take(8).filter_map(|time| time.parse().ok()).collect();
        let [_, _, _, idle, waiting, ..] = times[..] else { return None };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Some(Self { idle: idle + waiting, all: times.iter().sum(), cores })
    }

    /// Mean number of cores that have been idle since `before`, and number of all cores.
    pub(super) fn spare_since(&self, before: &Self) -> (f64, usize) {
        let all = self.all.saturating_sub(before.all).max(1);
        let idle = self.idle.saturating_sub(before.idle);
        (self.cores as f64 * idle as f64 / all as f64, self.cores)
    }
}
