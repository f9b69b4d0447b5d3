//! Voice recordings in a dive's log, which must not affect any other message.

#![expect(clippy::disallowed_types, reason = "a test's storage is asked about once a step")]

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use headrace_monitor::voice::{Container, Voice};

use super::super::voice::{NotKept, VoicePort, decode};
use super::super::{Recorder, RecorderPort, RecorderWorker, Rotation, Storage, StoredFile};
use super::*;

/// A storage whose files hold a limited number of bytes. Writes beyond that fail.
#[derive(Clone, Default)]
struct Small(Arc<Mutex<Files>>);

/// Maximum number of bytes in a file, and content of each file.
type Files = (usize, BTreeMap<PathBuf, Vec<u8>>);

struct SmallFile(Small, PathBuf);

impl Small {
    fn of(most_bytes: usize) -> Self {
        Self(Arc::new(Mutex::new((most_bytes, BTreeMap::new()))))
    }

    fn allow(&self, most_bytes: usize) {
        self.0.lock().unwrap().0 = most_bytes;
    }

    /// Returns the messages of all files, in order.
    fn read(&self) -> Vec<Seen> {
        self.0.lock().unwrap().1.values().flat_map(|bytes| read(bytes).0).collect()
    }
}

impl Storage for Small {
    fn create(&mut self, path: &Path) -> io::Result<Box<dyn StoredFile>> {
        self.0.lock().unwrap().1.insert(path.to_owned(), Vec::new());
        Ok(Box::new(SmallFile(self.clone(), path.to_owned())))
    }

    fn remove(&mut self, path: &Path) -> io::Result<()> {
        self.0.lock().unwrap().1.remove(path).map(|_| ()).ok_or(io::ErrorKind::NotFound.into())
    }

    fn free_bytes(&mut self, _: &Path) -> Option<u64> {
        None
    }
}

impl StoredFile for SmallFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let (most_bytes, files) = &mut *self.0.0.lock().unwrap();
        let file = files.get_mut(&self.1).unwrap();
        if file.len() + bytes.len() > *most_bytes {
            return Err(io::ErrorKind::FileTooLarge.into());
        }
        file.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn sync(&mut self) -> io::Result<()> {
        Ok(())
    }
}

fn voice(id: u32, bytes: usize) -> Voice {
    let audio = [b"OggS".to_vec(), noise(id.into(), bytes)].concat();
    Voice { id, seconds: 12, container: Container::Ogg, audio }
}

struct Dive(RecorderPort, RecorderWorker, VoicePort, u64);

fn dive(storage: &Small) -> Dive {
    let header = LogHeader { voices: true, ..header(true) };
    let path = Path::new("dive.mcap");
    let begun = Recorder::unthreaded(Box::new(storage.clone()), path, &header, &Rotation::default(), 0, None);
    let (port, worker) = begun.unwrap();
    let voices = worker.voice_port();
    Dive(port, worker, voices, 0)
}

impl Dive {
    /// Records `ticks` ticks of a tenth of a second, with one packet each.
    fn go_on(&mut self, ticks: u64) {
        for tick in self.3..self.3 + ticks {
            let at = MonoNs((tick + 10) * 100_000_000);
            self.0.raw(0, at, at, &noise(tick, 700)).unwrap();
            self.0.tick(tick, at, &[0]).unwrap();
            self.1.step(Duration::from_millis(100 * tick));
        }
        self.3 += ticks;
    }
}

/// Returns the number of distinct packets. A part repeats packets that weren't synced in the previous part.
fn packets(seen: &[Seen]) -> usize {
    let of_head = seen.iter().filter(|message| message.0 == "raw 0");
    of_head.map(|message| message.3).collect::<BTreeSet<_>>().len()
}

fn voices(seen: &[Seen]) -> Vec<Voice> {
    let of_voice = seen.iter().filter(|message| message.0 == "voice");
    of_voice.map(|message| decode(&message.4).unwrap()).collect()
}

#[test]
fn voice_recording_gets_the_log_time_of_the_previous_message() {
    let storage = Small::of(usize::MAX);
    let mut dive = dive(&storage);
    dive.2.keep(&voice(1, 5000)).unwrap();
    dive.1.step(Duration::ZERO);
    dive.go_on(5);
    dive.2.keep(&voice(2, 5000)).unwrap();
    dive.go_on(5);
    dive.2.keep(&voice(3, 5000)).unwrap();
    let Dive(_, worker, port, _) = dive;
    let summary = worker.finish(Duration::from_secs(1));
    assert_eq!((summary.messages, summary.faults), (23, vec![]));
    let seen = storage.read();
    assert_eq!(
        voices(&seen),
        [voice(1, 5000), voice(2, 5000), voice(3, 5000)],
        "the first recording waits for a log time"
    );
    let times: Vec<u64> = seen.iter().map(|message| message.1).collect();
    assert!(times.is_sorted(), "{times:?}");
    assert_eq!(port.keep(&voice(4, 5)), Err(NotKept::Failing), "the recorder has ended");
}

#[test]
fn voice_recording_is_refused_while_the_medium_fails() {
    let storage = Small::of(usize::MAX);
    let mut dive = dive(&storage);
    dive.go_on(5);
    storage.allow(0);
    dive.go_on(10);
    assert_eq!(dive.2.keep(&voice(1, 5000)), Err(NotKept::Failing));
    storage.allow(usize::MAX);
    dive.go_on(100);
    dive.2.keep(&voice(2, 5000)).unwrap();
    let summary = dive.1.finish(Duration::from_secs(20));
    assert_eq!(summary.faults.iter().map(|fault| fault.lost).sum::<u64>(), 0);
    assert_eq!((packets(&storage.read()), voices(&storage.read()).len()), (115, 1));
}

#[test]
fn number_of_waiting_voice_recordings_is_limited() {
    let storage = Small::of(usize::MAX);
    let mut dive = dive(&storage);
    dive.go_on(1);
    let taken = (1..20).take_while(|id| dive.2.keep(&voice(*id, 10)).is_ok()).count();
    assert_eq!((taken, dive.2.keep(&voice(99, 10))), (8, Err(NotKept::Full)));
    dive.1.finish(Duration::ZERO);
    assert_eq!(voices(&storage.read()).len(), 8);
}

/// The disk has room for packets, but not for a voice recording.
#[test]
fn voice_recording_without_room_is_dropped_and_the_dive_continues() {
    let storage = Small::of(60_000);
    let mut dive = dive(&storage);
    dive.go_on(10);
    dive.2.keep(&voice(1, 200_000)).unwrap();
    dive.go_on(30);
    let summary = dive.1.finish(Duration::from_secs(10));
    let [fault] = summary.faults.as_slice() else { panic!("{:?}", summary.faults) };
    assert_eq!(fault.lost, 1, "{fault:?}");
    assert_eq!((packets(&storage.read()), voices(&storage.read())), (40, vec![]));
}
