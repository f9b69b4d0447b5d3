//! Recovered logs, which contain all readable messages in order and state the losses.

use mcap::records::op;

use super::super::{DiveLog, LogWriter, LossKind, RECOVERED_FROM, Recovered, recover};
use super::*;

fn recovered(bytes: &[u8]) -> (Vec<u8>, Recovered) {
    let mut output = Vec::new();
    let mut open = || LogReader::new(Cursor::new(bytes.to_vec()), "damaged".to_owned()).map(DiveLog::of);
    let done = recover(&mut open, &mut output, &header(true).results, "damaged.mcap").unwrap();
    (output, done)
}

/// Returns a log with five chunks of two seconds, and ten messages per second.
fn log(ticks: bool) -> Vec<u8> {
    let mut log = LogWriter::new(Vec::new(), &header(ticks)).unwrap();
    for number in 0..100_u64 {
        let at = MonoNs(1_000_000_000 + number * 100_000_000);
        match number % 4 {
            0 if ticks => log.tick(number, at, &[1, 2]).unwrap(),
            1 => log.sent(1, at, b"poll").unwrap(),
            2 => log.result(0, at, b"{}").unwrap(),
            _ => log.raw(2, at, MonoNs(at.0 - 5), &noise(number, 40)).unwrap(),
        }
        if number % 20 == 19 {
            log.flush().unwrap();
        }
    }
    log.finish().unwrap().0
}

/// Returns the messages without their sequence numbers, because a recovered log numbers its messages anew.
fn unnumbered(seen: Vec<Seen>) -> Vec<Seen> {
    seen.into_iter().map(|message| (message.0, message.1, message.2, 0, message.4)).collect()
}

#[test]
fn intact_log_is_recovered_completely() {
    for ticks in [true, false] {
        let bytes = log(ticks);
        let (output, done) = recovered(&bytes);
        assert_eq!((done.messages, &done.losses), (100, &vec![]));
        assert_eq!(done.span, Some((MonoNs(1_000_000_000), MonoNs(10_900_000_000))));
        let (mut before, mut after) = (open(&bytes), open(&output));
        assert_eq!(read_all(&mut after), read_all(&mut before));
        let mut info = after.header().clone();
        assert_eq!(info.metadata.remove(RECOVERED_FROM).as_deref(), Some("damaged.mcap"));
        assert_eq!(info, *before.header());
        assert_eq!((after.has_ticks(), after.losses().len()), (ticks, 0));
    }
}

#[test]
fn recovered_log_lists_the_losses_of_the_damaged_log() {
    let mut bytes = log(true);
    let chunks = places(&bytes, op::CHUNK);
    bytes.truncate(bytes.len() * 9 / 10);
    bytes[chunks[6] + 120] ^= 1;
    let (seen, losses) = read(&bytes);
    assert_eq!(losses.len(), 2, "{losses:?}");
    let (output, done) = recovered(&bytes);
    assert_eq!(done.losses, losses);
    let mut reader = open(&output);
    assert_eq!(unnumbered(read_all(&mut reader)), unnumbered(seen));
    let span = |loss: &Loss| (loss.from, loss.to);
    let stated: Vec<_> = reader.losses().iter().map(span).collect();
    assert_eq!(stated, losses.iter().map(span).collect::<Vec<_>>());
    let text: Vec<String> = reader.losses().iter().map(ToString::to_string).collect();
    assert!(
        text[0].contains("bytes from byte") && text.iter().any(|text| text.contains("checksum")),
        "{text:?}"
    );
    assert!(text.iter().all(|text| !text.starts_with("byte ")), "{text:?}");
    // Recovering the recovered log gives an equal log.
    let (again, done) = recovered(&output);
    assert_eq!(done.losses.iter().map(ToString::to_string).collect::<Vec<_>>(), text);
    assert_eq!(read(&again).0, read(&output).0);
}

#[test]
fn recovery_does_not_replace_a_lost_vehicle_file() {
    let mut bytes = log(true);
    let at = bytes.windows(6).position(|window| window == b"target").unwrap();
    bytes[at] = b'T';
    let (output, done) = recovered(&bytes);
    assert_eq!(done.losses[0].kind, LossKind::Attachment("vehicle.toml".to_owned()));
    let reader = open(&output);
    assert_eq!((reader.header().vehicle_toml.as_deref(), reader.header().attachments.len()), (None, 1));
    assert_eq!(reader.losses().len(), 1, "{:?}", reader.losses());
}

#[test]
fn log_cut_anywhere_recovers_all_readable_messages() {
    let bytes = log(true);
    let places = places(&bytes, op::CHUNK);
    for cut in (places[1]..bytes.len()).step_by(7) {
        let (seen, losses) = read(&bytes[..cut]);
        let (output, done) = recovered(&bytes[..cut]);
        assert_eq!(done.losses, losses, "cut at {cut}");
        let (after, stated) = read(&output);
        assert_eq!((unnumbered(after), stated.len()), (unnumbered(seen), losses.len()), "cut at {cut}");
    }
}
