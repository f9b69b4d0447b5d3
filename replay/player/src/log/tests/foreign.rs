//! Logs written by other programs, with various options of the writer.

use std::collections::BTreeSet;
use std::process::Command;

use mcap::records::{MessageHeader, Record, op};
use mcap::{Compression, WriteOptions};
use proptest::prelude::*;

use super::super::{LogWriter, Loss, LossKind};
use super::*;

const TOPICS: [&str; 4] = ["/raw/zeta", "/tf", "/raw/alpha", "/sent/alpha"];

/// Messages in the order of writing, each with topic, log time and sequence. They are ordered neither by time nor by
/// channel.
fn messages() -> Vec<(usize, u64, u32)> {
    let mut messages = Vec::new();
    for n in 0..400_u32 {
        let topic = usize::try_from(n * 7 % 4).unwrap();
        // Log times repeat, and go back by up to 30 messages.
        messages.push((topic, 1000 + u64::from((n - n * 13 % 31 % (n + 1)) / 2), n));
    }
    messages
}

/// Messages in the expected reading order: by time, then by channel, then by sequence. Raw channels come first, by
/// name; other channels follow, by topic.
fn wanted() -> Vec<(String, u64, u32)> {
    let kinds = [("raw 1", 1), ("other", 3), ("raw 0", 0), ("sent 0", 2)];
    let mut wanted: Vec<_> =
        messages().into_iter().map(|(t, at, n)| (at, kinds[t].1, n, kinds[t].0)).collect();
    wanted.sort_unstable();
    wanted.into_iter().map(|(at, _, n, kind)| (kind.to_owned(), at, n)).collect()
}

fn write(options: WriteOptions) -> Vec<u8> {
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let channels = TOPICS.map(|topic| writer.add_channel(0, topic, "x", &[].into()).unwrap());
    for (topic, log_time, sequence) in messages() {
        let channel_id = channels[topic];
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time - 1 };
        writer.write_to_known_channel(&header, &sequence.to_le_bytes()).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn check(bytes: &[u8], what: &str) -> Vec<Loss> {
    let mut reader = open(bytes);
    assert!(!reader.has_ticks());
    let ids: Vec<_> = reader.header().sources.iter().map(|source| source.id.as_str()).collect();
    assert_eq!(ids, ["alpha", "zeta"], "{what}");
    let seen = read_all(&mut reader);
    for message in &seen {
        assert_eq!((message.2, &message.4[..]), (message.1 - 1, &message.3.to_le_bytes()[..]), "{what}");
    }
    let seen: Vec<_> = seen.into_iter().map(|(kind, at, _, sequence, _)| (kind, at, sequence)).collect();
    assert_eq!(seen, wanted(), "{what}");
    assert_eq!(reader.late(), 0, "{what}");
    reader.losses().to_vec()
}

/// Returns all combinations of the MCAP writer's options, with names.
fn all_options() -> Vec<(String, WriteOptions)> {
    let mut all = Vec::new();
    for (name, compression) in
        [("plain", None), ("zstd", Some(Compression::Zstd)), ("lz4", Some(Compression::Lz4))]
    {
        for (chunk, chunk_size) in [("small", Some(200)), ("one", None)] {
            for (summary, emit) in [("summary", true), ("no summary", false)] {
                let options = WriteOptions::new().compression(compression).chunk_size(chunk_size);
                let options = options.emit_summary_records(emit).emit_message_indexes(emit);
                all.push((format!("{name}, {chunk}, {summary}"), options.calculate_chunk_crcs(emit)));
            }
        }
    }
    all.push(("no chunks".to_owned(), WriteOptions::new().use_chunks(false)));
    let bare = WriteOptions::new().use_chunks(false).emit_summary_records(false).emit_summary_offsets(false);
    all.push(("no chunks, no summary".to_owned(), bare));
    all
}

#[test]
fn reading_order_is_independent_of_write_options() {
    for (name, options) in all_options() {
        assert_eq!(check(&write(options), &name), [], "{name}");
    }
}

#[test]
fn unfinished_logs_are_read_and_reported_as_truncated() {
    for (name, options) in all_options() {
        let bytes = write(options);
        // The log ends before its closing records. The data end record is the first of them.
        let end = places(&bytes, op::DATA_END)[0];
        let losses = check(&bytes[..end], &name);
        assert_eq!((losses.len(), &losses[0].kind), (1, &LossKind::Truncated), "{name}");
    }
}

#[test]
fn unclosed_chunk_delivers_its_messages() {
    for compression in [None, Some(Compression::Lz4), Some(Compression::Zstd)] {
        let mut file = Cursor::new(Vec::new());
        let mut writer =
            WriteOptions::new().compression(compression).compression_threads(0).create(&mut file).unwrap();
        let channel_id = writer.add_channel(0, "/raw/a", "", &[].into()).unwrap();
        for n in 0..20_000_u64 {
            let header = MessageHeader { channel_id, sequence: 0, log_time: n, publish_time: n };
            writer.write_to_known_channel(&header, &(n * n * 0x9E37_79B9).to_le_bytes()).unwrap();
        }
        // The writer must not be dropped, because dropping it finishes the file.
        std::mem::forget(writer);
        let mut reader = open(file.get_ref());
        let seen = read_all(&mut reader);
        let last = seen.last().unwrap_or_else(|| panic!("{compression:?}: {:?}", reader.losses())).1;
        assert!(last > 5000 && seen.iter().map(|message| message.1).eq(0..=last), "{compression:?}: {last}");
        let loss = &reader.losses()[0];
        assert_eq!((&loss.kind, loss.from), (&LossKind::Truncated, Some(MonoNs(last))));
    }
}

#[test]
fn cut_logs_deliver_earlier_messages_and_report_the_cut() {
    for (name, options) in all_options() {
        let bytes = write(options);
        let whole: BTreeSet<_> = read(&bytes).0.into_iter().map(|message| message.4).collect();
        for cut in (8..bytes.len()).step_by(41) {
            let (seen, losses) = read(&bytes[..cut]);
            assert!(seen.iter().all(|message| whole.contains(&message.4)), "{name}, cut at {cut}");
            assert!(losses.iter().any(|loss| loss.kind == LossKind::Truncated), "{name}, cut at {cut}");
        }
    }
}

#[test]
fn copied_log_with_renumbered_channels_is_read() {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for at in 0..30_u16 {
        let (source, at) = (at % 3, MonoNs(at.into()));
        log.raw(source, at, at, &[]).unwrap();
        log.tick(at.0, at, &[source]).unwrap();
    }
    let bytes = log.finish().unwrap().0;
    let mut copy = mcap::Writer::new(Cursor::new(Vec::new())).unwrap();
    let ids: Vec<u16> = (0..40).rev().collect();
    for record in mcap::read::ChunkFlattener::new(&bytes).unwrap() {
        match record.unwrap() {
            Record::Metadata(record) => copy.write_metadata(&record).unwrap(),
            Record::Channel(c) if c.schema_id == 0 => {
                let id = ids[usize::from(c.id)];
                copy.add_channel_with_id(id, 0, &c.topic, &c.message_encoding, &c.metadata).unwrap();
            }
            Record::Message { mut header, data } => {
                header.channel_id = ids[usize::from(header.channel_id)];
                copy.write_to_known_channel(&header, &data).unwrap();
            }
            _ => {}
        }
    }
    copy.finish().unwrap();
    let mut reader = open(&copy.into_inner().into_inner());
    assert_eq!(read_all(&mut reader), read(&bytes).0);
    assert_eq!(reader.header().sources, header(true).sources);
    assert_eq!(reader.losses(), []);
}

#[test]
fn changed_byte_outside_chunks_is_reported() {
    let mut bytes = write(WriteOptions::new().use_chunks(false));
    let place = bytes.windows(4).rposition(|window| window == 150_u32.to_le_bytes()).unwrap();
    bytes[place + 3] ^= 1;
    let (seen, losses) = read(&bytes);
    assert_eq!(seen.len(), 400);
    assert_eq!((losses.len(), &losses[0].kind), (1, &LossKind::DataSection), "{losses:?}");
}

#[test]
fn wrong_message_length_loses_at_most_two_messages() {
    let bytes = write(WriteOptions::new().use_chunks(false));
    let at = places(&bytes, op::MESSAGE)[200];
    for lie in [0, 21, 22, 25, 100, 1 << 30, u64::MAX] {
        let mut bytes = bytes.clone();
        bytes[at + 1..at + 9].copy_from_slice(&u64::to_le_bytes(lie));
        let (seen, losses) = read(&bytes);
        // With some wrong lengths, no record seems to begin at `at`. The length of the previous message then seems
        // wrong too.
        let lost = if (22..1000).contains(&lie) { 1 } else { 2 };
        assert_eq!(seen.len(), 400 - lost, "length {lie}");
        assert_eq!((losses.len(), &losses[0].kind), (1, &LossKind::Framing), "length {lie}: {losses:?}");
        assert_eq!(losses[0].bytes, (9 + 22 + 4) * lost as u64);
    }
}

#[test]
fn loss_of_all_records_before_the_closing_bytes_is_reported() {
    let chunked = WriteOptions::new().chunk_size(Some(200)).compression(None);
    for (options, opcode) in [(chunked, op::CHUNK), (WriteOptions::new().use_chunks(false), op::MESSAGE)] {
        let whole = write(options);
        let (_, closing) = whole.split_at(whole.len() - mcap::MAGIC.len());
        let from = places(&whole, opcode)[3];
        let (seen, losses) = read(&[&whole[..from], closing].concat());
        assert!(!seen.is_empty());
        assert!(matches!(losses[..], [Loss { kind: LossKind::Truncated, .. }]), "{losses:?}");
    }
}

#[test]
fn message_with_a_footer_opcode_is_reported() {
    let mut log = write(WriteOptions::new().use_chunks(false));
    let message = places(&log, op::MESSAGE)[7];
    log[message] = op::FOOTER;
    let (seen, losses) = read(&log);
    assert!(seen.len() < 400);
    assert!(matches!(losses[..], [Loss { kind: LossKind::Framing, .. }]), "{losses:?}");
}

#[test]
fn removal_of_whole_records_is_reported() {
    let options = || WriteOptions::new().chunk_size(Some(200)).compression(None);
    let whole = write(options());
    let chunks = places(&whole, op::CHUNK);
    let without = |part: core::ops::Range<usize>| [&whole[..part.start], &whole[part.end..]].concat();
    let (seen, losses) = read(&without(chunks[3]..chunks[4]));
    assert!(seen.len() < 400);
    assert!(matches!(losses[..], [Loss { kind: LossKind::Displaced, .. }]), "{losses:?}");
    let (data_end, footer) = (places(&whole, op::DATA_END)[0], places(&whole, op::FOOTER)[0]);
    for part in [data_end..record_after(&whole, data_end), chunks[3]..footer] {
        let (_, losses) = read(&without(part));
        assert!(matches!(losses[..], [Loss { kind: LossKind::Truncated, .. }]), "{losses:?}");
    }
    // Without a summary, nothing states where the closing records should be.
    assert_eq!(read(&write(options().emit_summary_records(false))).1, []);
}

#[test]
fn messages_of_an_undefined_channel_are_counted() {
    let mut bytes = write(WriteOptions::new().use_chunks(false).emit_summary_records(false));
    let place = bytes.windows(9).position(|window| window == b"/raw/zeta").unwrap();
    let record = place - 4 - 4 - 9;
    bytes.drain(record..record_after(&bytes, record));
    let (seen, losses) = read(&bytes);
    assert_eq!(seen.len(), 300);
    let unknown = |loss: &&Loss| matches!(loss.kind, LossKind::UnknownChannel { messages: 100, .. });
    assert_eq!(losses.iter().filter(unknown).count(), 1, "{losses:?}");
}

#[test]
fn messages_of_chunks_with_wrong_times_are_counted_as_late() {
    let mut bytes = write(WriteOptions::new().compression(None).chunk_size(Some(200)));
    for (number, at) in places(&bytes, op::CHUNK).into_iter().enumerate() {
        let later = (1_000_000 * (number as u64 + 1)).to_le_bytes();
        bytes[at + 9..at + 17].copy_from_slice(&later);
        bytes[at + 17..at + 25].copy_from_slice(&later);
    }
    let mut reader = open(&bytes);
    assert_eq!(read_all(&mut reader).len(), 400);
    assert!(reader.late() > 0);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Reading changed logs never panics, and reads no message twice.
    ///
    /// These logs have no checksums, so changes may go unnoticed. A changed opcode may turn another record into a
    /// message.
    #[test]
    fn changed_foreign_logs_are_read_without_a_panic(
        way in 0..14_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let mut bytes = write(all_options().swap_remove(way).1);
        for (place, value) in &changes {
            let place = place.index(bytes.len());
            bytes[place] = *value;
        }
        if let Ok(mut reader) = LogReader::new(Cursor::new(bytes), "changed".to_owned()) {
            prop_assert!(read_all(&mut reader).len() <= 400 + changes.len());
        }
    }
}

/// Python program that writes the messages of [`messages`] with the `mcap` package.
const PYTHON_WRITER: &str = r#"
import sys
from mcap.writer import CompressionType, IndexType, Writer
path, compression, chunking, summary = sys.argv[1], sys.argv[2], sys.argv[3] == "yes", sys.argv[4] == "yes"
writer = Writer(path, chunk_size=200, compression=CompressionType[compression], use_chunking=chunking,
    index_types=IndexType.ALL if summary else IndexType.NONE, repeat_channels=summary, repeat_schemas=summary,
    use_statistics=summary, use_summary_offsets=summary, enable_crcs=summary, enable_data_crcs=not chunking)
writer.start("", "test")
schema = writer.register_schema("s", "jsonschema", b"{}")
channels = [writer.register_channel(t, "x", schema) for t in ["/raw/zeta", "/tf", "/raw/alpha", "/sent/alpha"]]
for n in range(400):
    at = 1000 + (n - n * 13 % 31 % (n + 1)) // 2
    writer.add_message(channels[n * 7 % 4], at, n.to_bytes(4, "little"), at - 1, n)
writer.finish()
"#;

#[test]
fn logs_of_the_python_writer_are_read() {
    let python = |arguments: &[&str]| Command::new("python3").args(arguments).output();
    if !python(&["-c", "import mcap.writer"]).is_ok_and(|output| output.status.success()) {
        headrace_support::skipped("python3 with the package mcap is not there");
        return;
    }
    let path = std::env::temp_dir().join(format!("headrace-python-{}.mcap", std::process::id()));
    let name = path.to_str().unwrap();
    for compression in ["NONE", "LZ4", "ZSTD"] {
        for chunking in ["yes", "no"] {
            for summary in ["yes", "no"] {
                let what = format!("{compression}, chunks {chunking}, summary {summary}");
                let output = python(&["-c", PYTHON_WRITER, name, compression, chunking, summary]).unwrap();
                assert!(output.status.success(), "{what}: {}", String::from_utf8_lossy(&output.stderr));
                assert_eq!(check(&std::fs::read(&path).unwrap(), &what), [], "{what}");
            }
        }
    }
    std::fs::remove_file(&path).unwrap();
}

/// Returns a log with an attachment of that name, and the position of the attachment's record.
fn with_attachment(name: &str) -> (Vec<u8>, usize) {
    let mut writer = WriteOptions::new().create(Cursor::new(Vec::new())).unwrap();
    let channel_id = writer.add_channel(0, "/raw/a", "x", &[].into()).unwrap();
    let (log_time, publish_time) = (5, 5);
    writer
        .write_to_known_channel(&MessageHeader { channel_id, sequence: 0, log_time, publish_time }, b"a")
        .unwrap();
    let (name, media_type, data) = (name.to_owned(), "text/plain".to_owned(), vec![7; 3000].into());
    writer.attach(&mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data }).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let at = places(&bytes, op::ATTACHMENT)[0];
    (bytes, at)
}

#[test]
fn unreadable_attachment_is_left_out_and_reported() {
    let (whole, at) = with_attachment("notes.txt");
    assert_eq!(read(&whole).1, vec![]);
    // Before the data's length come the opcode, the record length and two timestamps. The name and the media type
    // follow, each with its own length.
    let data_len_at = at + 9 + 16 + 4 + "notes.txt".len() + 4 + "text/plain".len();
    assert_eq!(whole[data_len_at..data_len_at + 8], 3000_u64.to_le_bytes());
    for len in [u64::MAX, u64::MAX - 3, u64::MAX - 60, 1 << 63, 3001] {
        let mut bytes = whole.clone();
        bytes[data_len_at..data_len_at + 8].copy_from_slice(&len.to_le_bytes());
        let (seen, losses) = read(&bytes);
        assert_eq!((seen.len(), losses.is_empty()), (1, false), "{len}");
    }
    let (long, _) = with_attachment(&"n".repeat(1100));
    let (seen, losses) = read(&long);
    assert_eq!(seen.len(), 1);
    assert!(matches!(losses.as_slice(), [Loss { kind: LossKind::Attachment(_), .. }]), "{losses:?}");
}
