//! Damaged logs: reading never panics, delivers all intact messages, and reports the losses.

use std::collections::BTreeSet;

use mcap::records::op;
use proptest::prelude::*;

use super::super::{LogError, LogInfo, LogWriter, LossKind};
use super::*;

/// Number of messages in each chunk of the log under test, and number of chunks.
const PER_CHUNK: usize = 6;
const CHUNKS: usize = 6;

/// Returns a log, its messages, and the positions of its chunks.
///
/// Chunk `n` (from 0) has the log times `100 n + 1` to `100 n + 6`.
fn log() -> (Vec<u8>, Vec<Seen>, Vec<usize>) {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for chunk in 0..CHUNKS as u64 {
        for message in 1..=PER_CHUNK as u64 {
            let at = MonoNs(100 * chunk + message);
            match u16::try_from(message % 3).unwrap() {
                0 => log.tick(chunk, at, &[0, 1, 0]).unwrap(),
                source => log.raw(source, at, at, &noise(at.0, 40)).unwrap(),
            }
        }
        log.flush().unwrap();
    }
    let bytes = log.finish().unwrap().0;
    let seen = read(&bytes).0;
    assert_eq!(seen.len(), CHUNKS * PER_CHUNK);
    let places = places(&bytes, op::CHUNK);
    assert_eq!(places.len(), CHUNKS + 1, "the first has the channels");
    (bytes, seen, places[1..].to_vec())
}

/// Returns the messages of all chunks except the given one.
fn without_chunk(seen: &[Seen], chunk: usize) -> Vec<Seen> {
    [&seen[..chunk * PER_CHUNK], &seen[(chunk + 1) * PER_CHUNK..]].concat()
}

fn is_subsequence(part: &[Seen], whole: &[Seen]) -> bool {
    let mut rest = whole.iter();
    // The kind isn't compared, because a message's channel is unknown if all copies of its definition are damaged.
    part.iter().all(|message| {
        rest.any(|other| {
            (other.1, other.2, other.3, &other.4) == (message.1, message.2, message.3, &message.4)
        })
    })
}

#[test]
fn log_that_follows_another_one_in_a_file_is_reported_and_not_read() {
    let (bytes, seen, places) = log();
    for cut in places[0]..=bytes.len() {
        let (alone, _) = read(&bytes[..cut]);
        let (got, losses) = read(&[&bytes[..cut], &bytes].concat());
        assert_eq!(got, alone, "cut at {cut}");
        assert_eq!(got, seen[..got.len()], "cut at {cut}");
        let is_reported = losses.iter().any(|loss| loss.kind == LossKind::AnotherLog);
        assert!(is_reported, "cut at {cut}: {losses:?}");
    }
}

#[test]
fn log_cut_anywhere_delivers_messages_before_the_cut() {
    let (bytes, seen, places) = log();
    for cut in places[CHUNKS - 2]..bytes.len() {
        let (got, losses) = read(&bytes[..cut]);
        let whole_chunks = places.iter().filter(|place| **place < cut).count().saturating_sub(1);
        assert!(got.len() >= whole_chunks * PER_CHUNK, "cut at {cut}: {} messages", got.len());
        assert_eq!(got, seen[..got.len()], "cut at {cut}");
        assert_eq!(losses.len(), 1, "cut at {cut}: {losses:?}");
        assert_eq!(losses[0].kind, LossKind::Truncated, "cut at {cut}");
        assert_eq!(losses[0].to, None);
        missing_are_covered(&got, &seen, &losses);
    }
}

/// A medium that can't read some of its bytes.
struct Worn<'a> {
    bytes: std::io::Cursor<&'a [u8]>,
    bad: core::ops::Range<usize>,
}

impl std::io::Read for Worn<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let at = usize::try_from(self.bytes.position()).unwrap();
        // A read that reaches unreadable bytes returns only the bytes before them.
        let len = if at < self.bad.start { into.len().min(self.bad.start - at) } else { into.len() };
        if self.bad.contains(&at) {
            return Err(std::io::Error::from_raw_os_error(5));
        }
        self.bytes.read(&mut into[..len])
    }
}

impl std::io::Seek for Worn<'_> {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.bytes.seek(to)
    }
}

/// Returns a log like that of a long dive, with long packets, results, and chunks of some kilobytes.
fn long_log() -> (Vec<u8>, Vec<Seen>) {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for tick in 0..400_u64 {
        let at = MonoNs(20_000_000 * (tick + 1));
        log.raw(0, at, at, &noise(tick, 265)).unwrap();
        log.raw(2, at, at, &noise(tick, 16)).unwrap();
        log.tick(tick, at, &[0, 2]).unwrap();
        log.result(0, at, &noise(!tick, 56)).unwrap();
    }
    let bytes = log.finish().unwrap().0;
    let seen = read(&bytes).0;
    assert_eq!(seen.len(), 1600);
    (bytes, seen)
}

#[test]
fn unreadable_bytes_are_reported_as_a_loss_and_the_rest_is_read() {
    let (bytes, seen) = long_log();
    let chunks = places(&bytes, op::CHUNK);
    let mut reported = 0;
    for bad in (0..bytes.len()).step_by(197) {
        let sector = bad / 512 * 512..(bad / 512 + 1) * 512;
        let medium = Worn { bytes: std::io::Cursor::new(&bytes), bad: bad..bad + 1 };
        let mut reader = match LogReader::new(medium, "worn".to_owned()) {
            Ok(reader) => reader,
            // If the first bytes can't be read, the file can't be identified as a log.
            Err(error) => {
                assert!(bad < 512 && error.to_string().contains("os error 5"), "{bad}: {error}");
                continue;
            }
        };
        let before = reader.place();
        for again in 0..2 {
            let got = read_all(&mut reader);
            let losses = reader.losses().to_vec();
            assert!(is_subsequence(&got, &seen), "byte {bad}");
            missing_are_covered(&got, &seen, &losses);
            let is_reported = losses
                .iter()
                .any(|loss| matches!(&loss.kind, LossKind::Unreadable(why) if why.contains("os error 5")));
            reported += usize::from(is_reported);
            // All messages of chunks outside the unreadable sector are read.
            let hit = chunks
                .iter()
                .filter(|place| **place < sector.end && sector.start < record_after(&bytes, **place))
                .count();
            let most = 1600 / (chunks.len() - 1) + 10;
            assert!(
                seen.len() - got.len() <= hit * most,
                "byte {bad}: {} of {} left, {hit} chunks hit",
                got.len(),
                seen.len()
            );
            assert!(is_reported || hit == 0, "byte {bad}: {losses:?}");
            if again == 0 {
                reader.go_to(&before).unwrap();
            }
        }
    }
    assert!(reported > 100, "{reported}");
}

#[test]
fn long_chunk_cut_anywhere_delivers_messages_before_the_cut() {
    let (bytes, seen) = long_log();
    let last = *places(&bytes, op::CHUNK).last().unwrap();
    let before = read(&bytes[..last]).0.len();
    let end = record_after(&bytes, last);
    assert!(end - last > 3000, "{}", end - last);
    for cut in last..end {
        let (got, losses) = read(&bytes[..cut]);
        assert!(got.len() >= before && got == seen[..got.len()], "cut at {cut}");
        assert_eq!((losses.len(), &losses[0].kind), (1, &LossKind::Truncated), "cut at {cut}");
        missing_are_covered(&got, &seen, &losses);
    }
}

#[test]
fn chunk_with_zeroed_header_is_reported_as_a_loss() {
    let (bytes, seen) = long_log();
    for chunk in &places(&bytes, op::CHUNK)[1..] {
        let mut bytes = bytes.clone();
        bytes[chunk + 9..chunk + 9 + 512].fill(0);
        let (got, losses) = read(&bytes);
        assert!(got.len() < seen.len() && losses.len() == 1, "{losses:?}");
        missing_are_covered(&got, &seen, &losses);
    }
}

#[test]
fn every_message_lost_to_random_changes_is_reported() {
    let (bytes, seen) = long_log();
    let info = open(&bytes).header().clone();
    let words = noise(11, 12_000);
    let word = |bytes: &[u8]| bytes.iter().fold(0, |sum, byte| (sum << 8) | u64::from(*byte));
    let places: Vec<u64> = words.chunks(6).map(word).collect();
    for (number, place) in places.iter().enumerate() {
        let mut changed = bytes.clone();
        // Changes one bit, a byte, or a block such as a medium may lose. Every fourth log is also truncated.
        let at = usize::try_from(place % bytes.len() as u64).unwrap();
        match number % 3 {
            0 => changed[at] ^= 1 << ((place >> 40) & 7),
            1 => changed[at] = u8::try_from(place >> 40).unwrap(),
            _ => changed[at..(at + 512).min(bytes.len())].fill(0),
        }
        if number % 4 == 0 {
            changed.truncate(bytes.len() - usize::try_from(place >> 16).unwrap() % (bytes.len() / 2));
        }
        check_changed(changed, &seen, &info);
    }
}

#[test]
fn log_cut_before_its_first_message_reports_losses_or_is_refused() {
    let (bytes, _, places) = log();
    for cut in 0..places[0] {
        match LogReader::new(Cursor::new(bytes[..cut].to_vec()), "cut".to_owned()) {
            Ok(mut reader) => {
                assert_eq!(read_all(&mut reader), []);
                assert!(!reader.losses().is_empty(), "cut at {cut}");
            }
            Err(LogError::NotMcap { .. }) => assert!(cut < 8),
            Err(error) => panic!("cut at {cut}: {error}"),
        }
    }
}

#[test]
fn chunk_with_wrong_checksum_loses_only_itself() {
    let (mut bytes, seen, places) = log();
    bytes[places[3] + 9 + 44 + 30] ^= 4;
    let (got, losses) = read(&bytes);
    assert_eq!(got, without_chunk(&seen, 3));
    assert_eq!(losses.len(), 1, "{losses:?}");
    assert_eq!(losses[0].offset, places[3] as u64);
    assert_eq!((losses[0].from, losses[0].to), (Some(MonoNs(206)), Some(MonoNs(401))));
    let text = losses[0].to_string();
    assert!(text.contains("after 0.000 s, before 0.000 s"), "{text}");
}

#[test]
fn wrong_record_length_loses_at_most_its_chunk() {
    let (bytes, seen, places) = log();
    for lie in [0, 1, 40, 60, 1000, 1 << 20, 1 << 40, u64::MAX - 8, u64::MAX] {
        let mut bytes = bytes.clone();
        bytes[places[2] + 1..places[2] + 9].copy_from_slice(&lie.to_le_bytes());
        let (got, _) = read(&bytes);
        // The chunk's fields imply its length a second time, and another record follows at that length, so nothing is
        // lost.
        assert!(got == seen, "length {lie}: {} messages", got.len());
        bytes[places[2] + 9 + 36..places[2] + 9 + 44].copy_from_slice(&(lie ^ 3).to_le_bytes());
        let (got, losses) = read(&bytes);
        assert_eq!(got, without_chunk(&seen, 2), "both lengths about {lie}");
        assert_eq!((losses.len(), &losses[0].kind), (1, &LossKind::Framing), "{losses:?}");
        assert_eq!((losses[0].from, losses[0].to), (Some(MonoNs(106)), Some(MonoNs(301))));
    }
}

#[test]
fn overwritten_block_loses_only_overlapping_chunks() {
    let (bytes, seen, places) = log();
    for value in [0, 0xFF, 0x05] {
        let mut bytes = bytes.clone();
        // Overwrites from the middle of chunk 1 into chunk 3, as if a medium had lost a block.
        bytes[places[1] + 100..places[3] + 20].fill(value);
        let (got, losses) = read(&bytes);
        let kept = [&seen[..PER_CHUNK], &seen[4 * PER_CHUNK..]].concat();
        assert_eq!(got, kept, "{value}");
        assert!(losses.iter().any(|loss| loss.kind == LossKind::Framing), "{losses:?}");
        assert!(losses.iter().all(|loss| loss.to == Some(MonoNs(401)) || loss.from == Some(MonoNs(6))));
    }
}

#[test]
fn bytes_between_records_are_skipped() {
    let (mut bytes, seen, places) = log();
    bytes.splice(places[4]..places[4], noise(7, 5000));
    let (got, losses) = read(&bytes);
    assert_eq!(got, seen);
    assert_eq!((losses.len(), &losses[0].kind, losses[0].bytes), (1, &LossKind::Framing, 5000));
}

#[test]
fn intact_messages_are_read_despite_thousands_of_losses() {
    let mut log = LogWriter::new(Vec::new(), &header(true)).unwrap();
    for at in 0..3000 {
        log.raw(0, MonoNs(at), MonoNs(at), &noise(at, 30)).unwrap();
        log.flush().unwrap();
    }
    let mut bytes = log.finish().unwrap().0;
    for place in places(&bytes, op::CHUNK).into_iter().skip(1).step_by(2) {
        bytes[place..place + 30].fill(0);
    }
    let (got, losses) = read(&bytes);
    let odd: Vec<u64> = (0..3000).filter(|at| at % 2 == 1).collect();
    let times: Vec<u64> = got.iter().map(|message| message.1).collect();
    assert!(times == odd, "{} of {} messages", times.len(), odd.len());
    assert_eq!(losses.len(), 1000);
    let last = losses.last().unwrap();
    assert_eq!((last.from, last.to), (Some(MonoNs(1997)), Some(MonoNs(2999))), "{last}");
}

#[test]
fn channels_stay_known_if_their_chunk_and_the_summary_are_lost() {
    let (bytes, seen, places) = log();
    let mut bytes = bytes[..places[CHUNKS - 1]].to_vec();
    let definitions = super::places(&bytes, op::CHUNK)[0];
    bytes[definitions + 60..definitions + 90].fill(0);
    let mut reader = open(&bytes);
    assert_eq!(read_all(&mut reader), seen[..(CHUNKS - 1) * PER_CHUNK]);
    assert_eq!(reader.header().sources, header(true).sources);
    assert_eq!(reader.losses().len(), 2, "the chunk and the end: {:?}", reader.losses());
}

#[test]
fn log_with_damaged_first_bytes_is_read() {
    let (mut bytes, seen, _) = log();
    bytes[..8].fill(0);
    let (got, losses) = read(&bytes);
    assert_eq!((got, losses.len()), (seen, 1));
}

#[test]
fn damaged_attachment_is_reported_by_name() {
    let (mut bytes, seen, _) = log();
    let at = bytes.windows(6).position(|window| window == b"target").unwrap();
    bytes[at] = b'T';
    let mut reader = open(&bytes);
    assert_eq!(reader.header().vehicle_toml, None);
    assert_eq!(reader.losses()[0].kind, LossKind::Attachment("vehicle.toml".to_owned()));
    assert_eq!(read_all(&mut reader), seen);
}

#[test]
fn error_for_a_file_other_than_mcap_shows_its_first_bytes() {
    let error = |bytes: &[u8]| {
        LogReader::new(Cursor::new(bytes.to_vec()), "dive.mcap".to_owned()).err().unwrap().to_string()
    };
    assert_eq!(
        error(b"\x89PNG\r\n\x1a\n1234567890"),
        "dive.mcap is not an MCAP file: it begins with [89 50 4e 47 0d 0a 1a 0a]; expected \
         [89 4d 43 41 50 30 0d 0a]"
    );
    assert!(error(b"").contains("begins with []"));
    assert!(error(b"#ROSBAG V2.0\n").contains("23 52 4f 53"));
}

/// Asserts that the time of each missing message is within the times of a reported loss.
fn missing_are_covered(got: &[Seen], seen: &[Seen], losses: &[Loss]) {
    fn key(message: &Seen) -> (u64, u64, u32, &[u8]) {
        (message.1, message.2, message.3, &message.4)
    }
    let there: BTreeSet<_> = got.iter().map(key).collect();
    for missing in seen.iter().filter(|message| !there.contains(&key(message))) {
        let covers = |loss: &Loss| {
            let from = loss.from.is_none_or(|from| from.0 <= missing.1);
            from && loss.to.is_none_or(|to| missing.1 <= to.0)
        };
        assert!(
            losses.iter().any(covers),
            "{} at {} is missing and not reported: {losses:?}",
            missing.0,
            missing.1
        );
    }
}

/// Asserts that a change either has no effect or is reported, and that no message is read that the log doesn't have.
fn check_changed(bytes: Vec<u8>, seen: &[Seen], info: &LogInfo) {
    match LogReader::new(Cursor::new(bytes), "changed".to_owned()) {
        Ok(mut reader) => {
            let got = read_all(&mut reader);
            assert!(is_subsequence(&got, seen), "{} messages, {:?}", got.len(), reader.losses());
            missing_are_covered(&got, seen, reader.losses());
            if reader.losses().is_empty() {
                assert!(got == seen, "{} messages", got.len());
                assert_eq!(reader.header(), info);
            }
        }
        Err(error) => assert!(matches!(error, LogError::NotMcap { .. }), "{error}"),
    }
}

#[test]
fn changed_bit_at_any_position_is_reported_or_harmless() {
    let (bytes, seen, places) = log();
    let info = open(&bytes).header().clone();
    for place in 0..bytes.len() {
        let bits = if places.contains(&place) { 0..8 } else { place % 8..place % 8 + 1 };
        for bit in bits {
            let mut changed = bytes.clone();
            changed[place] ^= 1 << bit;
            check_changed(changed, &seen, &info);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn changed_bytes_are_reported_or_harmless(
        changes in prop::collection::vec((any::<prop::sample::Index>(), 1_u8..), 2..6),
    ) {
        let (mut bytes, seen, _) = log();
        let info = open(&bytes).header().clone();
        for (place, change) in changes {
            let place = place.index(bytes.len());
            bytes[place] ^= change;
        }
        check_changed(bytes, &seen, &info);
    }

    #[test]
    fn arbitrary_bytes_are_read_as_a_log_without_a_panic(
        start in prop::sample::select(vec![&b""[..], &b"\x01\x08\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0"[..]]),
        bytes: Vec<u8>,
        records in prop::collection::vec((0_u8..17, 0_u64..80, prop::collection::vec(any::<u8>(), 0..80)), 0..20),
    ) {
        let mut file = [mcap::MAGIC, start, &bytes].concat();
        for (opcode, len, body) in records {
            file.push(opcode);
            file.extend(len.to_le_bytes());
            file.extend(body);
        }
        read(&file);
    }
}
