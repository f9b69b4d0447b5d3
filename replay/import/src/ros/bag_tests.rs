//! Tests of the bag reader with generated bags.

use std::io::Cursor;

use proptest::prelude::*;

use super::*;
use crate::Import;

fn field(name: &str, value: &[u8]) -> Vec<u8> {
    let len = u32::try_from(name.len() + 1 + value.len()).unwrap();
    [&len.to_le_bytes(), name.as_bytes(), b"=", value].concat()
}

fn sized_bytes(bytes: &[u8]) -> Vec<u8> {
    [&u32::try_from(bytes.len()).unwrap().to_le_bytes(), bytes].concat()
}

fn whole(op: u8, fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header =
        fields.iter().fold(field("op", &[op]), |all, (name, value)| [all, field(name, value)].concat());
    [sized_bytes(&header), sized_bytes(data)].concat()
}

fn connection(number: u8, topic: &str) -> Vec<u8> {
    let data = [field("topic", topic.as_bytes()), field("type", b"std_msgs/Float64"), field("md5sum", b"*")]
        .concat();
    whole(7, &[("conn", &[number, 0, 0, 0]), ("topic", topic.as_bytes())], &data)
}

fn message(number: u8, seconds: u8) -> Vec<u8> {
    whole(2, &[("conn", &[number, 0, 0, 0]), ("time", &[seconds, 0, 0, 0, 0, 0, 0, 0])], &[0; 8])
}

fn chunk(records: &[Vec<u8>]) -> Vec<u8> {
    let bytes = records.concat();
    let size = u32::try_from(bytes.len()).unwrap().to_le_bytes();
    whole(5, &[("compression", b"none"), ("size", &size)], &bytes)
}

/// Builds a bag from chunks and index records. The bag's header states the start of the index, the number of index
/// records, and the number of chunks.
fn bag(chunks: &[Vec<u8>], index: &[Vec<u8>]) -> Vec<u8> {
    let header = |at: usize| {
        let connections = u32::try_from(index.len()).unwrap().to_le_bytes();
        let count = u32::try_from(chunks.len()).unwrap().to_le_bytes();
        let at = (at as u64).to_le_bytes();
        let fields = [("index_pos", &at[..]), ("conn_count", &connections), ("chunk_count", &count)];
        [MAGIC.to_vec(), whole(3, &fields, b"   ")].concat()
    };
    let at = header(0).len() + chunks.concat().len();
    [header(at), chunks.concat(), index.concat()].concat()
}

/// Reads a bag; returns the number of its entries and the losses.
fn read(file: &[u8]) -> (usize, Vec<String>) {
    let mut input = Input::new("bag", Cursor::new(file.to_vec()), Bag::default());
    let (mut order, mut count) = (Order::default(), 0);
    while input.more(&mut order).unwrap() {
        while order.pop().is_some() {
            count += 1;
        }
    }
    (count, input.report().losses)
}

fn three() -> [Vec<u8>; 2] {
    [chunk(&[connection(0, "/a"), message(0, 1), message(0, 2)]), chunk(&[message(0, 3)])]
}

#[test]
fn bag_messages_and_topics_are_read() {
    let file = bag(&three(), &[connection(0, "/a")]);
    assert_eq!(read(&file), (3, Vec::new()));
    let topics = Bag::topics("bag", Cursor::new(&file)).unwrap();
    assert_eq!(topics.iter().map(|topic| topic.name.as_str()).collect::<Vec<_>>(), ["/a"]);
    assert_eq!(topics[0].known, Ok(Type::Float64));
    // Without an index, the topics come from a scan of the whole bag.
    let cut = &file[..file.len() - 10];
    assert_eq!(Bag::topics("bag", Cursor::new(cut)).unwrap(), topics);
    assert!(Import::of(Input::new("bag", Cursor::new(MAGIC), Bag::default()), "message").is_err());
}

#[test]
fn damaged_chunk_loses_only_itself_and_is_reported() {
    let [first, second] = three();
    let mut broken = second.clone();
    let at = broken.windows(4).position(|window| window == b"none").unwrap();
    broken[at..at + 4].copy_from_slice(b"zstd");
    let (count, losses) = read(&bag(&[first.clone(), broken], &[]));
    assert_eq!(count, 2);
    assert!(losses[0].contains("with an unknown compression"), "{losses:?}");
    let garbage = [bag(std::slice::from_ref(&first), &[]), vec![0xEE; 30], second].concat();
    let (count, losses) = read(&garbage);
    assert_eq!(count, 3);
    assert!(losses[0].contains("no bag record: 1 times, 30 bytes"), "{losses:?}");
    assert!(losses[1].contains("states 1 chunks; it has 2"), "{losses:?}");
    let wild = [chunk(&[vec![9; 20]]), chunk(&[chunk(&[])]), chunk(&[message(7, 1)])];
    let said = read(&bag(&wild, &[])).1.join("; ");
    for words in
        ["chunks with invalid bytes at their end", "not allowed in chunks", "without an earlier definition"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn bag_cut_anywhere_delivers_messages_before_the_cut() {
    let file = bag(&three(), &[connection(0, "/a")]);
    let mut before = 0;
    for cut in MAGIC.len()..file.len() {
        let (count, losses) = read(&file[..cut]);
        assert!(!losses.is_empty() || count == 3, "cut at {cut}");
        assert!((before..=3).contains(&count), "cut at {cut}");
        before = count;
    }
    assert_eq!(before, 3);
}

proptest! {
    #[test]
    fn arbitrary_bytes_are_read_as_a_bag_without_a_panic(
        bytes in proptest::collection::vec(any::<u8>(), 0..600),
        at in 0_usize..400,
    ) {
        let file = bag(&three(), &[connection(0, "/a")]);
        let at = at.min(file.len());
        let mixed = [&file[..at], &bytes].concat();
        read(&mixed);
        drop(Bag::topics("bag", Cursor::new(&mixed)));
    }
}

#[test]
fn chunks_with_a_false_unpacked_length_are_refused() {
    assert_eq!(unpack(b"none", b"abc", 3, false), Unpacked::Whole(b"abc".to_vec()));
    assert!(matches!(unpack(b"none", b"abc", 4, false), Unpacked::Bad(_)));
    assert_eq!(unpack(b"none", b"abc", 4, true), Unpacked::Cut(b"abc".to_vec()));
    assert!(matches!(unpack(b"none", b"abc", u32::MAX, true), Unpacked::Bad(_)));
    for packing in [b"bz2", b"lz4", b"zst"] {
        assert!(matches!(unpack(packing, b"nothing of the kind", 3, false), Unpacked::Bad(_)));
    }
}
