use headrace_sensor::codec::{Codec as _, CodecCounts, TooLong};
use proptest::prelude::*;

use super::*;

fn hex(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn text(text: &[u8]) -> Text {
    Text(Bytes::new(text).unwrap())
}

fn ping() -> Distance {
    Distance {
        distance_mm: 4538,
        confidence_percent: 97,
        pulse_us: 60,
        ping_number: 123_456,
        scan: ScanRange { start_mm: 0, length_mm: 10_000 },
        gain: 3,
    }
}

/// Worked examples of the protocol description: bytes of the frame, sender, message.
fn examples() -> Vec<(Vec<u8>, u8, Message)> {
    let near = Distance {
        distance_mm: 1500,
        confidence_percent: 100,
        pulse_us: 40,
        ping_number: 7,
        scan: ScanRange { start_mm: 0, length_mm: 3000 },
        gain: 2,
    };
    let strengths = Bytes::new(&[255, 40, 10, 5, 9, 200, 30, 4]).unwrap();
    let information = DeviceInformation {
        device_type: 1,
        revision: 1,
        firmware_major: 3,
        firmware_minor: 29,
        firmware_patch: 0,
        reserved: 0,
    };
    let version = ProtocolVersion { major: 1, minor: 2, patch: 3, reserved: 0 };
    let simple = DistanceSimple { distance_mm: 10_000, confidence_percent: 95 };
    let nack = Message::Nack { nacked_id: 1004, text: text(b"out of range") };
    vec![
        ("42 52 02 00 06 00 00 00 05 00 A1 00", 0, Message::GeneralRequest(id::PROTOCOL_VERSION)),
        ("42 52 04 00 05 00 00 00 01 02 03 00 A3 00", 0, Message::ProtocolVersion(version)),
        ("42 52 02 00 06 00 00 00 BC 04 5C 01", 0, Message::GeneralRequest(id::DISTANCE)),
        ("42 52 02 00 EC 03 00 00 64 00 E9 01", 0, Message::SetPingInterval(100)),
        (
            "42 52 18 00 BC 04 01 00 BA 11 00 00 61 00 3C 00 40 E2 01 00 00 00 00 00 10 27 00 00 03 00 00 00 32 04",
            1,
            Message::Distance(ping()),
        ),
        ("42 52 05 00 BB 04 01 00 10 27 00 00 5F EF 01", 1, Message::DistanceSimple(simple)),
        (
            "42 52 22 00 14 05 01 00 DC 05 00 00 64 00 28 00 07 00 00 00 00 00 00 00 B8 0B 00 00 02 00 00 00 \
             08 00 FF 28 0A 05 09 C8 1E 04 3A 05",
            1,
            Message::Profile(Profile { distance: near, strengths }),
        ),
        ("42 52 0E 00 02 00 01 00 EC 03 6F 75 74 20 6F 66 20 72 61 6E 67 65 0E 06", 1, nack),
        ("42 52 02 00 01 00 01 00 EC 03 87 01", 1, Message::Ack(1004)),
        ("42 52 02 00 78 05 00 00 14 05 2C 01", 0, Message::ContinuousStart(id::PROFILE)),
        ("42 52 06 00 04 00 01 00 01 01 03 1D 00 00 C1 00", 1, Message::DeviceInformation(information)),
    ]
    .into_iter()
    .map(|(bytes, source, message)| (hex(bytes), source, message))
    .collect()
}

fn decode(bytes: &[u8]) -> (Vec<Addressed>, CodecCounts) {
    let (mut codec, mut got) = (PingCodec::default(), Vec::new());
    codec.push(bytes, &mut |value| got.push(value));
    (got, codec.counts())
}

fn encode(value: &Addressed) -> Vec<u8> {
    value.encode().unwrap().as_slice().to_vec()
}

fn frame(id: u16, payload: &[u8]) -> Vec<u8> {
    Frame { id, source: 1, destination: 0, payload }.encode().unwrap().as_slice().to_vec()
}

#[test]
fn worked_frames_encode_and_decode() {
    for (bytes, source, message) in examples() {
        let value = Addressed { source, destination: 0, message };
        assert_eq!(decode(&bytes).0, [value]);
        assert_eq!(encode(&value), bytes);
    }
}

#[test]
fn every_message_length_and_id_matches_the_table() {
    let lengths = [
        (id::ACK, 2),
        (id::DEVICE_INFORMATION, 6),
        (id::PROTOCOL_VERSION, 4),
        (id::SET_RANGE, 8),
        (id::RANGE, 8),
        (id::SET_SPEED_OF_SOUND, 4),
        (id::SET_GAIN, 1),
        (id::GAIN, 4),
        (id::GENERAL_INFO, 10),
        (id::DISTANCE_SIMPLE, 5),
        (id::DISTANCE, 24),
    ];
    for (id, len) in lengths {
        assert_eq!(decode(&frame(id, &vec![0; len])).1.good_frames, 1, "{id}");
        for wrong in [len - 1, len + 1] {
            assert_eq!(decode(&frame(id, &vec![0; wrong])).1.good_frames, 0, "{id} with {wrong}");
        }
    }
}

#[test]
fn profile_with_a_false_count_is_refused() {
    let (_, _, Message::Profile(profile)) = examples().swap_remove(6) else { panic!() };
    let message = Message::Profile(profile);
    let message_bytes = Addressed { source: 1, destination: 0, message }.encode().unwrap();
    let mut payload = Frame::parse(message_bytes.as_slice()).unwrap().payload.to_vec();
    payload[24] = 200;
    let bytes = frame(id::PROFILE, &payload);
    let parsed = Frame::parse(&bytes).unwrap();
    assert_eq!(Message::decode(&parsed), Err(MessageError::Count { announced: 200, present: 8 }));
    assert_eq!(decode(&bytes).1.good_frames, 0);
}

#[test]
fn nack_keeps_its_readable_text() {
    let of = |bytes: &[u8]| {
        let (got, _) = decode(&frame(id::NACK, &[&[0xEC, 0x03], bytes].concat()));
        let [Addressed { message: Message::Nack { nacked_id: 1004, text }, .. }] = got[..] else { panic!() };
        text.as_str().to_owned()
    };
    assert_eq!(of(b"out of range"), "out of range");
    assert_eq!(of(b"out of range\0\0junk"), "out of range");
    assert_eq!(of(b"out \xFF\xFE"), "out ");
    assert_eq!(of(b"\xFF"), "");
    assert_eq!(of(b""), "");
    assert_eq!(decode(&frame(id::NACK, &[1])).0, []);
}

#[test]
fn unknown_message_cannot_be_sent_under_a_known_id() {
    let other = |id| Addressed {
        source: 1,
        destination: 0,
        message: Message::Other { id, payload: Bytes::new(&[1, 2, 3]).unwrap() },
    };
    assert_eq!(decode(&frame(1301, &[1, 2, 3])).0, [other(1301)]);
    assert_eq!(decode(&frame(id::GOTO_BOOTLOADER, &[1, 2, 3])).0, [other(id::GOTO_BOOTLOADER)]);
    for id in [id::GOTO_BOOTLOADER, id::DISTANCE, id::NACK, id::PROFILE] {
        assert_eq!(other(id).encode(), Err(MessageError::NotSendable { id }));
    }
}

#[test]
fn stray_start_byte_before_a_frame_loses_no_frame() {
    for (bytes, _, message) in examples() {
        let (got, counts) = decode(&[b"B", &bytes[..]].concat());
        assert_eq!(got.iter().map(|value| value.message).collect::<Vec<_>>(), [message]);
        assert_eq!(counts.skipped_bytes, 1);
    }
}

#[test]
fn frame_with_a_false_length_hides_no_other_frame() {
    let good = examples().swap_remove(4).0;
    let mut profile = examples().swap_remove(6).0;
    profile[2] = 0xFF;
    let (got, counts) = decode(&[&profile[..], &good].concat());
    assert_eq!((got.len(), counts.bad_frames), (1, 1));
    for lie in [[0xFF, 0xFF], [0xF7, 0x0F], [0x00, 0x01]] {
        let mut bad = good.clone();
        [bad[2], bad[3]] = lie;
        let (got, counts) = decode(&[&bad[..], &good, &good, &good].concat());
        assert_eq!(got.len(), 3);
        assert_eq!((counts.bad_frames, counts.skipped_bytes), (1, good.len() as u64));
    }
}

#[test]
fn longest_frame_is_accepted_but_a_longer_one_refused() {
    let longest = frame(2300, &[7; MAX_PAYLOAD_BYTES]);
    assert_eq!(longest.len(), MAX_FRAME_BYTES);
    assert_eq!(decode(&longest).1.good_frames, 1);
    let too_long = TooLong { len: MAX_FRAME_BYTES + 1, max: MAX_FRAME_BYTES };
    let longer = Frame { id: 2300, source: 1, destination: 0, payload: &[7; MAX_PAYLOAD_BYTES + 1] };
    assert_eq!(longer.encode(), Err(too_long));
}

#[test]
fn ping360_frames_have_correct_framing_and_checksum() {
    let real = [
        "ping360_tank_rgu/Uniform_Pipe__50__1N__2024-03-12_11-31-02Gain_1.bin",
        "ping360_tank_rgu/Uniform_Pipe__90__1N__2024-03-12_11-38-25Gain_1.bin",
    ];
    let made_up = (headrace_support::recordings::trimmed("ping360_made_up/frames.bin"), 20);
    let real = real.into_iter().filter_map(headrace_support::recordings::full_length).map(|path| (path, 101));
    for (path, good_frames) in [made_up].into_iter().chain(real) {
        let file = std::fs::read(path).unwrap();
        for piece in [file.len(), 1000, 1] {
            let (mut codec, mut again) = (PingCodec::default(), Vec::new());
            for bytes in file.chunks(piece) {
                codec.push(bytes, &mut |value| {
                    let Message::Other { id: 2300, payload } = value.message else { panic!("{value:?}") };
                    assert_eq!((value.source, value.destination, payload.as_slice().len()), (2, 0, 1214));
                    again.extend_from_slice(&encode(&value));
                });
            }
            let counts = CodecCounts { good_frames, ..CodecCounts::default() };
            assert_eq!((codec.counts(), codec.held_bytes()), (counts, 0));
            assert_eq!(again, file);
        }
    }
}

fn distances() -> impl Strategy<Value = Distance> {
    (any::<[u32; 5]>(), any::<[u16; 2]>()).prop_map(|(words, halves)| {
        let [distance_mm, ping_number, start_mm, length_mm, gain] = words;
        let [confidence_percent, pulse_us] = halves;
        let scan = ScanRange { start_mm, length_mm };
        Distance { distance_mm, confidence_percent, pulse_us, ping_number, scan, gain }
    })
}

fn bytes<const N: usize>(most: usize) -> impl Strategy<Value = Bytes<N>> {
    proptest::collection::vec(any::<u8>(), 0..=most).prop_map(|bytes| Bytes::new(&bytes).unwrap())
}

fn messages() -> impl Strategy<Value = Message> {
    let plain = (any::<u8>(), any::<u16>(), any::<u32>(), any::<bool>(), 0..16usize);
    let plain = plain.prop_map(|(a, b, c, d, which)| match which {
        0 => Message::Ack(b),
        1 => Message::GeneralRequest(b),
        2 => Message::SetAnyDeviceId(a),
        3 => Message::SetDeviceId(a),
        4 => Message::SetRange(ScanRange { start_mm: c, length_mm: !c }),
        5 => Message::SetSpeedOfSound(c),
        6 => Message::SetModeAuto(d),
        7 => Message::SetGain(a),
        8 => Message::SetPingEnable(d),
        9 => Message::Voltage5(b),
        10 => Message::Gain(c),
        11 => Message::TransmitDuration(b),
        12 => Message::PcbTemperature(b),
        13 => Message::PingEnabled(d),
        14 => Message::ContinuousStop(b),
        _ => Message::DistanceSimple(DistanceSimple { distance_mm: c, confidence_percent: a }),
    });
    prop_oneof![
        plain,
        distances().prop_map(Message::Distance),
        (distances(), bytes(200))
            .prop_map(|(distance, strengths)| Message::Profile(Profile { distance, strengths })),
        (any::<u16>(), bytes(60)).prop_map(|(nacked_id, text)| Message::Nack { nacked_id, text: Text(text) }),
        bytes(60).prop_map(|text| Message::AsciiText(Text(text))),
        (2000u16..3000, bytes(300)).prop_map(|(id, payload)| Message::Other { id, payload }),
    ]
}

fn values() -> impl Strategy<Value = Addressed> {
    (any::<u8>(), any::<u8>(), messages()).prop_map(|(source, destination, message)| Addressed {
        source,
        destination,
        message,
    })
}

headrace_sensor::codec_contract!(
    contract,
    codec: PingCodec::default(),
    values: values(),
    encode: encode,
    frames: examples().into_iter().map(|(bytes, _, _)| bytes),
);
