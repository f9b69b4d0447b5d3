use headrace_sensor::codec::Codec as _;
use proptest::prelude::*;

use super::*;

const EXAMPLE_4: [u8; 13] = [0x49, 0x50, 0x58, 0x10, 0x40, 0x6E, 0x45, 0x0A, 0x19, 0x04, 0, 0, 0xFC];
const EXAMPLE_5: [u8; 13] = [0x49, 0x50, 0x58, 0x10, 0x40, 0x2C, 0x02, 0x03, 0x52, 0x09, 0, 0, 0xFC];
const EXAMPLE_6: [u8; 13] = [0x49, 0x50, 0x58, 0x10, 0x40, 0x2F, 0x49, 0x14, 0, 0, 0, 0, 0xFC];

fn header(bytes: &[u8]) -> (Header, usize) {
    Header::decode(bytes, None).unwrap()
}

#[test]
fn worked_example_3_decodes_a_real_881a_header() {
    let (header, echo_len) =
        header(&[0x49, 0x4D, 0x58, 0x10, 0x41, 0x01, 0x01, 0x05, 0x00, 0x00, 0x7C, 0x01]);
    assert_eq!((header.tag, header.position, header.clockwise), (Tag::Imx, 129, false));
    assert_eq!((header.range_m, header.profile_mm(Model::Head881), echo_len), (5, None, 252));
    assert!(header.status.accepted() && !header.status.overrun());
}

#[test]
fn worked_examples_4_to_6_encode_and_decode() {
    let expected = [
        (EXAMPLE_4, 750, true, 10, Some(5370)),
        (EXAMPLE_5, 300, false, 3, Some(2468)),
        (EXAMPLE_6, 1199, true, 20, None),
    ];
    for (bytes, position, clockwise, range_m, profile_mm) in expected {
        let value = Return::decode(&bytes, None).unwrap();
        let header = value.header;
        assert_eq!((header.tag, header.head_id, header.status), (Tag::Ipx, 0x10, Status(0x40)));
        assert_eq!((header.position, header.clockwise, header.range_m), (position, clockwise, range_m));
        assert_eq!(header.profile_mm(Model::Head881), profile_mm);
        assert_eq!(value.encode().unwrap().as_slice(), bytes);
    }
}

#[test]
fn worked_example_7_decodes_a_real_852_header() {
    let (header, echo_len) =
        header(&[0x49, 0x47, 0x58, 0x11, 0x45, 0x78, 0x0A, 0x32, 0x40, 0x03, 0x74, 0x03]);
    assert_eq!((header.tag, header.status, header.range_m), (Tag::Igx, Status(0x45), 50));
    assert_eq!((header.position, echo_len), (1400, 500));
    assert_eq!(header.profile_mm(Model::Sounder852), Some(4480));
}

#[test]
fn sounder_resolution_is_1_cm_at_every_range() {
    let header = Header { range_m: 3, ..Return::decode(&EXAMPLE_5, None).unwrap().header };
    assert_eq!((header.count_mm(Model::Head881), header.count_mm(Model::Sounder852)), (2, 10));
    let at_5_m = Header { range_m: 5, ..header };
    assert_eq!(at_5_m.count_mm(Model::Head881), 10);
}

#[test]
fn position_beyond_one_turn_is_refused_for_heads_but_not_for_echosounders() {
    let mut bytes = EXAMPLE_4;
    [bytes[5], bytes[6]] = pack(1201);
    let refused = ReturnError::TooGreat { field: "head position", got: 1201, max: 1200 };
    assert_eq!(Return::decode(&bytes, None), Err(refused));
    bytes[3] = 0x11;
    assert!(Return::decode(&bytes, None).is_ok());
    assert_eq!(Return::decode(&bytes, Some(Model::Head881)), Err(refused));
    [bytes[5], bytes[6]] = pack(1200);
    assert!(Return::decode(&bytes, Some(Model::Head881)).is_ok());
}

#[test]
fn returns_with_a_false_length_are_refused() {
    let mut bytes = [0; MAX_RETURN_BYTES];
    bytes[..13].copy_from_slice(&EXAMPLE_4);
    [bytes[10], bytes[11]] = pack(1);
    assert!(matches!(Return::decode(&bytes, None), Err(ReturnError::TooGreat { max: 0, .. })));
    bytes[1] = b'M';
    [bytes[10], bytes[11]] = pack(501);
    assert!(matches!(Return::decode(&bytes, None), Err(ReturnError::TooGreat { max: 500, .. })));
    [bytes[10], bytes[11]] = pack(500);
    assert_eq!(Return::decode(&bytes, None), Err(ReturnError::Terminator { got: 0 }));
    bytes[11] |= 0x80;
    assert!(matches!(Return::decode(&bytes, None), Err(ReturnError::HighBit { .. })));
}

#[test]
fn value_too_large_for_its_bits_is_not_encoded() {
    let value = Return::decode(&EXAMPLE_4, None).unwrap();
    let too_far = Return { header: Header { profile_counts: 0x4000, ..value.header }, ..value };
    assert!(matches!(too_far.encode(), Err(ReturnError::TooGreat { max: 0x3FFF, .. })));
    let with_echo = Return { echo: Bytes::new(&[1]).unwrap(), ..value };
    assert!(matches!(with_echo.encode(), Err(ReturnError::TooGreat { max: 0, .. })));
}

#[test]
fn echo_data_resembling_a_return_is_not_decoded_as_a_return() {
    let mut echo = [0xFC; 252];
    echo[20..33].copy_from_slice(&EXAMPLE_4);
    let header = Header { tag: Tag::Imx, ..Return::decode(&EXAMPLE_4, None).unwrap().header };
    let value = Return { header, echo: Bytes::new(&echo).unwrap() };
    let mut codec = ReturnCodec::default();
    let mut got = Vec::new();
    for byte in value.encode().unwrap().as_slice() {
        codec.push(&[*byte], &mut |value| got.push(value));
    }
    assert_eq!(got, [value]);
}

/// Sonar returns that can't form a false return together with the next one.
///
/// The front of one return and the whole of the next could form a false return that no decoder can detect. The
/// generated returns exclude this in three ways. 0xFC occurs only at the end. Echo lengths differ by less than a
/// header. No position, if read in place of an echo length, equals one of the allowed lengths.
/// `echo_of_any_bytes_round_trips` covers the values that are excluded here.
fn returns(tags: &[Tag], lengths: core::ops::RangeInclusive<usize>) -> impl Strategy<Value = Return> + use<> {
    let tags = proptest::sample::select(tags.to_vec());
    let echo = (proptest::collection::vec(0u8..0xFC, MAX_ECHO_BYTES), lengths);
    let positions = |most| prop_oneof![0u16..480, 520..=most];
    let heads = prop_oneof![(Just(0x10u8), positions(MAX_POSITION)), (0x11u8..=0x15, positions(0x1FFF))];
    let status = proptest::sample::select(vec![0x40u8, 0x41, 0x45, 0xC0, 0x00]);
    (tags, echo, heads, status, any::<bool>(), 0u8..=200, 0u16..=0x3FFF).prop_map(
        |(tag, (echo, len), (head_id, position), status, clockwise, range_m, profile_counts)| Return {
            header: Header {
                tag,
                head_id,
                status: Status(status),
                position,
                clockwise,
                range_m,
                profile_counts,
            },
            echo: Bytes::new(&echo[..len]).unwrap(),
        },
    )
}

fn echoes() -> impl Strategy<Value = Return> {
    returns(&[Tag::Imx, Tag::Igx, Tag::Ina, Tag::Inb, Tag::Inc], 489..=MAX_ECHO_BYTES)
}

fn profiles() -> impl Strategy<Value = Return> {
    returns(&[Tag::Ipx], 0..=0)
}

fn encode(value: &Return) -> Vec<u8> {
    value.encode().unwrap().as_slice().to_vec()
}

proptest! {
    #[test]
    fn echo_of_any_bytes_round_trips(
        value in echoes(),
        echo in proptest::collection::vec(any::<u8>(), 0..=MAX_ECHO_BYTES),
    ) {
        let value = Return { echo: Bytes::new(&echo).unwrap(), ..value };
        prop_assert_eq!(Return::decode(&encode(&value), None), Ok(value));
    }

    #[test]
    fn seven_bit_packing_matches_the_maker_formula(low: u8, high: u8) {
        let written = (u16::from((high & 0x7E) >> 1) << 8) | u16::from(((high & 1) << 7) | (low & 0x7F));
        prop_assert_eq!(unpack(low, high), written);
    }
}

headrace_sensor::codec_contract!(
    contract_of_profiles,
    codec: ReturnCodec::default(),
    values: profiles(),
    encode: encode,
    frames: [EXAMPLE_4, EXAMPLE_5, EXAMPLE_6],
);

headrace_sensor::codec_contract!(
    contract_of_echoes,
    codec: ReturnCodec::default(),
    values: echoes(),
    encode: encode,
    frames: [EXAMPLE_4],
);
