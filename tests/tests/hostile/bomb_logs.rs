//! Logs whose claimed or unpacked size is far larger than the file.

use crate::records::{
    Part, attachment, channel, chunk, ended, log, map, message, message_head, metadata, packed_chunk, record,
    record_head, schema, text, zstd,
};

/// A bomb log, with the text that a replay of it must report.
pub(crate) struct Bomb {
    pub(crate) name: &'static str,
    pub(crate) bytes: Vec<u8>,
    /// Words that the report of a replay must contain. A `|` separates alternatives, one of which must occur.
    pub(crate) expected_text: &'static str,
}

const MIB: u64 = 1 << 20;
const TOO_LARGE: &str = "larger than the 33554432 bytes that are read into memory";
const SWELLS: &str = "chunks that would unpack to over 512 times the length of the log";
const HEADERS: &str = "more than 8388608 bytes of definitions and metadata";
const ATTACHMENTS: &str = "more than 16777216 bytes of attachments";

fn depth() -> Vec<u8> {
    channel(1, "/raw/depth", &[0; 4])
}

fn numbered(count: u32) -> impl Iterator<Item = (String, String)> {
    (0..count).map(|number| (format!("{number:x}"), String::new()))
}

/// A record of `len` bytes, which consists of `front` and one repeated byte.
fn filled<'a>(head: &'a mut Vec<u8>, opcode: u8, front: &[u8], len: u64) -> [Part<'a>; 2] {
    *head = [record_head(opcode, len), front.to_vec()].concat();
    [Part::Bytes(head), Part::Repeated(b'a', len - front.len() as u64)]
}

/// Logs with a bomb inside a compressed chunk.
fn chunks() -> Vec<Bomb> {
    let bomb = |name, records: &[Vec<u8>], expected_text| Bomb { name, bytes: log(records), expected_text };
    let zeros = |len| packed_chunk(&[Part::Repeated(0, len)], (1, 2));
    let mut head = Vec::new();
    let topic_front = [&[9, 0, 0, 0][..], &u32::try_from(200 * MIB).unwrap().to_le_bytes()].concat();
    let topic = packed_chunk(&filled(&mut head, 4, &topic_front, 200 * MIB + 16), (1, 2));
    let packets = |mib| {
        let message = message(1, 5, &vec![7; usize::try_from(mib * MIB).unwrap()]);
        chunk("", message.len() as u64, &message, (5, 5))
    };
    let mut head = Vec::new();
    let packed = packed_chunk(&filled(&mut head, 5, &message_head(1, 5), 15 * MIB), (5, 5));
    let small: Vec<u8> = (0..MIB).flat_map(|n| message(1, n, b"")).collect();
    let nested = [record_head(6, 40 + 100), vec![0xFF; 140]].concat();
    let nested = packed_chunk(&[Part::Bytes(&nested.repeat(1000))], (1, 2));
    let undefined: Vec<u8> = (0..=u16::MAX).flat_map(|id| message(id, 5, b"")).collect();
    let definitions: Vec<u8> =
        (2..=u16::MAX).flat_map(|id| channel(id, &format!("/{id}/{}", "t".repeat(300)), &[0; 4])).collect();
    vec![
        bomb("a topic of 200 MB in a chunk", &[depth(), topic], TOO_LARGE),
        bomb("8 GiB of zeros in a chunk", &[depth(), zeros(8 << 30)], TOO_LARGE),
        bomb("16 GiB of zeros in 500 chunks", &[depth(), zeros(31 * MIB).repeat(500)], SWELLS),
        bomb(
            "1 GiB that claims to be 100 bytes",
            &[depth(), chunk("zstd", 100, &zstd(17, &[Part::Repeated(0, 1 << 30)]), (1, 2))],
            "can't be decompressed",
        ),
        bomb(
            "100 bytes that claim to be 31 MiB",
            &[depth(), chunk("zstd", 31 * MIB, &zstd(17, &[Part::Repeated(0, 100)]), (1, 2)).repeat(1000)],
            "can't be decompressed|over 512 times",
        ),
        bomb(
            "a window of 128 MiB",
            &[depth(), chunk("zstd", MIB, &zstd(27, &[Part::Repeated(0, MIB)]), (1, 2))],
            "unpacking would take more than 16777216 bytes",
        ),
        bomb(
            "a window of 2 TiB",
            &[depth(), chunk("zstd", MIB, &zstd(41, &[Part::Repeated(0, MIB)]), (1, 2))],
            "a chunk ",
        ),
        bomb(
            "a million empty messages in a chunk",
            &[depth(), chunk("", small.len() as u64, &small, (0, MIB))],
            TOO_LARGE,
        ),
        bomb(
            "3 messages of 31 MiB at once",
            &[depth(), packets(31).repeat(3)],
            "messages of over 4096 bytes",
        ),
        bomb(
            "7 overlapping chunks of 15 MiB",
            &[depth(), packets(15).repeat(7)],
            "messages of over 4096 bytes",
        ),
        bomb("40 overlapping chunks of 15 MiB, packed", &[depth(), packed.repeat(40)], SWELLS),
        bomb("chunks in chunks", &[depth(), nested], ""),
        bomb(
            "messages of 65,536 undefined channels",
            &[depth(), chunk("", undefined.len() as u64, &undefined, (5, 5)).repeat(4)],
            "messages of channel",
        ),
        bomb(
            "65,534 definitions in a chunk",
            &[depth(), chunk("", definitions.len() as u64, &definitions, (0, 0))],
            "more than 8388608 bytes of def|more than 4096 channels",
        ),
    ]
}

/// Logs with a bomb in a record outside of chunks.
fn headers() -> Vec<Bomb> {
    let bomb = |name, records: &[Vec<u8>], expected_text| Bomb { name, bytes: log(records), expected_text };
    let channels = |topic: &str, metadata: &[u8]| -> Vec<u8> {
        (2..=u16::MAX).flat_map(|id| channel(id, &format!("{topic}{id}"), metadata)).collect()
    };
    let qos = map(std::iter::once(("qos".to_owned(), "q".repeat(350))));
    let schemas: Vec<u8> =
        (1..=u16::MAX).flat_map(|id| schema(id, &format!("{id}{}", "s".repeat(400)))).collect();
    let many: Vec<u8> = (0..200_000_u32).flat_map(|n| metadata(&format!("m{n}"), numbered(2))).collect();
    let stated = (0..60_000).map(|n| (format!("{n:06}"), "- - gone".to_owned()));
    let part = [("dive", "d"), ("number", "4294967295"), ("messages", "18446744073709551615"), ("tick", "-")];
    let part = part.into_iter().map(|(key, value)| (key.to_owned(), value.to_owned()));
    let long = message(1, 5, &vec![7; usize::try_from(100 * MIB).unwrap()]);
    let far = [
        message(1, 5, b"a"),
        metadata("far", std::iter::once((String::new(), "x".repeat(60 << 20)))),
        message(1, 6, b"b"),
    ];
    vec![
        bomb("65,534 sources", &[depth(), channels("/raw/s", &[0; 4])], "more than 1024 sources"),
        bomb("65,534 channels", &[depth(), channels("/c", &[0; 4])], "more than 4096 channels"),
        bomb("25 MB of definitions", &[depth(), channels("/c", &qos)], HEADERS),
        bomb("65,535 schemas of 400 letters", &[schemas, depth()], HEADERS),
        bomb(
            "a channel with a million entries",
            &[channel(2, "/raw/depth", &map(numbered(1_000_000)))],
            "bytes of definitions and metadata|bytes that aren't records",
        ),
        bomb("metadata of a million entries", &[depth(), metadata("m", numbered(500_000))], HEADERS),
        bomb(
            "metadata whose long name is in each entry",
            &[depth(), metadata(&"n".repeat(1 << 20), numbered(10_000))],
            HEADERS,
        ),
        bomb("200,000 records of metadata", &[depth(), many], HEADERS),
        bomb(
            "60,000 losses",
            &[depth(), metadata("headrace.losses", stated)],
            "gone|definitions and metadata",
        ),
        bomb(
            "half a million empty attachments",
            &[depth(), attachment("a", b"").repeat(500_000)],
            ATTACHMENTS,
        ),
        bomb(
            "20 attachments of 4 MiB",
            &[depth(), attachment("a", &vec![0; 4 << 20]).repeat(20)],
            ATTACHMENTS,
        ),
        bomb(
            "600,000 empty chunks",
            &[depth(), chunk("", 0, b"", (0, 0)).repeat(600_000)],
            "more than 524288 chunks",
        ),
        bomb(
            "600,000 empty chunks, the last 70,000 with earlier times",
            &[depth(), chunk("", 0, b"", (9, 9)).repeat(530_000), chunk("", 0, b"", (1, 1)).repeat(70_000)],
            "more than 524288 chunks",
        ),
        bomb(
            "100,000 broken chunks",
            &[depth(), chunk("zstd", 50, b"no frame at all", (0, 0)).repeat(100_000)],
            "can't be decompressed",
        ),
        bomb(
            "50,000 chunks with an unknown compression",
            &[depth(), chunk(&"z".repeat(900), 50, b"no frame at all", (0, 0)).repeat(50_000)],
            "zstd and lz4 are supported",
        ),
        bomb("a message of 100 MiB outside chunks", &[depth(), long], TOO_LARGE),
        bomb("messages 60 MiB apart", &[depth(), far.concat()], HEADERS),
        bomb(
            "a part that claims to follow 4294967294 other parts",
            &[depth(), metadata("headrace.part", part)],
            "parts 1 to 4294967294 of the recording are missing",
        ),
    ]
}

/// Logs with a record that states a wrong offset or size.
fn pointers() -> Vec<Bomb> {
    let some = |records: &[Vec<u8>]| log(&[&[depth()], records, &[message(1, 5, b"a")]].concat());
    let index = |count: u32| record(7, &[&[1, 0][..], &count.to_le_bytes(), &[0; 64]].concat());
    // The attachment claims to have 2^64-1 bytes, but its record has 2 KiB.
    let endless = [&[0; 16][..], &text("endless"), &text(""), &u64::MAX.to_le_bytes(), &[0; 2000]].concat();
    let nameless =
        [&[0; 16][..], &text(&"n".repeat(3000)), &text(""), &5_u64.to_le_bytes(), b"hello", &[0; 4]].concat();
    let offset = |to: u64| record(14, &[&[8][..], &to.to_le_bytes(), &u64::MAX.to_le_bytes()].concat());
    let circle = ended(&[depth(), message(1, 5, b"a"), offset(8).repeat(1000)], 8);
    let index_of_chunks =
        [&[0; 16][..], &8_u64.to_le_bytes(), &u64::MAX.to_le_bytes(), &u32::MAX.to_le_bytes(), &[0; 40]]
            .concat();
    let bomb = |name, bytes, expected_text| Bomb { name, bytes, expected_text };
    let mut statistics = vec![0xFF; 42];
    statistics.extend([0xFF; 4]);
    let ticks: Vec<u8> =
        (0..1000).flat_map(|n| message(2, n, &[&[0xFF; 20][..], &[0; 6]].concat())).collect();
    let results: Vec<u8> = (0..20_000_u64)
        .flat_map(|n| message(3, n, &[&n.to_le_bytes()[..], &n.to_le_bytes(), &[1; 2000]].concat()))
        .collect();
    vec![
        bomb("an attachment of 2^64-1 bytes", some(&[record(9, &endless)]), "bytes that aren't records"),
        bomb(
            "an attachment with a name of 3,000 letters",
            some(&[record(9, &nameless)]),
            "a name too long to be read",
        ),
        bomb(
            "a record of 2^64-1 bytes",
            some(&[record_head(6, u64::MAX), vec![0; 100]]),
            "bytes that aren't records|ends before",
        ),
        bomb("indexes of 2^32-1 entries", some(&[index(u32::MAX).repeat(1000)]), "bytes that aren't records"),
        bomb("a summary that points at the beginning", circle, "the summary isn't where the log says"),
        bomb(
            "an index of chunks beyond the end",
            some(&[record(8, &index_of_chunks).repeat(1000)]),
            "bytes that aren't records",
        ),
        bomb("statistics of 2^64-1 messages", some(&[record(11, &statistics)]), "bytes that aren't records"),
        bomb("ticks of 2^32-1 packets", log(&[depth(), channel(2, "/loop/tick", &[0; 4]), ticks]), ""),
        bomb(
            "40 MB of meaningless results",
            log(&[depth(), channel(3, "/result/poses", &[0; 4]), results]),
            "",
        ),
    ]
}

/// All bomb logs.
pub(crate) fn all() -> Vec<Bomb> {
    [chunks(), headers(), pointers()].into_iter().flatten().collect()
}
