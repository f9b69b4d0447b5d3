//! Recordings in parts, which are read as one log. Missing and foreign parts are reported.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use headrace_geometry::time::DurNs;

use super::super::{DiveLog, Every, LogError, LogWriter, Recorder, Rotation, files_of, part_path, recover};
use super::*;

/// A temporary folder, which is removed on drop.
pub(super) struct Folder(pub(super) PathBuf);

impl Folder {
    pub(super) fn new(name: &str) -> Self {
        // Tests run in parallel, and two of them may use the same name.
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("headrace-parts-{}-{count}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    pub(super) fn part(&self, number: u32) -> PathBuf {
        part_path(&self.0.join("dive.mcap"), number)
    }

    fn files(&self) -> Vec<PathBuf> {
        files_of(std::slice::from_ref(&self.0)).unwrap()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).ok();
    }
}

/// Number of ticks in a recording. Each lasts a tenth of a second and has two packets.
const TICKS: u64 = 400;

fn record(path: &Path, rotation: Option<&Rotation>) -> super::super::Summary {
    let single = Rotation::default();
    let begun = Recorder::create(path, &header(true), rotation.unwrap_or(&single), 1 << 22, None);
    let (mut port, handle) = begun.unwrap();
    for tick in 0..TICKS {
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 700)).unwrap();
        port.raw(2, at, MonoNs(at.0 - 7), &noise(tick, 16)).unwrap();
        port.tick(tick, at, &[0, 2]).unwrap();
        port.result(0, at, b"{}").unwrap();
    }
    handle.finish().unwrap()
}

fn rotation(every: Every) -> Rotation {
    Rotation { every: Some(every), dive: "one".to_owned() }
}

pub(super) fn all(log: &mut DiveLog) -> Vec<Seen> {
    let mut seen = Vec::new();
    while let Some(message) = log.next().unwrap() {
        let kind = format!("{:?}", message.kind);
        let (at, valid) = (message.log_time.0, message.publish_time.0);
        seen.push((kind, at, valid, message.sequence, message.data.to_vec()));
    }
    seen
}

fn losses(files: &[PathBuf]) -> Vec<String> {
    let mut log = DiveLog::open(files).unwrap();
    all(&mut log);
    log.losses().iter().map(ToString::to_string).collect()
}

#[test]
fn parts_have_the_same_messages_as_a_single_file() {
    let whole = Folder::new("whole");
    let single = whole.0.join("dive.mcap");
    let written = record(&single, None);
    let expected = all(&mut DiveLog::open(&[single]).unwrap());
    for (name, every, parts) in
        [("bytes", Every::Bytes(100_000), 3), ("span", Every::Span(DurNs::from_millis(10_000)), 4)]
    {
        let folder = Folder::new(name);
        let summary = record(&folder.0.join("dive.mcap"), Some(&rotation(every)));
        assert_eq!((summary.messages, summary.raw_messages), (written.messages, 2 * TICKS));
        assert_eq!(summary.parts.iter().map(|part| part.raw_messages).sum::<u64>(), 2 * TICKS);
        let paths: Vec<PathBuf> = summary.parts.iter().map(|part| part.path.clone()).collect();
        assert_eq!(paths, (1..=parts).map(|number| folder.part(number)).collect::<Vec<_>>(), "{name}");
        assert_eq!(folder.files(), paths);
        // The parts are found by the name of the recording, and may be listed in any order.
        assert_eq!(files_of(&[folder.0.join("dive.mcap")]).unwrap(), paths);
        let backwards: Vec<PathBuf> = paths.iter().rev().cloned().collect();
        for files in [&paths, &backwards] {
            let mut log = DiveLog::open(files).unwrap();
            assert_eq!(all(&mut log), expected, "{name}");
            assert_eq!((log.losses(), log.has_losses()), (vec![], false));
            let counts: Vec<u64> = log.files().iter().map(|file| file.messages).collect();
            assert_eq!(counts, summary.parts.iter().map(|part| part.raw_messages).collect::<Vec<_>>());
        }
        if let Every::Bytes(bytes) = every {
            // A part may exceed the limit by half a second of the recording, which takes 4 kB.
            let len = |path: &PathBuf| std::fs::metadata(path).unwrap().len();
            let ended = &paths[..paths.len() - 1];
            assert!(ended.iter().all(|path| (bytes..bytes + 10_000).contains(&len(path))));
        }
        for path in &paths {
            // Each part can be read as a complete log, and no tick is split between parts.
            let (seen, losses) = read(&std::fs::read(path).unwrap());
            assert_eq!((seen[0].0.as_str(), losses), ("raw 0", vec![]));
            let info = LogReader::open(path).unwrap();
            assert_eq!(info.header().attachments, header(true).attachments);
            assert!(info.header().vehicle_toml.is_some());
        }
    }
}

#[test]
fn missing_or_replaced_part_is_reported_by_number() {
    let folder = Folder::new("missing");
    record(&folder.0.join("dive.mcap"), Some(&rotation(Every::Span(DurNs::from_millis(10_000)))));
    let files = folder.files();
    let said = |numbers: &[usize]| {
        let some: Vec<PathBuf> = numbers.iter().map(|number| files[number - 1].clone()).collect();
        losses(&some)
    };
    let second = "part 2 of the recording is missing (after 10.900 s, before 21.000 s)";
    assert_eq!(said(&[1, 3, 4]), [second]);
    assert_eq!(
        said(&[4, 1]),
        ["parts 2 to 3 of the recording are missing (after 10.900 s, before 31.000 s)"]
    );
    assert_eq!(
        said(&[2, 3]),
        [
            "part 1 of the recording is missing (before 11.000 s)",
            "part 4 of the recording is missing, and any after it (after 30.900 s)"
        ]
    );
    assert_eq!(said(&[4]), ["parts 1 to 3 of the recording are missing (before 31.000 s)"]);

    // Part 2 is replaced by another log with the same part number.
    let other = Folder::new("unlike");
    let mut header = LogReader::open(&files[1]).unwrap().header().clone();
    let part = header.part.take().unwrap();
    let whole = super::header(true);
    let mut log = LogWriter::new(Vec::new(), &LogHeader { part: Some(part.head), ..whole }).unwrap();
    log.raw(0, MonoNs(11_000_000_000), MonoNs(0), b"other").unwrap();
    log.end_part(true).unwrap();
    std::fs::write(other.part(2), log.finish().unwrap().0).unwrap();
    let mixed = [files[0].clone(), other.part(2), files[2].clone(), files[3].clone()];
    let texts = losses(&mixed);
    assert_eq!(texts.len(), 1, "{texts:?}");
    assert!(texts[0].starts_with("part 2 is not the one that was recorded: it states 401"), "{texts:?}");
}

#[test]
fn mixed_recordings_and_duplicate_parts_are_refused() {
    let (one, other) = (Folder::new("one"), Folder::new("other"));
    let every = Every::Span(DurNs::from_millis(10_000));
    record(&one.0.join("dive.mcap"), Some(&rotation(every)));
    record(&other.0.join("dive.mcap"), Some(&Rotation { every: Some(every), dive: "two".to_owned() }));
    let open = |files: &[PathBuf]| DiveLog::open(files).err().unwrap();
    assert!(matches!(open(&[one.part(1), other.part(2)]), LogError::OtherDive { .. }));
    std::fs::copy(one.part(2), one.part(7)).unwrap();
    assert!(matches!(open(&one.files()), LogError::PartTwice { number: 2, .. }));
    std::fs::remove_file(one.part(7)).unwrap();
    let single = other.0.join("single.mcap");
    record(&single, None);
    assert!(matches!(open(&[one.part(1), single]), LogError::OtherDive { .. }));
    let simulated = other.0.join("simulated.mcap");
    LogWriter::create(&simulated, &header(false)).unwrap().finish().unwrap();
    assert!(matches!(open(&[one.part(1), simulated]), LogError::NotAPart { .. }));
    // A new recording must not overwrite the parts of another one.
    let again = Recorder::create(&one.0.join("dive.mcap"), &header(true), &rotation(every), 0, None);
    assert!(matches!(again.err().unwrap(), LogError::Create { path, .. } if path == one.part(1)));
}

#[test]
fn damaged_parts_lose_only_their_damaged_messages() {
    let folder = Folder::new("damaged");
    record(&folder.0.join("dive.mcap"), Some(&rotation(Every::Span(DurNs::from_millis(10_000)))));
    let whole = all(&mut DiveLog::open(&folder.files()).unwrap());
    // As after a power cut, part 3 has no end, and part 4 is empty.
    let third = std::fs::read(folder.part(3)).unwrap();
    std::fs::write(folder.part(3), &third[..third.len() * 2 / 3]).unwrap();
    std::fs::write(folder.part(4), []).unwrap();
    let mut log = DiveLog::open(&folder.files()).unwrap();
    let seen = all(&mut log);
    assert!(seen.len() > 1000 && whole.starts_with(&seen), "{}", seen.len());
    let texts: Vec<String> = log.losses().iter().map(ToString::to_string).collect();
    assert_eq!(texts.len(), 2, "{texts:?}");
    assert!(texts[0].starts_with("the file that is named like part 4 can't be read: "), "{texts:?}");
    assert!(texts[1].starts_with("part 3, byte ") && texts[1].contains("the file ends before"), "{texts:?}");

    let mut output = Vec::new();
    let files = folder.files();
    let done = recover(&mut || DiveLog::open(&files), &mut output, &[], "parts").unwrap();
    assert_eq!(done.messages, seen.len() as u64);
    let (recovered, losses) = read(&output);
    assert_eq!((recovered.len(), losses.len()), (seen.len(), 2));
    assert_eq!(open(&output).header().part, None);
}

#[test]
fn existing_part_name_is_skipped() {
    let folder = Folder::new("refused");
    // A folder that is created after the start of the recording occupies the path of the second part.
    let (mut port, handle) = Recorder::create(
        &folder.0.join("dive.mcap"),
        &header(true),
        &rotation(Every::Span(DurNs::from_millis(10_000))),
        1 << 22,
        None,
    )
    .unwrap();
    std::fs::create_dir(folder.part(2)).unwrap();
    for tick in 0..300 {
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 16)).unwrap();
        port.tick(tick, at, &[0]).unwrap();
    }
    let summary = handle.finish().unwrap();
    let paths: Vec<PathBuf> = summary.parts.iter().map(|part| part.path.clone()).collect();
    assert_eq!((summary.raw_messages, &paths), (300, &[1, 3, 4].map(|number| folder.part(number)).to_vec()));
    assert_eq!(files_of(&[folder.0.join("dive.mcap")]).unwrap(), paths);
    let mut log = DiveLog::open(&paths).unwrap();
    assert_eq!((all(&mut log).len(), log.losses()), (600, vec![]));
}
