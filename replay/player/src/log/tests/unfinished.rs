//! Recordings that were cut off at any byte are continued in new parts, and are read as one log.

use std::fs::OpenOptions;
use std::path::{Path, PathBuf};

use super::super::{
    DiveLog, Every, Interrupted, Recorder, RecorderHandle, RecorderPort, Rotation, Unfinished, files_of,
};
use super::parts::{Folder, all};
use super::*;

/// Queue of the recorder, bytes.
const QUEUE_BYTES: usize = 1 << 22;

/// Records ticks with one packet and one result each, and ends the recording in order.
fn record((mut port, handle): (RecorderPort, RecorderHandle), ticks: core::ops::Range<u64>) {
    for tick in ticks {
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 300)).unwrap();
        port.tick(tick, at, &[0]).unwrap();
        port.result(0, at, &tick.to_le_bytes()).unwrap();
    }
    handle.finish().unwrap();
}

fn cut(path: &Path, bytes: u64) {
    OpenOptions::new().write(true).open(path).unwrap().set_len(bytes).unwrap();
}

/// The readable messages of a recording, and its losses.
fn messages(recording: &Path) -> (Vec<Seen>, Vec<String>) {
    let mut log = DiveLog::open(&files_of(&[recording.to_owned()]).unwrap()).unwrap();
    let seen = all(&mut log);
    (seen, log.losses().iter().map(ToString::to_string).collect())
}

/// Continues the recording by 30 ticks, and returns the statement of the interruption.
fn go_on(recording: &Path) -> String {
    let unfinished = Unfinished::read(recording).unwrap().unwrap();
    let (tick, to) = (unfinished.next_tick(), MonoNs(unfinished.last.0 + 5_000_000_000));
    let interrupted = Interrupted { recording: unfinished, to, words: format!("stopped before tick {tick}") };
    let loss = interrupted.loss().to_string();
    record(Recorder::go_on(&interrupted, &header(true), None, QUEUE_BYTES, None).unwrap(), tick..tick + 30);
    loss
}

#[test]
fn recording_cut_at_any_byte_is_continued_without_gaps_or_repetitions() {
    let folder = Folder::new("unfinished");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    record(Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..200);
    assert!(Unfinished::read(&recording).unwrap().is_none(), "it ended in order");
    let whole = std::fs::read(&recording).unwrap();
    let complete = messages(&recording).0;
    let step = whole.len() / 40 + 1;
    let (mut continued, mut ended) = (0, 0);
    for bytes in (whole.len() / 8..whole.len() - 8).step_by(step).chain([whole.len() - 1]) {
        std::fs::write(&recording, &whole).unwrap();
        cut(&recording, bytes as u64);
        let (before, _) = messages(&recording);
        assert!(before == complete[..before.len()], "cut at {bytes}");
        if Unfinished::read(&recording).unwrap().is_none() {
            let is_complete = before.len() == complete.len();
            assert!(
                before.is_empty() || is_complete,
                "cut at {bytes}: nothing to continue, or ended in order"
            );
            ended += usize::from(is_complete);
            continue;
        }
        // The second part is cut off, too, and continued in a third one.
        let mut stated = vec![go_on(&recording)];
        let second = folder.part(2);
        cut(&second, std::fs::metadata(&second).unwrap().len() * 3 / 4);
        let (kept, _) = messages(&recording);
        assert!(kept[..before.len()] == before, "cut at {bytes}");
        stated.push(go_on(&recording));
        let (after, losses) = messages(&recording);
        assert_eq!(losses, stated, "cut at {bytes}: only the interruptions are reported");
        assert!(after[..kept.len()] == kept, "cut at {bytes}");
        continued += 1;
        let of = |kind: &str| {
            after.iter().filter(|seen| seen.0.contains(kind)).map(|seen| seen.3).collect::<Vec<_>>()
        };
        for kind in ["Raw", "Tick", "Result"] {
            let numbers = of(kind);
            assert_eq!(numbers, (0..).take(numbers.len()).collect::<Vec<u32>>(), "cut at {bytes}: {kind}");
        }
        assert_eq!(after.len(), kept.len() + 3 * 30, "cut at {bytes}");
        for part in [2, 3] {
            std::fs::remove_file(folder.part(part)).unwrap();
        }
    }
    assert!(continued > 20 && ended > 0, "{continued} continued, {ended} had ended in order");
}

/// A program that is killed just after it has ended a part leaves an empty file of the next part.
#[test]
fn recording_killed_just_after_a_part_is_continued() {
    let folder = Folder::new("after-a-part");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: Some(Every::Span(DurNs::from_millis(2000))), dive: "one".to_owned() };
    record(Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..50);
    let next = folder.part(2);
    (3..10).for_each(|part| std::fs::remove_file(folder.part(part)).unwrap_or_default());
    let lock = std::fs::File::create(&next).unwrap();
    lock.lock().unwrap();
    assert!(!Unfinished::is_at(&recording).unwrap(), "another program writes the next part");
    drop(lock);
    let unread =
        "the file that is named like part 2 can't be read: it begins with [], which no MCAP file does";
    let (before, losses) = messages(&recording);
    assert!(before.len() > 30 && losses == [unread], "{} messages, {losses:?}", before.len());
    let stated = go_on(&recording);
    let (after, losses) = messages(&recording);
    assert!(after.len() == before.len() + 90 && after[..before.len()] == before);
    assert_eq!(losses, [unread, &stated]);
}

#[test]
fn recorder_dropped_without_an_orderly_end_can_be_continued() {
    let folder = Folder::new("dropped");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    let (mut port, handle) =
        Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap();
    for tick in 0..50 {
        let at = MonoNs((tick + 10) * 100_000_000);
        port.raw(0, at, at, &noise(tick, 300)).unwrap();
        port.tick(tick, at, &[0]).unwrap();
    }
    drop(handle);
    let (before, _) = messages(&recording);
    assert_eq!(before.len(), 100, "everything is synced");
    let stated = go_on(&recording);
    let (after, losses) = messages(&recording);
    assert!(after.len() == 190 && after[..100] == before && losses == [stated]);
}

#[test]
fn parts_between_the_first_and_the_last_are_not_opened_before_a_dive_goes_on() {
    let folder = Folder::new("between");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    record(Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..50);
    let cut_to_3_quarters = |path: &Path| cut(path, std::fs::metadata(path).unwrap().len() * 3 / 4);
    cut_to_3_quarters(&recording);
    for part in [2, 3] {
        go_on(&recording);
        cut_to_3_quarters(&folder.part(part));
    }
    let span = || Unfinished::read(&recording).unwrap().unwrap().span;
    let (before, files) = (span(), files_of(std::slice::from_ref(&recording)).unwrap());
    assert_eq!(before, DiveLog::open(&files).unwrap().times());
    // Opening all parts finds that one of them occurs twice.
    std::fs::copy(folder.part(3), folder.part(2)).unwrap();
    assert!(DiveLog::open(&files).is_err());
    assert_eq!(span(), before);
}

#[test]
fn part_cut_within_its_header_does_not_prevent_the_continuation() {
    let folder = Folder::new("header");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    record(Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..50);
    cut(&recording, std::fs::metadata(&recording).unwrap().len() / 2);
    let (before, _) = messages(&recording);
    let unfinished = Unfinished::read(&recording).unwrap().unwrap();
    let interrupted = Interrupted { to: unfinished.last, recording: unfinished, words: String::new() };
    let recorder = Recorder::go_on(&interrupted, &header(true), None, QUEUE_BYTES, None).unwrap();
    drop((recorder, interrupted));
    let part = std::fs::read(folder.part(2)).unwrap();
    // If the cut-off part still has its number, it is continued like any other. Otherwise its file counts as
    // unreadable.
    let (mut with_number, mut without) = (0, 0);
    for bytes in (0..part.len()).step_by(part.len() / 30) {
        std::fs::write(folder.part(2), &part[..bytes]).unwrap();
        go_on(&recording);
        let (after, losses) = messages(&recording);
        assert!(after.len() == before.len() + 90 && after[..before.len()] == before, "cut at {bytes}");
        let is_without = losses.iter().any(|loss| loss.contains("named like part 2 can't be read"));
        without += usize::from(is_without);
        with_number += usize::from(!is_without);
        std::fs::remove_file(folder.part(3)).unwrap();
    }
    assert!(with_number > 2 && without > 2, "{with_number} with number, {without} without");
}

#[test]
fn dive_is_continued_at_another_path_if_its_medium_is_gone() {
    let folder = Folder::new("elsewhere");
    let recording = folder.0.join("dive.mcap");
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    record(Recorder::create(&recording, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..50);
    cut(&recording, std::fs::metadata(&recording).unwrap().len() / 2);
    let elsewhere = folder.0.join("other.mcap");
    let unfinished = Unfinished::read(&recording).unwrap().unwrap();
    assert!(unfinished.at(&recording).is_none(), "the dive is there already");
    let moved = unfinished.at(&elsewhere).unwrap();
    assert_eq!(moved.next_path(), folder.0.join("other.part002.mcap"));
    let (tick, to) = (moved.next_tick(), moved.last);
    let interrupted = Interrupted { recording: moved, to, words: "begins within a dive".to_owned() };
    record(Recorder::go_on(&interrupted, &header(true), None, QUEUE_BYTES, None).unwrap(), tick..tick + 30);
    let (after, losses) = messages(&elsewhere);
    assert_eq!(after.len(), 90);
    assert!(losses.iter().any(|loss| loss.contains("part 1 of the recording is missing")), "{losses:?}");
    // In one folder, the files of the two recordings are read as one dive again.
    std::fs::copy(folder.0.join("other.part002.mcap"), folder.part(2)).unwrap();
    let (all, losses) = messages(&recording);
    assert!(all.len() > 90 && losses.len() == 1, "{losses:?}");
}

#[test]
fn latest_recording_of_a_folder_is_found_if_it_did_not_end_in_order() {
    let folder = Folder::new("last");
    let last = || Unfinished::last_in(&folder.0, &|info| info.metadata.contains_key("simulated")).unwrap();
    let create = |name: &str, dive: &str| -> PathBuf {
        let path = folder.0.join(name);
        let rotation = Rotation { every: None, dive: dive.to_owned() };
        record(Recorder::create(&path, &header(true), &rotation, QUEUE_BYTES, None).unwrap(), 0..20);
        path
    };
    assert_eq!(last(), None);
    let first = create("b.mcap", "one");
    assert_eq!(last(), None, "it ended in order");
    cut(&first, std::fs::metadata(&first).unwrap().len() * 3 / 4);
    std::fs::write(folder.0.join("z.mcap"), b"no log").unwrap();
    assert_eq!(last(), Some(first.clone()));
    let unfinished = Unfinished::read(&first).unwrap().unwrap();
    let to = unfinished.last;
    let interrupted = Interrupted { recording: unfinished, to, words: String::new() };
    let writing = Recorder::go_on(&interrupted, &header(true), None, QUEUE_BYTES, None).unwrap();
    assert_eq!(last(), None, "it is being written");
    drop((writing, interrupted));
    std::fs::remove_file(folder.0.join("b.part002.mcap")).unwrap();
    go_on(&first);
    assert_eq!(last(), None, "its continuation ended in order");
    let part = folder.part(2).with_file_name("b.part002.mcap");
    cut(&part, std::fs::metadata(&part).unwrap().len() * 3 / 4);
    assert_eq!(last(), Some(first.clone()), "the path of the recording, not of its part");
    std::thread::sleep(std::time::Duration::from_millis(20));
    create("a.mcap", "two");
    assert_eq!(last(), None, "a later dive ended in order");
}
