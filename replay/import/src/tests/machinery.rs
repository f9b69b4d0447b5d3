//! Tests of the import with a test format, and of candump with arbitrary bytes.

use std::io::Cursor;

use proptest::prelude::*;

use headrace_geometry::time::DurNs;
use headrace_replay::log::{LogHeader, LogReader, LogWriter, MessageKind, SourceInfo};

use crate::candump::Candump;
use crate::input::READ_BYTES;
use crate::*;

/// A test format with entries of eight bytes: u32 timestamp in ms, 'E', stream, two bytes.
///
/// An entry that has 'X' in place of 'E' is invalid.
struct Eights;

impl Format for Eights {
    fn clock(&self) -> Clock {
        Clock::Own
    }

    fn step(&mut self, front: &[u8], _: bool, out: &mut Vec<Entry>) -> Step {
        let Some([a, b, c, d, kind, stream, data @ ..]) = front.first_chunk::<8>() else { return Step::More };
        if *kind != b'E' {
            return Step::Lost(8, "bad");
        }
        let stamp_ns = u64::from(u32::from_be_bytes([*a, *b, *c, *d])) * 1_000_000;
        out.push(Entry { stamp_ns, stream: char::from(*stream).to_string(), bytes: data.to_vec() });
        Step::Took(8)
    }
}

fn eight(ms: u32, kind: u8, stream: u8, number: u8) -> Vec<u8> {
    [&ms.to_be_bytes()[..], &[kind, stream, 0, number]].concat()
}

fn open(file: &[u8], format: Box<dyn Format>) -> Result<Import<Input<Cursor<Vec<u8>>>>, ImportError> {
    Import::open("test", Cursor::new(file.to_vec()), format, "entry")
}

fn taker(source: u16, stream: &str) -> Taker {
    Taker { source, stream: stream.to_owned(), driver: None }
}

/// Imports a file. Returns the import's result. Also returns each message's source, its time in ms after the log's
/// start, and its last byte.
fn imported(file: &[u8]) -> (Imported, Vec<(u16, i64, u8)>) {
    let import = open(file, Box::new(Eights)).unwrap();
    let path = std::env::temp_dir().join(format!(
        "headrace-import-{}-{:?}.mcap",
        std::process::id(),
        std::thread::current().id()
    ));
    let source = |id: &str| SourceInfo { id: id.to_owned(), ..SourceInfo::default() };
    let header = LogHeader { sources: vec![source("a"), source("b")], ..LogHeader::default() };
    let mut log = LogWriter::create(&path, &header).unwrap();
    let imported = import.write(&mut log, &mut [taker(0, "a"), taker(1, "b")], &mut |_| ()).unwrap();
    log.finish().unwrap();
    let mut reader = LogReader::open(&path).unwrap();
    let mut messages = Vec::new();
    while let Some(message) = reader.next().unwrap() {
        if let MessageKind::Raw { source } = message.kind {
            messages.push((source, message.log_time.since(BEGIN).0 / 1_000_000, message.data[1]));
        }
    }
    std::fs::remove_file(path).unwrap();
    (imported, messages)
}

#[test]
fn imported_entries_are_sorted_by_time() {
    let file = [
        eight(5000, b'E', b'a', 1),
        eight(5020, b'E', b'b', 3),
        eight(5010, b'E', b'a', 2),
        eight(0, b'X', b'a', 0),
        eight(0, b'X', b'a', 0),
        eight(5030, b'E', b'c', 9),
        eight(8000, b'E', b'a', 4),
        eight(8000, b'E', b'b', 5),
        eight(5015, b'E', b'a', 9),
        eight(4_000_000, b'E', b'a', 6),
        vec![1, 2, 3],
    ]
    .concat();
    let (imported, messages) = imported(&file);
    assert_eq!(messages, [(0, 0, 1), (0, 10, 2), (1, 20, 3), (0, 3000, 4), (1, 3000, 5), (0, 3_995_000, 6)]);
    assert_eq!((imported.entries, imported.passed_over), (7, 1));
    assert_eq!(imported.messages, [4, 2]);
    assert_eq!(imported.last, BEGIN + DurNs(3_995_000_000_000));
    let losses = imported.losses.join("\n");
    assert!(losses.contains("bad: 2 times, 16 bytes in all, first at byte 24"), "{losses}");
    assert!(losses.contains("cut off: the entry at byte 80 has only 3 bytes"), "{losses}");
    assert!(losses.contains("1 entries out of order"), "{losses}");
    assert!(losses.contains("over an hour 1 times, first by 3992 s to 3996.000 s"), "{losses}");
}

#[test]
fn long_file_is_read_with_bounded_memory() {
    let file: Vec<u8> = (0..400_000).flat_map(|n: u32| eight(n, b'E', b'a', n.to_le_bytes()[0])).collect();
    let import = open(&file, Box::new(Eights)).unwrap();
    assert!(import.input.held.len() <= 2 * READ_BYTES);
    let (imported, messages) = imported(&file);
    assert_eq!((imported.entries, imported.losses), (400_000, Vec::new()));
    assert!(messages.iter().zip(0..).all(|(message, n)| message.1 == n));
}

#[test]
fn file_without_entries_is_refused() {
    for (file, words) in [(&b""[..], "in its 0 bytes"), (b"0000X...", "in its 8 bytes; bad: 1 times")] {
        let error = open(file, Box::new(Eights)).err().unwrap().to_string();
        assert!(error.contains("importing test: there is no entry") && error.contains(words), "{error}");
    }
}

#[test]
fn invalid_candump_line_loses_only_itself() {
    let text = "(1.0) can0 123#11\nnonsense\n\n(1.1) can0 123#22\n(1.2) can0 123#33";
    let mut import = open(text.as_bytes(), Box::new(Candump)).unwrap();
    let mut count = 0;
    while import.order.pop().is_some() {
        count += 1;
    }
    assert_eq!(count, 3);
    assert_eq!(
        import.input.losses.words(),
        ["no line of candump: 1 times, 9 bytes in all, first at byte 18"]
    );
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_read_as_candump_without_a_panic(
        bytes in prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..2000),
            "(\\([0-9.]{0,12}\\) can[0-9] [0-9A-F]{0,9}#[0-9A-FR_.]{0,18}\n?){0,40}".prop_map(String::into_bytes),
        ],
    ) {
        if let Ok(mut import) = open(&bytes, Box::new(Candump)) {
            while import.order.pop().is_some() || import.input.more(&mut import.order).unwrap() {}
        }
        prop_assert!(detect::looks_like(&bytes).is_none_or(|words| !words.is_empty()));
    }
}
