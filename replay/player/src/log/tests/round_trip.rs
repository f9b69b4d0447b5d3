//! Logs that are written and read back.

use std::io::Write;

use super::super::format::{Tick, seal};
use super::super::{LogError, LogReader, LogWriter, LossKind, file_digest};
use super::*;

/// Writes ticks that consume packets out of time order. Results and sent bytes are between them.
fn write<W: Write>(log: &mut LogWriter<W>, rounds: u32) -> Vec<Seen> {
    let mut written = Vec::new();
    for number in 0..rounds {
        let (round, now) = (u64::from(number), 1_000_000 * (u64::from(number) + 1));
        let bytes = number.to_le_bytes().repeat(4);
        let early = MonoNs(now - 900_000);
        log.raw(2, MonoNs(now - 1000), early, &bytes).unwrap();
        written.push(("raw 2".to_owned(), now - 1000, early.0, number, bytes));
        log.raw(0, MonoNs(now - 2000), MonoNs(now - 2000), b"head").unwrap();
        written.push(("raw 0".to_owned(), now - 2000, now - 2000, number, b"head".to_vec()));
        log.sent(1, MonoNs(now), &[]).unwrap();
        written.push(("sent 1".to_owned(), now, now, number, vec![]));
        log.tick(round, MonoNs(now), &[2, 0]).unwrap();
        let mut tick = [round.to_le_bytes(), now.to_le_bytes()].concat();
        tick.extend([2, 0, 0, 0, 2, 0, 0, 0]);
        written.push(("tick".to_owned(), now, now, number, tick));
        log.result(0, MonoNs(now), b"{}").unwrap();
        written.push(("/result/advice".to_owned(), now, now, number, b"{}".to_vec()));
    }
    written
}

#[test]
fn log_with_ticks_is_read_in_the_order_of_writing() {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    let mut written = write(&mut log, 50);
    log.flush().unwrap();
    written.extend(
        write(&mut log, 50)
            .into_iter()
            .map(|(kind, at, valid, sequence, data)| (kind, at, valid, sequence + 50, data)),
    );
    let (bytes, summary) = log.finish().unwrap();
    assert_eq!((summary.messages, summary.chunks, summary.bytes), (500, 3, bytes.len() as u64));
    let mut reader = open(&bytes);
    assert!(reader.has_ticks());
    assert_eq!(read_all(&mut reader), written);
    assert_eq!((reader.losses(), reader.late()), (&[][..], 0));
    let tick = written.iter().find(|message| message.0 == "tick").unwrap();
    assert_eq!(Tick::decode(&tick.4).unwrap().order().collect::<Vec<_>>(), [2, 0]);
}

#[test]
fn written_log_header_is_read_back() {
    let written = header(true);
    let (bytes, _) = LogWriter::new(Vec::new(), &written).unwrap().finish().unwrap();
    let reader = open(&bytes);
    let info = reader.header();
    assert_eq!(info.vehicle_toml.as_ref(), Some(&written.vehicle_toml));
    assert_eq!(info.attachments, written.attachments);
    assert_eq!(info.sources, written.sources);
    assert_eq!(info.metadata.get("config").map(String::as_str), Some("abc"));
    assert_eq!(info.metadata.get("format").map(String::as_str), Some("1"));
}

#[test]
fn log_without_ticks_is_read_by_time_then_source_then_sequence() {
    let mut log = LogWriter::new(Vec::new(), &header(false)).unwrap();
    for (source, at) in [(1, 30), (0, 30), (2, 10), (2, 10), (0, 20)] {
        log.raw(source, MonoNs(at), MonoNs(at), &[]).unwrap();
        log.flush().unwrap();
    }
    assert!(matches!(log.tick(0, MonoNs(0), &[]), Err(LogError::NoChannel { .. })));
    let (bytes, _) = log.finish().unwrap();
    let mut reader = open(&bytes);
    assert!(!reader.has_ticks());
    let order: Vec<_> = read_all(&mut reader).into_iter().map(|m| (m.0, m.1, m.3)).collect();
    let wanted = [("raw 2", 10, 0), ("raw 2", 10, 1), ("raw 0", 20, 1), ("raw 0", 30, 0), ("raw 1", 30, 0)];
    assert_eq!(order, wanted.map(|(kind, at, sequence)| (kind.to_owned(), at, sequence)));
    assert_eq!((reader.losses(), reader.late()), (&[][..], 0));
}

#[test]
fn equal_messages_give_equal_log_bytes() {
    let log = || {
        let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
        write(&mut log, 3000);
        log.finish().unwrap().0
    };
    assert_eq!(log(), log());
}

#[test]
fn chunk_is_closed_when_it_reaches_its_maximum_size() {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for at in 0..40 {
        log.raw(0, MonoNs(at), MonoNs(at), &vec![7; 100_000]).unwrap();
    }
    let (bytes, summary) = log.finish().unwrap();
    assert!(summary.chunks >= 4, "{summary:?}");
    assert_eq!(read(&bytes).0.len(), 40);
}

#[test]
fn messages_for_undeclared_channels_are_refused() {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    assert!(matches!(log.raw(3, MonoNs(0), MonoNs(0), &[]), Err(LogError::NoChannel { .. })));
    assert!(matches!(log.result(1, MonoNs(0), &[]), Err(LogError::NoChannel { .. })));
    let mut outside = header(true);
    outside.results[0].topic = "/raw/head0".to_owned();
    assert!(matches!(LogWriter::new(Vec::new(), &outside), Err(LogError::Topic { .. })));
}

#[test]
fn file_digest_of_a_log_is_its_sha256() {
    let path = std::env::temp_dir().join(format!("headrace-round-trip-{}.mcap", std::process::id()));
    let mut log = LogWriter::create(&path, &header(true)).unwrap();
    write(&mut log, 10);
    log.finish().unwrap();
    let mut reader = LogReader::open(&path).unwrap();
    let mut count = 0;
    while reader.next().unwrap().is_some() {
        count += 1;
    }
    assert_eq!(count, 50);
    std::fs::write(&path, b"abc").unwrap();
    // Expected digest: FIPS 180-4, the one-block example.
    let abc = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
    assert_eq!(file_digest(&path).unwrap(), abc);
    let error = LogReader::open(&path).err().unwrap().to_string();
    assert!(error.contains("[61 62 63]; expected [89 4d 43 41 50 30 0d 0a]"), "{error}");
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(LogReader::open(&path), Err(LogError::Open { .. })));
}

#[test]
fn log_format_newer_than_this_program_is_refused() {
    let (bytes, _) = LogWriter::new(Vec::new(), &header(true)).unwrap().finish().unwrap();
    assert!(LogReader::new(Cursor::new(bytes), "old".to_owned()).is_ok());
    let mut writer = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let metadata = seal("headrace", [("format".to_owned(), "2".to_owned())].into());
    writer.write_metadata(&mcap::records::Metadata { name: "headrace".to_owned(), metadata }).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let error = LogReader::new(Cursor::new(bytes), "new".to_owned()).err().unwrap();
    assert_eq!(error.to_string(), "new is a log of format 2; this program reads formats up to 1");
}

#[test]
fn dropped_writer_leaves_the_log_without_an_end() {
    let mut bytes = Vec::new();
    let mut log = LogWriter::new(&mut bytes, &header(true)).unwrap();
    log.raw(0, MonoNs(1), MonoNs(1), b"one").unwrap();
    log.flush().unwrap();
    log.raw(0, MonoNs(2), MonoNs(2), b"two").unwrap();
    drop(log);
    let (seen, losses) = read(&bytes);
    assert_eq!(seen.len(), 1);
    assert!(matches!(losses.as_slice(), [Loss { kind: LossKind::Truncated, .. }]), "{losses:?}");
}
