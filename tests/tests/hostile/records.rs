//! Hand-made MCAP records and zstd frames, because ordinary writers can't produce invalid ones.
//!
//! Sources: MCAP format specification, "Records"; RFC 8878, 3.1.1.

pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A record: opcode, length and content.
pub(crate) fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode], (body.len() as u64).to_le_bytes().as_slice(), body].concat()
}

/// A string as MCAP stores it: first its length, and then its bytes.
pub(crate) fn text(text: &str) -> Vec<u8> {
    [&u32::try_from(text.len()).unwrap().to_le_bytes(), text.as_bytes()].concat()
}

/// A map of strings as MCAP stores it: its length in bytes, and then its entries.
pub(crate) fn map(entries: impl Iterator<Item = (String, String)>) -> Vec<u8> {
    let body: Vec<u8> = entries.flat_map(|(key, value)| [text(&key), text(&value)].concat()).collect();
    [&u32::try_from(body.len()).unwrap().to_le_bytes(), body.as_slice()].concat()
}

pub(crate) fn channel(id: u16, topic: &str, metadata: &[u8]) -> Vec<u8> {
    record(4, &[&id.to_le_bytes(), &[0; 2][..], &text(topic), &text(""), metadata].concat())
}

pub(crate) fn schema(id: u16, name: &str) -> Vec<u8> {
    record(3, &[&id.to_le_bytes()[..], &text(name), &text(""), &[0; 4]].concat())
}

pub(crate) fn message(channel: u16, at: u64, data: &[u8]) -> Vec<u8> {
    record(5, &[message_head(channel, at).as_slice(), data].concat())
}

/// Fields of a message record that precede its data.
pub(crate) fn message_head(channel: u16, at: u64) -> Vec<u8> {
    [&channel.to_le_bytes()[..], &[0; 4], &at.to_le_bytes(), &at.to_le_bytes()].concat()
}

pub(crate) fn metadata(name: &str, entries: impl Iterator<Item = (String, String)>) -> Vec<u8> {
    record(12, &[text(name), map(entries)].concat())
}

/// An attachment without a checksum. It states the true length of its data.
pub(crate) fn attachment(name: &str, data: &[u8]) -> Vec<u8> {
    let head = [&[0; 16][..], &text(name), &text(""), &(data.len() as u64).to_le_bytes()].concat();
    record(9, &[&head, data, &[0; 4]].concat())
}

/// A chunk that states the unpacked size `unpacked`. It states `times` as the times of its first and last messages.
pub(crate) fn chunk(packing: &str, unpacked: u64, packed: &[u8], times: (u64, u64)) -> Vec<u8> {
    let numbers = [times.0, times.1, unpacked].map(u64::to_le_bytes).concat();
    let len = (packed.len() as u64).to_le_bytes();
    record(6, &[&numbers, &[0; 4][..], &text(packing), &len, packed].concat())
}

/// A complete log that contains these records.
pub(crate) fn log(records: &[Vec<u8>]) -> Vec<u8> {
    ended(records, 0)
}

/// As [`log`], with a footer that gives the start of the summary.
pub(crate) fn ended(records: &[Vec<u8>], summary: u64) -> Vec<u8> {
    let header = record(1, &[text(""), text("by hand")].concat());
    let footer = record(2, &[&summary.to_le_bytes()[..], &[0; 12]].concat());
    [MAGIC, &header, &records.concat(), &record(15, &[0; 4]), &footer, MAGIC].concat()
}

/// A part of the data in a zstd frame, before compression.
pub(crate) enum Part<'a> {
    Bytes(&'a [u8]),
    /// One byte value and the number of its repetitions.
    Repeated(u8, u64),
}

/// A zstd frame with a window of 2^`window_log` bytes; `window_log` is 10 to 41.
pub(crate) fn zstd(window_log: u8, parts: &[Part<'_>]) -> Vec<u8> {
    let mut frame = vec![0x28, 0xB5, 0x2F, 0xFD, 0, (window_log - 10) << 3];
    let most = 1_u64 << window_log.min(17);
    let mut block = |kind: u32, len: u64, content: &[u8]| {
        let head = u32::try_from(len).unwrap() << 3 | kind << 1;
        frame.extend(&head.to_le_bytes()[..3]);
        frame.extend(content);
    };
    for part in parts {
        match part {
            Part::Bytes(bytes) => {
                bytes.chunks(1 << 10).for_each(|piece| block(0, piece.len() as u64, piece));
            }
            Part::Repeated(byte, count) => {
                (0..count / most).for_each(|_| block(1, most, &[*byte]));
                block(1, count % most, &[*byte]);
            }
        }
    }
    // These bytes are the header of an empty block that is marked as the last one. It ends the zstd frame.
    frame.extend([1, 0, 0]);
    frame
}

/// A chunk packed by [`zstd`], with its true size.
pub(crate) fn packed_chunk(parts: &[Part<'_>], times: (u64, u64)) -> Vec<u8> {
    let lengths = parts.iter().map(|part| match part {
        Part::Bytes(bytes) => bytes.len() as u64,
        Part::Repeated(_, count) => *count,
    });
    chunk("zstd", lengths.sum(), &zstd(17, parts), times)
}

/// Header of a record with `len` bytes of content, which follow separately.
pub(crate) fn record_head(opcode: u8, len: u64) -> Vec<u8> {
    [&[opcode], len.to_le_bytes().as_slice()].concat()
}
