//! Tests that write logs and read them again.

mod damage;
mod foreign;
mod numbering;
mod parts;
mod places;
mod recorder;
mod recover;
mod round_trip;
mod storage;
mod unfinished;
mod voice;

use std::io::Cursor;

use headrace_geometry::time::{DurNs, MonoNs};

use super::{LogHeader, LogReader, Loss, MessageKind, ResultChannel, SourceInfo};

/// A message as compared by the tests: kind, log time, publish time, sequence, data.
type Seen = (String, u64, u64, u32, Vec<u8>);

fn source(id: &str, plugin: &str, connect: &str) -> SourceInfo {
    SourceInfo { id: id.to_owned(), plugin: plugin.to_owned(), connect: connect.to_owned() }
}

/// Returns a header with one result and three sources, which aren't in the order of their names.
fn header(ticks: bool) -> LogHeader {
    LogHeader {
        vehicle_toml: "target = 0.05 # Wasserschloß\n".to_owned(),
        attachments: vec![("profile.csv".to_owned(), b"0,0\n1,0\n".to_vec())],
        metadata: [("version", "0.1.0"), ("config", "abc")].map(|(k, v)| (k.to_owned(), v.to_owned())).into(),
        sources: vec![
            source("head0", "imagenex881", "udp:0.0.0.0:4040"),
            source("depth", "bar100", "i2c:/dev/i2c-1:0x40"),
            source("imu", "imu_can", "can:can0"),
        ],
        ticks,
        results: vec![ResultChannel {
            topic: "/result/advice".to_owned(),
            schema_name: "headrace.Advice".to_owned(),
            schema_encoding: "jsonschema".to_owned(),
            schema: "{}".to_owned(),
            message_encoding: "json".to_owned(),
            follows_echoes: false,
        }],
        ..LogHeader::default()
    }
}

fn open(bytes: &[u8]) -> LogReader<Cursor<Vec<u8>>> {
    LogReader::new(Cursor::new(bytes.to_vec()), "test".to_owned()).unwrap()
}

/// Reads all messages that a reader delivers.
fn read_all<R: std::io::Read + std::io::Seek>(reader: &mut LogReader<R>) -> Vec<Seen> {
    let mut seen = Vec::new();
    while let Some(message) = reader.next().unwrap() {
        let kind = match message.kind {
            MessageKind::Raw { source } => format!("raw {source}"),
            MessageKind::Sent { source } => format!("sent {source}"),
            MessageKind::Tick => "tick".to_owned(),
            MessageKind::Result { topic } => topic.to_owned(),
            MessageKind::Voice => "voice".to_owned(),
            MessageKind::Other => "other".to_owned(),
        };
        let MonoNs(log_time) = message.log_time;
        seen.push((kind, log_time, message.publish_time.0, message.sequence, message.data.to_vec()));
    }
    assert!(reader.next().unwrap().is_none(), "a second call must return the end again");
    seen
}

/// Returns the messages and losses of a log.
fn read(bytes: &[u8]) -> (Vec<Seen>, Vec<Loss>) {
    let mut reader = open(bytes);
    let seen = read_all(&mut reader);
    (seen, reader.losses().to_vec())
}

/// Returns bytes that don't compress.
fn noise(seed: u64, len: usize) -> Vec<u8> {
    let words = (1..).map(|i: u64| (seed ^ i).wrapping_mul(0x9E37_79B9_7F4A_7C15));
    words.flat_map(|word| word.to_be_bytes().into_iter().take(3)).take(len).collect()
}

/// Returns the position of the record after the one at `at`.
fn record_after(bytes: &[u8], at: usize) -> usize {
    let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
    at + 9 + usize::try_from(len).unwrap()
}

/// Returns the positions of all records with that opcode, in a log or a part of a log.
fn places(bytes: &[u8], opcode: u8) -> Vec<usize> {
    let (mut at, mut places) = (8, Vec::new());
    // Fewer bytes than a record's header are left: the closing magic bytes, or a part of a record.
    while at + 9 <= bytes.len() - 8 {
        places.extend((bytes[at] == opcode).then_some(at));
        at = record_after(bytes, at);
    }
    places
}
