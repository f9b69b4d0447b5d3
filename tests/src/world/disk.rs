//! A disk in memory that fails and waits as planned, and keeps the content that a kill or a power cut leaves.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam::queue::SegQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_replay::log::{Storage, StoredFile};

use super::cable::Clock;
use super::plan::{DiskFault, Ending, Window};
use super::sabotage::Sabotage;
use crate::random::Random;

/// Smallest unit that a power cut leaves intact, bytes.
const SECTOR_BYTES: usize = 512;
/// Linux error number for an input or output error. `ENOSPC` is the number for a full device.
const EIO: i32 = 5;
const ENOSPC: i32 = 28;

enum Done {
    Created(PathBuf),
    Wrote(PathBuf, Vec<u8>),
    Synced(PathBuf),
    /// A sync of this file failed. After the failure, data that wasn't synced before reads as zeros.
    Lost(PathBuf),
    Removed(PathBuf),
}

/// A simulated disk. All clones share one content.
#[derive(Clone)]
pub struct SimulatedDisk {
    clock: Arc<Clock>,
    faults: Arc<[Window<DiskFault>]>,
    /// Operations with the times at which they are complete.
    done: Arc<SegQueue<(MonoNs, Done)>>,
    /// Time at which all operations so far are complete, ns.
    busy_until: Arc<AtomicU64>,
    /// Number of syncs so far.
    syncs: Arc<AtomicU64>,
    /// Fault of each disk operation that failed.
    failed: Arc<SegQueue<DiskFault>>,
    sabotage: Option<Sabotage>,
}

/// A file that is left on the disk after a kill or a power cut.
#[derive(Debug, Clone, Default)]
pub struct LeftFile {
    /// Path of the file.
    pub path: PathBuf,
    /// Content of the file.
    pub bytes: Vec<u8>,
    /// Number of bytes that a power cut can't damage.
    synced: usize,
}

impl SimulatedDisk {
    /// Creates an empty disk with the planned faults `faults`.
    pub fn new(clock: Arc<Clock>, faults: &[Window<DiskFault>], sabotage: Option<Sabotage>) -> Self {
        let (done, failed) = (Arc::new(SegQueue::new()), Arc::new(SegQueue::new()));
        let [busy_until, syncs] = [0; 2].map(|_| Arc::default());
        Self { clock, faults: faults.into(), done, busy_until, syncs, failed, sabotage }
    }

    /// Time at which the last operation is complete. The caller of the last operation waits until this time.
    pub fn busy_until(&self) -> MonoNs {
        MonoNs(self.busy_until.load(Ordering::SeqCst))
    }

    /// Number of syncs so far.
    pub fn syncs(&self) -> u64 {
        self.syncs.load(Ordering::SeqCst)
    }

    /// Time at which a new operation begins: now, or at the end of all earlier operations.
    fn begins(&self) -> MonoNs {
        self.clock.now().max(self.busy_until())
    }

    /// Performs an operation when all earlier operations are complete. Returns the time of its completion.
    fn take_turn(&self, is_sync: bool) -> MonoNs {
        let begins = self.begins();
        let active = self.faults.iter().filter(|window| window.holds(begins));
        let waits_ns = active.map(|window| match window.what {
            DiskFault::OpsLimited { per_s } => 1_000_000_000 / i64::from(per_s),
            DiskFault::SyncsSlow { ms } if is_sync => i64::from(ms) * 1_000_000,
            _ => 0,
        });
        let complete = begins + DurNs(waits_ns.max().unwrap_or_default());
        self.busy_until.store(complete.0, Ordering::SeqCst);
        complete
    }

    /// Number of disk operations that have failed so far.
    pub fn failures(&self) -> usize {
        self.failed.len()
    }

    /// Returns the files that are left on the disk after the dive. If the dive ends by a kill or a power cut,
    /// operations that are not complete at that moment have no effect. After a power cut, unsynced data is also cut off
    /// or has holes.
    pub fn left(&self, ending: Ending, random: &mut Random) -> Vec<LeftFile> {
        let mut files: Vec<LeftFile> = Vec::new();
        while let Some((complete, done)) = self.done.pop() {
            if ending != Ending::Finished && complete > self.clock.now() {
                break;
            }
            match done {
                Done::Created(path) => files.push(LeftFile { path, ..LeftFile::default() }),
                Done::Removed(path) => files.retain(|file| file.path != path),
                Done::Wrote(path, bytes) => of(&mut files, &path).bytes.extend(bytes),
                Done::Synced(path) => {
                    let file = of(&mut files, &path);
                    file.synced = file.bytes.len();
                }
                Done::Lost(path) => {
                    let file = of(&mut files, &path);
                    let from = file.synced;
                    file.bytes[from..].fill(0);
                }
            }
        }
        if ending == Ending::PowerCut {
            for file in &mut files {
                tear(file, random);
            }
        }
        files
    }

    fn try_to(&self, faults: &[DiskFault]) -> io::Result<()> {
        let now = self.begins();
        match self.faults.iter().find(|window| faults.contains(&window.what) && window.holds(now)) {
            None => Ok(()),
            Some(Window { what, .. }) => {
                self.failed.push(*what);
                Err(io::Error::from_raw_os_error(if *what == DiskFault::Full { ENOSPC } else { EIO }))
            }
        }
    }
}

fn of<'a>(files: &'a mut [LeftFile], path: &Path) -> &'a mut LeftFile {
    files.iter_mut().find(|file| file.path == path).unwrap()
}

/// Keeps or drops each unsynced sector at random. The new length is at least the synced length.
fn tear(file: &mut LeftFile, random: &mut Random) {
    let unsynced = file.bytes.len() - file.synced;
    file.bytes.truncate(file.synced + random.below(unsynced + 1));
    let first = file.synced.div_ceil(SECTOR_BYTES) * SECTOR_BYTES;
    for at in (first..file.bytes.len()).step_by(SECTOR_BYTES) {
        if random.one_in(3) {
            let to = (at + SECTOR_BYTES).min(file.bytes.len());
            file.bytes[at..to].fill(0);
        }
    }
}

impl Storage for SimulatedDisk {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        self.try_to(&[DiskFault::CreateFails, DiskFault::Full])?;
        self.done.push((self.take_turn(true), Done::Created(path.to_owned())));
        Ok(Box::new(OpenFile { disk: self.clone(), path: path.to_owned(), turn: 0 }))
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.done.push((self.take_turn(false), Done::Removed(path.to_owned())));
        Ok(())
    }

    fn free_bytes(&mut self, _: &Path) -> Option<u64> {
        None
    }
}

struct OpenFile {
    disk: SimulatedDisk,
    path: PathBuf,
    turn: u64,
}

impl StoredFile for OpenFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.disk.try_to(&[DiskFault::WriteFails, DiskFault::Full])?;
        let now = self.disk.begins();
        let in_part =
            |window: &Window<DiskFault>| window.what == DiskFault::WritesInPart && window.holds(now);
        self.turn += 1;
        if self.disk.sabotage == Some(Sabotage::DiskForgets) && self.turn.is_multiple_of(40) {
            return Ok(bytes.len());
        }
        let count = if self.disk.faults.iter().any(in_part) {
            if self.turn.is_multiple_of(3) {
                return Err(io::ErrorKind::Interrupted.into());
            }
            bytes.len().div_ceil(2)
        } else if self.disk.sabotage == Some(Sabotage::WritesSectors) {
            bytes.len().min(SECTOR_BYTES)
        } else {
            bytes.len()
        };
        let complete = self.disk.take_turn(false);
        self.disk.done.push((complete, Done::Wrote(self.path.clone(), bytes[..count].to_vec())));
        Ok(count)
    }

    fn sync(&mut self) -> io::Result<()> {
        if self.disk.sabotage == Some(Sabotage::SyncLies) {
            return Ok(());
        }
        let synced = self.disk.try_to(&[DiskFault::SyncFails]);
        let path = self.path.clone();
        let done = if synced.is_ok() { Done::Synced(path) } else { Done::Lost(path) };
        self.disk.done.push((self.disk.take_turn(true), done));
        self.disk.syncs.fetch_add(1, Ordering::SeqCst);
        synced
    }
}
