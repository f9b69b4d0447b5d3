//! Resuming at an earlier position of a damaged log gives the messages and losses of a straight read.

use mcap::WriteOptions;
use mcap::records::{MessageHeader, op};
use proptest::prelude::*;

use super::super::LogWriter;
use super::*;

const MESSAGES: u64 = 120;

/// Returns a log of this program, which is read in file order.
fn by_ticks() -> Vec<u8> {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for number in 0..MESSAGES {
        let at = MonoNs(1_000 + number);
        match number % 3 {
            0 => log.tick(number, at, &[0, 1]).unwrap(),
            source => log.raw(u16::try_from(source).unwrap(), at, at, &noise(number, 20)).unwrap(),
        }
        if number % 8 == 7 {
            log.flush().unwrap();
        }
    }
    log.finish().unwrap().0
}

/// Returns a log of another writer. Its chunks overlap in time.
fn by_times() -> Vec<u8> {
    let mut writer =
        WriteOptions::new().chunk_size(Some(300)).compression(None).create(Cursor::new(Vec::new())).unwrap();
    let channels = ["/raw/b", "/raw/a"].map(|topic| writer.add_channel(0, topic, "x", &[].into()).unwrap());
    for sequence in 0..120_u32 {
        let log_time = u64::from(1_000 + sequence - sequence * 13 % 31 % (sequence + 1));
        let channel_id = channels[usize::from(sequence % 2 == 0)];
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &noise(log_time, 20)).unwrap();
    }
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

/// Returns the positions of all bytes in the headers of chunks: times, lengths, checksum.
fn heads(bytes: &[u8]) -> Vec<usize> {
    places(bytes, op::CHUNK).into_iter().flat_map(|at| at..at + 45).collect()
}

fn damaged(mut bytes: Vec<u8>, changes: &[(bool, prop::sample::Index, u8)]) -> Vec<u8> {
    let heads = heads(&bytes);
    for (in_head, index, byte) in changes {
        let at = if *in_head { heads[index.index(heads.len())] } else { index.index(bytes.len()) };
        bytes[at] = *byte;
    }
    bytes
}

type Reader = LogReader<Cursor<Vec<u8>>>;

/// Reads the next `count` messages, or all that are left.
fn take(reader: &mut Reader, count: usize) -> Vec<(u64, Vec<u8>)> {
    let mut seen = Vec::new();
    while seen.len() < count
        && let Some(message) = reader.next().unwrap()
    {
        seen.push((message.log_time.0, message.data.to_vec()));
    }
    seen
}

/// Checks that reading resumes correctly from the position after `first` messages.
///
/// Reading resumes with a new reader, and with the same reader after it has read `further` more messages.
fn check(bytes: &[u8], first: usize, further: usize) -> Result<(), TestCaseError> {
    let mut straight = open(bytes);
    let all = take(&mut straight, usize::MAX);
    let mut reader = open(bytes);
    let first = take(&mut reader, first).len();
    let place = reader.place();
    take(&mut reader, further);
    for mut reader in [reader, open(bytes)] {
        reader.go_to(&place).unwrap();
        prop_assert_eq!(&take(&mut reader, usize::MAX), &all[first..]);
        prop_assert_eq!(reader.losses(), straight.losses());
        prop_assert_eq!(reader.late(), straight.late());
    }
    Ok(())
}

proptest! {
    #[test]
    fn resuming_earlier_in_a_damaged_log_gives_the_same_messages_and_losses(
        changes in proptest::collection::vec((any::<bool>(), any::<prop::sample::Index>(), any::<u8>()), 0..8),
        first in 0..200_usize,
        further in 0..200_usize,
    ) {
        for whole in [by_ticks(), by_times()] {
            let bytes = damaged(whole, &changes);
            if LogReader::new(Cursor::new(bytes.clone()), "damaged".to_owned()).is_ok() {
                check(&bytes, first, further)?;
            }
        }
    }
}

/// Two adjacent chunks fail their checksums, and the first chunk states a wrong time. The loss times of each chunk
/// depend on its neighbour.
#[test]
fn reading_from_any_message_gives_the_same_loss_times_of_damaged_chunks() {
    for (whole, changed) in [(by_ticks(), 2), (by_times(), 4)] {
        let chunks = places(&whole, op::CHUNK);
        let mut bytes = whole;
        for chunk in &chunks[changed..changed + 2] {
            // Damages the checksum in the chunk's header.
            bytes[chunk + 9 + 24] ^= 1;
        }
        bytes[chunks[changed] + 9] ^= 2;
        let (_, losses) = read(&bytes);
        assert_eq!(losses.len(), 2, "{losses:?}");
        for first in 0..40 {
            check(&bytes, first, 60).unwrap();
        }
    }
}
