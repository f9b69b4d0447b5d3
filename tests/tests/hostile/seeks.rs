//! Seeks in odd logs. After a seek back, the reader must not know channels that are defined later in the log.

use std::io::Cursor;

use headrace_replay::log::LogReader;

use crate::records::{MAGIC, channel, chunk, message, record, text};

/// A log with two channels. The summary lists one of them, and the second chunk defines the other one.
fn with_a_late_channel() -> Vec<u8> {
    let depth = channel(1, "/raw/depth", &[0; 4]);
    let first = [message(1, 5, b"a"), message(9, 6, b"b")].concat();
    let second = [channel(9, "/raw/late", &[0; 4]), message(9, 7, b"c"), message(1, 8, b"d")].concat();
    let chunks = [first, second].map(|records| chunk("", records.len() as u64, &records, (5, 8)));
    let mut statistics = vec![0; 46];
    statistics[10..14].copy_from_slice(&1_u32.to_le_bytes());
    let header = record(1, &[text(""), text("by hand")].concat());
    let data = [MAGIC, &header, &depth, &chunks.concat(), &record(15, &[0; 4])].concat();
    let summary = [depth, record(11, &statistics)].concat();
    let footer = record(2, &[&(data.len() as u64).to_le_bytes()[..], &[0; 12]].concat());
    [&data, &summary, &footer, MAGIC].concat()
}

/// Reads a log from the present position to its end. Returns the messages, and all losses that the reader has reported
/// since it was created.
fn rest(log: &mut LogReader<Cursor<Vec<u8>>>) -> (Vec<Vec<u8>>, Vec<String>) {
    let mut messages = Vec::new();
    while let Some(message) = log.next().unwrap() {
        messages.push(message.data.to_vec());
    }
    (messages, log.losses().iter().map(ToString::to_string).collect())
}

#[test]
fn channel_defined_later_is_unknown_after_seeking_back() {
    let mut log = LogReader::new(Cursor::new(with_a_late_channel()), "late".to_owned()).unwrap();
    let begin = log.place();
    let straight = rest(&mut log);
    assert_eq!(straight.0, [b"a", b"c", b"d"]);
    assert!(
        straight.1.iter().any(|loss| loss.contains("1 messages of channel 9, which the log doesn't define"))
    );
    let end = log.place();
    for _ in 0..2 {
        log.go_to(&begin).unwrap();
        assert_eq!(rest(&mut log), straight);
    }
    // This reader seeks to the end of the log before it reads anything. It must nevertheless know both channels.
    let mut other = LogReader::new(Cursor::new(with_a_late_channel()), "late".to_owned()).unwrap();
    other.go_to(&end).unwrap();
    assert_eq!((rest(&mut other), other.header().sources.len()), ((Vec::new(), straight.1), 1));
    assert_eq!(other.channels().count(), 2);
}
