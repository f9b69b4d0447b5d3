use headrace_sensor::codec::Bytes;
use headrace_sensor::geometry::time::MonoNs;

use super::*;
use crate::codec::{Profile, ScanRange};
use crate::settings::tests::{sensor, settings};

const PING: Distance = Distance {
    distance_mm: 4538,
    confidence_percent: 97,
    pulse_us: 60,
    ping_number: 1,
    scan: ScanRange { start_mm: 0, length_mm: 10_000 },
    gain: 3,
};

fn decoder() -> PingDecoder {
    PingDecoder::new(settings("sound_speed_mps = 1480").unwrap(), DurNs::from_millis(2))
}

fn frame(message: &Message) -> Vec<u8> {
    let value = Addressed { source: 1, destination: 0, message: *message };
    value.encode().unwrap().as_slice().to_vec()
}

fn decode(decoder: &mut PingDecoder, received_ms: i64, bytes: &[u8]) -> Vec<(i64, EchoRange)> {
    let mut got = Vec::new();
    let packet = Packet { received: MonoNs(0) + DurNs::from_millis(received_ms), bytes };
    decoder.decode(packet, &mut |decoded| match decoded.reading {
        Reading::Echo(echo) => got.push((decoded.valid_at.since(MonoNs(0)).0 / 1_000_000, echo)),
        other => panic!("{other:?}"),
    });
    got
}

fn one(message: &Message) -> EchoRange {
    let [(98, echo)] = decode(&mut decoder(), 100, &frame(message))[..] else { panic!() };
    echo
}

#[test]
fn every_message_with_a_distance_becomes_a_reading() {
    let expected = EchoRange { range_m: Some(4.538), confidence: 0.97, sound_speed_mps: 1480.0 };
    let strengths = Bytes::new(&[1, 2, 3]).unwrap();
    assert_eq!(one(&Message::Distance(PING)), expected);
    assert_eq!(one(&Message::Profile(Profile { distance: PING, strengths })), expected);
    let simple = DistanceSimple { distance_mm: 4538, confidence_percent: 97 };
    assert_eq!(one(&Message::DistanceSimple(simple)), expected);
}

#[test]
fn zero_confidence_or_distance_gives_no_range() {
    assert_eq!(one(&Message::Distance(Distance { confidence_percent: 0, ..PING })).range_m, None);
    assert_eq!(one(&Message::Distance(Distance { distance_mm: 0, ..PING })).range_m, None);
}

#[test]
fn other_messages_other_devices_and_undefined_values_give_no_reading() {
    let mut decoder = decoder();
    let nonsense = Distance { confidence_percent: 101, ..PING };
    for message in [Message::Ack(1004), Message::PingInterval(66), Message::Distance(nonsense)] {
        assert_eq!(decode(&mut decoder, 100, &frame(&message)), []);
    }
    let elsewhere = Addressed { source: 2, destination: 0, message: Message::Distance(PING) };
    assert_eq!(decode(&mut decoder, 100, elsewhere.encode().unwrap().as_slice()), []);
    assert_eq!((decoder.counts().good_frames, decoder.withheld()), (4, 2));
}

#[test]
fn datagram_may_hold_part_of_a_frame_or_several_frames() {
    let mut decoder = decoder();
    let two = [frame(&Message::Distance(PING)), frame(&Message::Distance(PING))].concat();
    assert_eq!(decode(&mut decoder, 100, &two[..20]), []);
    let times: Vec<i64> = decode(&mut decoder, 103, &two[20..]).iter().map(|(ms, _)| *ms).collect();
    assert_eq!(times, [98, 101]);
}

#[test]
fn truncated_frame_does_not_delay_frames_after_a_silence() {
    let mut decoder = decoder();
    let longer = Message::Profile(Profile { distance: PING, strengths: Bytes::new(&[9; 200]).unwrap() });
    assert_eq!(decode(&mut decoder, 100, &frame(&longer)[..30]), []);
    let [(ms, _)] = decode(&mut decoder, 166, &frame(&Message::Distance(PING)))[..] else { panic!() };
    assert_eq!(ms, 164);
    let counts = CodecCounts { good_frames: 1, bad_frames: 1, skipped_bytes: 30 };
    assert_eq!(decoder.counts(), counts);
}

#[test]
fn echosounder_specification_follows_its_settings() {
    let ping = Ping1d { sensor: sensor(), settings: settings("").unwrap() };
    assert!(matches!(ping.specification().kind, SensorKind::Echosounder { .. }));
    assert!(ping.head().is_none());
}

#[test]
fn removing_echo_strengths_from_a_profile_does_not_change_its_reading() {
    let strengths = Bytes::new(&[1; 150]).unwrap();
    let profile = frame(&Message::Profile(Profile { distance: PING, strengths }));
    let mut shorter = Vec::new();
    assert_eq!(without_strengths(&profile, &mut shorter), Some(()));
    assert_eq!(shorter, frame(&Message::Distance(PING)));
    assert_eq!(decode(&mut decoder(), 100, &shorter), decode(&mut decoder(), 100, &profile));
    for kept in [&shorter[..], &profile[..100], &[&profile[..], b"B"].concat()] {
        assert_eq!(without_strengths(kept, &mut Vec::new()), None);
    }
}
