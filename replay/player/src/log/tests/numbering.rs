//! Logs in which whole records were removed, repeated or moved. All remaining records are valid, but the change is
//! reported.

use mcap::records::op;

use super::super::{DiveLog, LogWriter, LossKind, PartHead, recover};
use super::*;

/// Number of chunks with messages, and number of messages in each.
const CHUNKS: u64 = 6;
const PER_CHUNK: u64 = 10;
/// An opcode that MCAP reserves for other programs.
const PRIVATE: u8 = 0x80;

/// Returns a log with several chunks. With `is_part`, its messages are numbered as in the third part of a recording.
fn log(ticks: bool, is_part: bool) -> Vec<u8> {
    let mut header = header(ticks);
    if is_part {
        let before = super::super::Progress {
            messages: 1000,
            tick: Some(7),
            sequences: [("/raw/imu".to_owned(), u32::MAX - 12), ("/raw/depth".to_owned(), 9)].into(),
        };
        header.part = Some(PartHead { dive: "0123456789abcdef".to_owned(), number: 3, before });
    }
    let mut log = LogWriter::new(Vec::new(), &header).unwrap();
    for number in 0..CHUNKS * PER_CHUNK {
        let at = MonoNs(1_000_000_000 + number * 10_000_000);
        match number % 5 {
            0 if ticks => log.tick(number, at, &[2]).unwrap(),
            // Channel 1 has messages in only a few chunks.
            1 if number % 20 == 1 => log.raw(1, at, at, b"depth").unwrap(),
            2 => log.result(0, at, b"{}").unwrap(),
            _ => log.raw(2, at, at, &noise(number, 20)).unwrap(),
        }
        if number % PER_CHUNK == PER_CHUNK - 1 {
            log.flush().unwrap();
        }
    }
    if is_part {
        log.end_part(false).unwrap();
    }
    log.finish().unwrap().0
}

/// Returns the records of a log, beginning with the header, without the magic bytes.
fn records(bytes: &[u8]) -> Vec<Vec<u8>> {
    let (mut at, mut records) = (8, Vec::new());
    while at < bytes.len() - 8 {
        let end = record_after(bytes, at);
        records.push(bytes[at..end].to_vec());
        at = end;
    }
    records
}

fn joined(records: &[Vec<u8>]) -> Vec<u8> {
    [mcap::MAGIC, &records.concat(), mcap::MAGIC].concat()
}

/// Returns the records without the summary. The new footer states that there is no summary.
fn without_summary(mut records: Vec<Vec<u8>>) -> Vec<Vec<u8>> {
    let data_end = records.iter().position(|record| record[0] == op::DATA_END).unwrap();
    records.truncate(data_end);
    records.push([&[op::DATA_END][..], &4_u64.to_le_bytes(), &[0; 4]].concat());
    records.push([&[op::FOOTER][..], &20_u64.to_le_bytes(), &[0; 20]].concat());
    records
}

/// Turns a record into a private record of the same length.
fn replace(record: &mut [u8]) {
    let body = noise(9, record.len() - 9);
    record[0] = PRIVATE;
    record[9..].copy_from_slice(&body);
}

/// Returns the indexes of the chunks that have messages.
fn chunks(records: &[Vec<u8>]) -> Vec<usize> {
    let all = (0..records.len()).filter(|place| records[*place][0] == op::CHUNK);
    let chunks: Vec<usize> = all.skip(1).collect();
    assert_eq!(chunks.len() as u64, CHUNKS);
    chunks
}

/// Returns the kinds and texts of a log's losses.
fn losses(bytes: &[u8]) -> (Vec<LossKind>, Vec<String>) {
    let (_, losses) = read(bytes);
    let texts = losses.iter().map(ToString::to_string).collect();
    (losses.into_iter().map(|loss| loss.kind).collect(), texts)
}

/// Returns the number of messages that the losses report as missing.
fn missing(kinds: &[LossKind]) -> u64 {
    let missing = kinds.iter().filter_map(|kind| match kind {
        LossKind::Missing { messages } => Some(*messages),
        _ => None,
    });
    missing.sum()
}

/// Calls `check` with the records of four logs: with and without ticks, each as a log of its own and as a part of a
/// recording.
fn each(mut check: impl FnMut(&str, Vec<Vec<u8>>)) {
    for (ticks, is_part) in [(true, false), (false, false), (true, true), (false, true)] {
        check(&format!("ticks {ticks}, part {is_part}"), records(&log(ticks, is_part)));
    }
}

#[test]
fn intact_log_has_no_losses() {
    each(|what, records| assert_eq!(read(&joined(&records)).1, [], "{what}"));
}

#[test]
fn replaced_chunk_is_reported_as_missing_messages() {
    each(|what, records| {
        for chunk in chunks(&records) {
            let mut records = records.clone();
            replace(&mut records[chunk]);
            let (kinds, texts) = losses(&joined(&records));
            assert_eq!(missing(&kinds), PER_CHUNK, "{what}: {texts:?}");
            assert!(kinds.iter().all(|kind| matches!(kind, LossKind::Missing { .. })), "{what}: {texts:?}");
        }
    });
}

#[test]
fn chunk_removed_from_a_log_without_summary_is_reported_at_its_place() {
    each(|what, records| {
        let places = chunks(&records);
        for (number, chunk) in places.iter().enumerate() {
            let mut records = without_summary(records.clone());
            records.remove(*chunk);
            let (kinds, texts) = losses(&joined(&records));
            // Only a part states its number of messages. In other logs the loss of a channel's last messages isn't
            // noticed.
            let wanted = match number {
                _ if what.contains("part true") => PER_CHUNK,
                4 => PER_CHUNK - 1,
                5 => 0,
                _ => PER_CHUNK,
            };
            assert_eq!(missing(&kinds), wanted, "{what}, chunk {number}: {texts:?}");
            assert!(kinds.contains(&LossKind::Truncated), "{what}: {texts:?}");
            if number == 2 {
                let place = "after 1.190 s, before 1.300 s)";
                assert!(texts.iter().any(|text| text.ends_with(place)), "{what}: {texts:?}");
            }
        }
    });
}

#[test]
fn duplicate_chunk_is_reported_as_repeated_messages() {
    each(|what, records| {
        for chunk in chunks(&records) {
            let mut records = without_summary(records.clone());
            records.insert(chunk, records[chunk].clone());
            let (kinds, texts) = losses(&joined(&records));
            assert!(
                kinds.contains(&LossKind::Repeated { messages: PER_CHUNK }) && kinds.len() == 2,
                "{what}: {texts:?}"
            );
        }
    });
}

#[test]
fn swapped_chunks_are_reported_as_out_of_order() {
    each(|what, records| {
        let places = chunks(&records);
        for (one, other) in [(0, 1), (1, 4), (4, 5)] {
            let mut records = without_summary(records.clone());
            records.swap(places[one], places[other]);
            let (kinds, texts) = losses(&joined(&records));
            let is_reported = kinds.iter().any(|kind| matches!(kind, LossKind::Disordered { .. }));
            assert!(is_reported, "{what}, {one} and {other}: {texts:?}");
            assert_eq!(missing(&kinds), 0, "{what}: {texts:?}");
        }
    });
}

/// The log is cut between two records and closed again, without a summary.
#[test]
fn log_cut_between_records_and_closed_again_is_reported() {
    each(|what, records| {
        for chunk in chunks(&records) {
            let whole = without_summary(records.clone());
            let cut = [&records[..chunk], &whole[whole.len() - 2..]].concat();
            let (kinds, texts) = losses(&joined(&cut));
            assert_eq!(kinds, [LossKind::Truncated], "{what}: {texts:?}");
        }
    });
}

/// The summary's statistics state the number of messages in the whole log.
#[test]
fn messages_missing_at_the_end_are_counted_from_the_summary() {
    each(|what, records| {
        let last = *chunks(&records).last().unwrap();
        let mut records = records;
        replace(&mut records[last]);
        let (kinds, texts) = losses(&joined(&records));
        assert_eq!(kinds, [LossKind::Missing { messages: PER_CHUNK }], "{what}: {texts:?}");
    });
}

#[test]
fn part_without_its_end_record_is_reported() {
    let mut records = records(&log(true, true));
    let end = records.iter().rposition(|record| record[0] == op::METADATA).unwrap();
    replace(&mut records[end]);
    let (kinds, texts) = losses(&joined(&records));
    assert_eq!(kinds, [LossKind::Metadata("headrace.part.end".to_owned())], "{texts:?}");
}

/// One cause of damage must give only one loss.
#[test]
fn damaged_chunk_is_reported_as_one_loss() {
    each(|what, records| {
        for chunk in chunks(&records) {
            let mut records = records.clone();
            let middle = records[chunk].len() - 5;
            records[chunk][middle] ^= 1;
            let (kinds, texts) = losses(&joined(&records));
            assert_eq!((kinds.len(), missing(&kinds)), (1, 0), "{what}: {texts:?}");
        }
    });
}

#[test]
fn resuming_at_an_earlier_position_reports_the_same_numbering_losses() {
    each(|what, records| {
        let mut records = without_summary(records);
        let places = chunks(&records);
        records.swap(places[1], places[2]);
        records.remove(places[4]);
        let bytes = joined(&records);
        let (_, wanted) = read(&bytes);
        assert!(wanted.len() >= 3, "{what}: {wanted:?}");
        for taken in 0..50 {
            let mut reader = open(&bytes);
            for _ in 0..taken {
                reader.next().unwrap();
            }
            let place = reader.place();
            for _ in 0..2 {
                reader.go_to(&place).unwrap();
                while reader.next().unwrap().is_some() {}
                assert_eq!(reader.losses(), wanted, "{what}, after {taken} messages");
            }
        }
    });
}

/// Returns a chunk record that contains `content`, neither compressed nor protected by a checksum.
fn chunk_of(content: &[u8], times: [u64; 2]) -> Vec<u8> {
    let mut body = times.map(u64::to_le_bytes).concat();
    body.extend((content.len() as u64).to_le_bytes());
    body.extend([0; 4]);
    body.extend([0; 4]);
    body.extend((content.len() as u64).to_le_bytes());
    body.extend(content);
    [&[op::CHUNK][..], &(body.len() as u64).to_le_bytes(), &body].concat()
}

#[test]
fn chunk_within_a_chunk_is_reported_and_listed_by_recovery() {
    each(|what, records| {
        let mut records = records;
        let place = chunks(&records)[2];
        let mut nested = chunk_of(&records[place], [1_200_000_000, 1_290_000_000]);
        core::mem::swap(&mut records[place], &mut nested);
        let records = without_summary(records);
        let bytes = joined(&records);
        let (kinds, texts) = losses(&bytes);
        assert!(kinds.contains(&LossKind::Misplaced) && kinds.len() == 2, "{what}: {texts:?}");
        let mut open = || LogReader::new(Cursor::new(bytes.clone()), "nested".to_owned()).map(DiveLog::of);
        let mut output = Vec::new();
        let done = recover(&mut open, &mut output, &header(true).results, "nested.mcap").unwrap();
        assert_eq!(done.messages, (CHUNKS - 1) * PER_CHUNK, "{what}");
        assert!(done.losses.iter().any(|loss| loss.kind == LossKind::Misplaced), "{what}: {:?}", done.losses);
        let stated = read(&output).1;
        assert!(stated.iter().any(|loss| loss.to_string().contains("another chunk")), "{what}: {stated:?}");
    });
}
