//! Recordings on a storage with faults. Each operation fails in turn, once or for a while. Every loss is reported, no
//! message is written twice, and no log that was cut off looks complete.

#![expect(
    clippy::disallowed_types,
    reason = "the recorder's end of a test's storage is asked about once a step"
)]

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use headrace_geometry::time::DurNs;

use super::super::{
    DiveLog, Every, LossKind, Recorder, RecordingEvent, Rotation, Storage, StoredFile, Summary, files_of,
    recover,
};
use super::parts::{Folder, all};
use super::*;

/// An operation on the storage, which the test may let fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Op {
    Create,
    Write,
    Sync,
    Remove,
}

/// Decides whether an operation fails, by its kind and number.
type Plan = Box<dyn FnMut(Op, u64) -> Option<io::Error> + Send>;

/// Content of a file, and number of its bytes that are synced, so that they survive a power cut.
#[derive(Debug, Clone, Default)]
struct Content {
    bytes: Vec<u8>,
    synced: usize,
}

struct World {
    files: BTreeMap<PathBuf, Content>,
    ops: u64,
    plan: Plan,
    /// Whether a sync that fails loses the data that it should have written to the disk.
    forgets: bool,
}

impl World {
    fn attempt(&mut self, op: Op) -> io::Result<()> {
        let number = self.ops;
        self.ops += 1;
        (self.plan)(op, number).map_or(Ok(()), Err)
    }
}

#[derive(Clone)]
struct Faulty(Arc<Mutex<World>>);

struct FaultyFile(Faulty, PathBuf);

impl Faulty {
    fn new(plan: impl FnMut(Op, u64) -> Option<io::Error> + Send + 'static) -> Self {
        let plan: Plan = Box::new(plan);
        Self(Arc::new(Mutex::new(World { files: BTreeMap::new(), ops: 0, plan, forgets: false })))
    }

    fn with<T>(&self, act: impl FnOnce(&mut World) -> T) -> T {
        act(&mut self.0.lock().unwrap())
    }

    /// Writes the files into a folder. If `cut` is true, only synced bytes are written, as after a power cut.
    fn store(&self, cut: bool) {
        self.with(|world| {
            for (path, content) in &world.files {
                let len = if cut { content.synced } else { content.bytes.len() };
                std::fs::write(path, &content.bytes[..len]).unwrap();
            }
        });
    }
}

impl Storage for Faulty {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        self.with(|world| {
            world.attempt(Op::Create)?;
            if world.files.contains_key(path) {
                return Err(io::Error::from(io::ErrorKind::AlreadyExists));
            }
            world.files.insert(path.to_owned(), Content::default());
            Ok(())
        })?;
        Ok(Box::new(FaultyFile(self.clone(), path.to_owned())))
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.with(|world| {
            world.attempt(Op::Remove)?;
            world.files.remove(path).map(|_| ()).ok_or(io::ErrorKind::NotFound.into())
        })
    }

    fn free_bytes(&mut self, _: &Path) -> Option<u64> {
        None
    }
}

impl StoredFile for FaultyFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.with(|world| {
            let done = world.attempt(Op::Write);
            // A write that fails may have written a part of its bytes.
            let len = if done.is_err() { bytes.len() / 2 } else { bytes.len().min(3000) };
            world.files.get_mut(&self.1).unwrap().bytes.extend_from_slice(&bytes[..len]);
            done.map(|()| len)
        })
    }

    fn sync(&mut self) -> io::Result<()> {
        self.0.with(|world| {
            let done = world.attempt(Op::Sync);
            let forgets = world.forgets;
            let content = world.files.get_mut(&self.1).unwrap();
            match done {
                Ok(()) => content.synced = content.bytes.len(),
                Err(_) if forgets => content.bytes[content.synced..].fill(0),
                Err(_) => {}
            }
            done
        })
    }
}

const TICKS: u64 = 60;

fn rotation(every: Option<Every>) -> Rotation {
    Rotation { every, dive: "one".to_owned() }
}

/// Records a dive of six seconds, with ten steps per second.
fn dive(folder: &Folder, storage: &Faulty, every: Option<Every>) -> (Summary, Vec<RecordingEvent>) {
    let path = folder.0.join("dive.mcap");
    let begun =
        Recorder::unthreaded(Box::new(storage.clone()), &path, &header(true), &rotation(every), 0, None);
    let (mut port, mut worker) = begun.unwrap();
    let mut events = Vec::new();
    for tick in 0..TICKS {
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 700)).unwrap();
        port.raw(2, at, MonoNs(at.0 - 7), &noise(tick, 16)).unwrap();
        port.tick(tick, at, &[0, 2]).unwrap();
        port.result(0, at, b"{}").unwrap();
        worker.step(Duration::from_millis(100 * tick));
        events.extend(std::iter::from_fn(|| worker.next_event()));
    }
    (worker.finish(Duration::from_millis(100 * TICKS)), events)
}

/// Reads the messages and losses of the recording in a folder.
fn read_back(folder: &Folder) -> (Vec<Seen>, Vec<Loss>) {
    let mut log = DiveLog::open(&files_of(&[folder.0.join("dive.mcap")]).unwrap()).unwrap();
    let seen = all(&mut log);
    (seen, log.losses())
}

fn eio() -> io::Error {
    io::Error::from_raw_os_error(5)
}

/// Returns the messages of a dive without storage faults, and the number of storage operations. The first operations
/// write the header.
fn without_faults(name: &str, every: Option<Every>) -> (Vec<Seen>, u64) {
    let folder = Folder::new(name);
    let storage = Faulty::new(|_, _| None);
    let (summary, events) = dive(&folder, &storage, every);
    storage.store(false);
    let (seen, losses) = read_back(&folder);
    assert_eq!((seen.len() as u64, summary.messages), (4 * TICKS, 4 * TICKS));
    assert_eq!((losses, summary.faults, events), (vec![], vec![], vec![]));
    (seen, storage.with(|world| world.ops))
}

/// Returns the number of storage operations before the first message. They create the first part, and write and sync
/// its header.
fn header_ops() -> u64 {
    let folder = Folder::new("header");
    let storage = Faulty::new(|_, _| None);
    let path = folder.0.join("dive.mcap");
    drop(Recorder::unthreaded(Box::new(storage.clone()), &path, &header(true), &rotation(None), 0, None));
    storage.with(|world| world.ops)
}

#[test]
fn single_storage_fault_is_recorded_and_loses_no_message() {
    for (name, every) in [("once", None), ("once in parts", Some(Every::Span(DurNs::from_millis(2000))))] {
        let (expected, ops) = without_faults(name, every);
        for (at, forgets) in (header_ops()..ops).flat_map(|at| [(at, false), (at, true)]) {
            let folder = Folder::new(name);
            let storage = Faulty::new(move |_, number| (number == at).then(eio));
            storage.with(|world| world.forgets = forgets);
            let (summary, events) = dive(&folder, &storage, every);
            storage.store(false);
            let (seen, losses) = read_back(&folder);
            let which = format!("{name}, operation {at} of {ops}, {forgets}: {:?}", summary.faults);
            assert_eq!(seen, expected, "{which}");
            assert_eq!(summary.messages, 4 * TICKS, "{which}");
            // If the next part can't be created, the present part continues, so there is no fault.
            let Some(fault) = summary.faults.first() else {
                assert!(every.is_some() && losses.is_empty(), "{which}: {losses:?}");
                continue;
            };
            assert_eq!((summary.faults.len(), fault.lost), (1, 0), "{which}");
            assert!(fault.error.contains("Input/output error"), "{which}");
            // If the summary can't be synced, it may still be complete. Everything before the summary is synced.
            if fault.error.contains("the summary") {
                continue;
            }
            assert!(!losses.is_empty(), "{which}");
            let texts: Vec<String> = losses.iter().map(ToString::to_string).collect();
            let is_reported = texts.iter().any(|text| text.contains(&fault.words()));
            assert!(is_reported || fault.continued.is_none(), "{which}: {texts:?}");
            // The part in which the fault occurred must have no end record.
            let (_, alone) = read(&std::fs::read(&fault.path).unwrap());
            let is_cut = |loss: &Loss| matches!(loss.kind, LossKind::Truncated | LossKind::Framing);
            // A part without synced content is removed, and created again under the same name.
            let is_anew = fault.continued.as_ref() == Some(&fault.path);
            assert!(is_anew || alone.iter().any(is_cut), "{which}: {alone:?}");
            if let [RecordingEvent::Failed { .. }, RecordingEvent::Resumed(resumed)] = events.as_slice() {
                assert_eq!(resumed, fault, "{which}");
            }
        }
    }
}

#[test]
fn medium_fault_loses_no_message_if_brief_and_no_earlier_message_if_permanent() {
    let (expected, ops) = without_faults("while", None);
    for from in header_ops()..ops {
        for lasts in [2, 5, u64::MAX] {
            let folder = Folder::new("while");
            let storage = Faulty::new(move |_, number| (number >= from && number - from < lasts).then(eio));
            let (summary, events) = dive(&folder, &storage, None);
            storage.store(false);
            let (seen, losses) = read_back(&folder);
            let which = format!("{lasts} from operation {from} on: {:?}", summary.faults);
            let lost: u64 = summary.faults.iter().map(|fault| fault.lost).sum();
            assert_eq!(summary.messages + lost, 4 * TICKS, "{which}");
            // The log may also contain messages that were written but not synced.
            assert!(expected.starts_with(&seen) && seen.len() as u64 >= summary.messages, "{which}");
            let is_end = summary.faults.iter().all(|fault| fault.error.contains("the summary"));
            assert!(!summary.faults.is_empty() && (is_end || !losses.is_empty()), "{which}");
            // The first part must be kept, even if no other part can be created.
            assert!(folder.0.join("dive.mcap").exists());
            if lasts < u64::MAX && from < ops / 2 {
                assert_eq!((lost, seen.len()), (0, expected.len()), "{which}: {events:?}");
            }
        }
    }
}

#[test]
fn backlog_overflow_loses_and_counts_the_oldest_messages() {
    let folder = Folder::new("long");
    let path = folder.0.join("dive.mcap");
    let failing = Arc::new(std::sync::atomic::AtomicBool::new(false));
    let is_failing = Arc::clone(&failing);
    let storage = Faulty::new(move |_, _| is_failing.load(std::sync::atomic::Ordering::Relaxed).then(eio));
    let begun =
        Recorder::unthreaded(Box::new(storage.clone()), &path, &header(true), &rotation(None), 1 << 20, None);
    let (mut port, mut worker) = begun.unwrap();
    for tick in 0..1500_u64 {
        failing.store((100..1200).contains(&tick), std::sync::atomic::Ordering::Relaxed);
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 20_000)).unwrap();
        port.tick(tick, at, &[0]).unwrap();
        while worker.step(Duration::from_millis(100 * tick)) {}
    }
    let summary = worker.finish(Duration::from_secs(150));
    let [fault] = summary.faults.as_slice() else { panic!("{:?}", summary.faults) };
    assert_eq!(summary.messages + fault.lost, 3000);
    assert!((400..700).contains(&fault.lost), "16 MiB of 22 are kept: {fault:?}");
    storage.store(false);
    let (seen, losses) = read_back(&folder);
    assert_eq!(seen.len() as u64, summary.messages);
    // The messages have one gap of more than 0.1 s. The loss that the log states must have the times at the two ends of
    // this gap.
    let times: Vec<u64> = seen.iter().map(|message| message.1).collect();
    let gaps: Vec<_> = times.windows(2).filter(|pair| pair[1] - pair[0] > 100_000_000).collect();
    let stated = losses.iter().find(
        |loss| matches!(&loss.kind, LossKind::InPart { kind, .. } if matches!(**kind, LossKind::Stated(_))),
    );
    let stated = stated.unwrap();
    assert_eq!(gaps, [&[stated.from.unwrap().0, stated.to.unwrap().0]]);
    assert!(stated.to_string().contains(&format!("{} messages are missing", fault.lost)), "{stated}");
}

#[test]
fn synced_messages_survive_a_power_cut_after_an_error() {
    let (expected, ops) = without_faults("cut", None);
    for at in (header_ops()..ops).step_by(2) {
        let folder = Folder::new("cut");
        let storage = Faulty::new(move |_, number| (number == at).then(eio));
        let path = folder.0.join("dive.mcap");
        let begun =
            Recorder::unthreaded(Box::new(storage.clone()), &path, &header(true), &rotation(None), 0, None);
        let (mut port, mut worker) = begun.unwrap();
        for tick in 0..TICKS / 2 {
            let time = MonoNs((tick + 10) * 100_000_000);
            port.raw(0, time, time, &noise(tick, 700)).unwrap();
            port.raw(2, time, MonoNs(time.0 - 7), &noise(tick, 16)).unwrap();
            port.tick(tick, time, &[0, 2]).unwrap();
            port.result(0, time, b"{}").unwrap();
            worker.step(Duration::from_millis(100 * tick));
        }
        storage.store(true);
        let (seen, losses) = read_back(&folder);
        assert!(expected.starts_with(&seen), "operation {at}");
        // At most seven steps of a tenth of a second are lost. Five of them lie between two syncs, which are half a
        // second apart. The others are lost while the recorder retries.
        assert!(seen.len() as u64 >= 4 * (TICKS / 2 - 7), "operation {at}: {}", seen.len());
        assert!(!losses.is_empty(), "operation {at}");
    }
}

/// Returns how many seconds of a dive are lost if the program is killed. Each sync takes `sync`.
///
/// Every 20 ms a tick and 20 packets arrive.
fn lost_s(sync: Duration) -> f64 {
    const TICK: Duration = Duration::from_millis(20);
    let folder = Folder::new("slow syncs");
    let path = folder.0.join("dive.mcap");
    let waited_ns = Arc::new(std::sync::atomic::AtomicU64::new(0));
    let waits = Arc::clone(&waited_ns);
    let sync_ns = u64::try_from(sync.as_nanos()).unwrap();
    let storage = Faulty::new(move |op, _| {
        if op == Op::Sync {
            waits.fetch_add(sync_ns, std::sync::atomic::Ordering::Relaxed);
        }
        None
    });
    let begun =
        Recorder::unthreaded(Box::new(storage.clone()), &path, &header(true), &rotation(None), 8 << 20, None);
    let (mut port, mut worker) = begun.unwrap();
    let waited = || Duration::from_nanos(waited_ns.swap(0, std::sync::atomic::Ordering::Relaxed));
    let (mut now, mut ticks) = (waited(), 0);
    while now < Duration::from_secs(40) {
        while TICK * ticks < now {
            let at = MonoNs(u64::from(ticks) * 20_000_000 + 1);
            for packet in 0..20 {
                port.raw(0, at, at, &noise(packet, 100)).unwrap();
            }
            port.tick(ticks.into(), at, &[0; 20]).unwrap();
            ticks += 1;
        }
        if !worker.step(now) {
            now += Duration::from_millis(2);
        }
        now += waited();
    }
    // The program is killed at the end of a sync, or between two syncs.
    storage.store(false);
    let (seen, _) = read_back(&folder);
    now.as_secs_f64() - seen.last().unwrap().1 as f64 / 1e9
}

#[test]
fn killed_program_loses_at_most_one_second_plus_one_sync_time() {
    for sync_s in [0.001, 0.01, 0.1, 0.25, 0.5, 0.7, 1.0, 2.0, 5.0] {
        let lost = lost_s(Duration::from_secs_f64(sync_s));
        assert!(lost <= 1.0 + sync_s, "{lost} s are lost where a sync takes {sync_s} s");
    }
}

#[test]
fn recording_with_a_fault_is_recovered_as_one_log_that_lists_the_fault() {
    let folder = Folder::new("recovered");
    let mut syncs = 0;
    let storage = Faulty::new(move |op, _| {
        syncs += u64::from(op == Op::Sync);
        (op == Op::Sync && syncs == 8).then(eio)
    });
    let (summary, _) = dive(&folder, &storage, None);
    storage.store(false);
    let files = files_of(&[folder.0.join("dive.mcap")]).unwrap();
    assert_eq!(files, [folder.0.join("dive.mcap"), folder.part(2)]);
    let mut output = Vec::new();
    let done = recover(&mut || DiveLog::open(&files), &mut output, &[], "parts").unwrap();
    assert_eq!(done.messages, 4 * TICKS);
    let (recovered, losses) = read(&output);
    assert_eq!((recovered.len() as u64, losses.len()), (4 * TICKS, 1));
    let text = losses[0].to_string();
    assert!(text.contains(&summary.faults[0].words()), "{text}");
    // Without the later parts, the first part lacks the rest of the dive, so it is reported as cut off.
    let first = recover(&mut || DiveLog::open(&files[..1]), &mut Vec::new(), &[], "first").unwrap();
    assert!(first.messages < 4 * TICKS);
    assert!(first.losses.iter().any(|loss| loss.kind == LossKind::Truncated), "{:?}", first.losses);
}
