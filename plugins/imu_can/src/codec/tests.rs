//! Worked examples of all makers' message sets, and the codec contract for each set.

use headrace_sensor::codec::{Codec as _, CodecCounts};

use super::*;
use crate::frame::{CanId, FrameKind};
use crate::sets::scaled;

const XSENS: MessageSet = MessageSet::Xsens(xsens::Ids { base: None });
const J1939: MessageSet = MessageSet::J1939(j1939::Network { source_address: None });

/// Parses a frame in `candump -l` notation: identifier, `#`, data.
fn frame(text: &str) -> CanFrame {
    let (id, data) = text.split_once('#').unwrap();
    let bits = u32::from_str_radix(id, 16).unwrap();
    let id = if id.len() == 3 { CanId::Standard(bits.try_into().unwrap()) } else { CanId::Extended(bits) };
    let data: Vec<u8> = data
        .as_bytes()
        .chunks(2)
        .map(|hex| u8::from_str_radix(std::str::from_utf8(hex).unwrap(), 16).unwrap())
        .collect();
    CanFrame::of_kind(FrameKind::Data(id), &data).unwrap()
}

/// Decodes a frame and asserts that it re-encodes identically.
fn message(set: MessageSet, text: &str) -> Message {
    let message = set.decode(&frame(text)).unwrap().unwrap();
    assert_eq!(set.encode(&message), Some(frame(text)), "{text}");
    message
}

fn xsens(text: &str) -> xsens::Message {
    match message(XSENS, text) {
        Message::Xsens(message) => message,
        other => panic!("{other:?}"),
    }
}

fn near<const N: usize>(got: [f64; N], expected: [f64; N], tolerance: f64) {
    for (got, expected) in got.iter().zip(expected) {
        assert!((got - expected).abs() <= tolerance, "{got} is not {expected}");
    }
}

#[test]
fn worked_example_1_decodes_acceleration_as_big_endian() {
    let z = |text| match xsens(text) {
        xsens::Message::Acceleration(raw) => scaled(raw, xsens::ACCELERATION_QUANTUM_MPS2)[2],
        other => panic!("{other:?}"),
    };
    near([z("034#0000000009CF")], [9.808_593_75], 0.0);
    near([z("034#00000000CF09")], [-12_535.0 / 256.0], 0.0);
}

#[test]
fn worked_example_2_decodes_a_turn_rate() {
    let xsens::Message::RateOfTurn(raw) = xsens("032#000000000200") else { panic!() };
    near(scaled(raw, xsens::RATE_QUANTUM_RADPS), [0.0, 0.0, 1.0], 0.0);
}

#[test]
fn worked_example_3_decodes_euler_angles() {
    let xsens::Message::EulerAngles(raw) = xsens("022#0640FE60D300") else { panic!() };
    near(scaled(raw, xsens::EULER_QUANTUM_DEG), [12.5, -3.25, -90.0], 0.0);
}

#[test]
fn worked_example_4_decodes_a_quaternion() {
    let xsens::Message::Quaternion(raw) = xsens("021#76410000000030FB") else { panic!() };
    let [w, x, y, z] = scaled(raw, xsens::QUATERNION_QUANTUM);
    near([w, x, y, z], [0.923_887, 0.0, 0.0, 0.382_671], 1e-6);
    let norm = headrace_sensor::geometry::math::sqrt(w * w + z * z);
    near([norm], [1.000_002_2], 5e-8);
    near([2.0 * headrace_sensor::geometry::math::atan2(z, w).to_degrees()], [44.998], 5e-4);
}

#[test]
fn worked_example_5_decodes_velocity_change_temperature_pressure_and_field() {
    let xsens::Message::DeltaV(delta) = xsens("031#007BFFD303EE0A") else { panic!() };
    assert_eq!(delta.exponent, 10);
    near(delta.mps(), [0.120_12, -0.043_95, 0.982_42], 5e-6);
    let xsens::Message::Temperature(raw) = xsens("051#1580") else { panic!() };
    near([f64::from(raw) * xsens::TEMPERATURE_QUANTUM_DEGC], [21.5], 0.0);
    let xsens::Message::BaroPressure(raw) = xsens("052#C5E68000") else { panic!() };
    near([f64::from(raw) * xsens::PRESSURE_QUANTUM_PA], [101_325.0], 0.0);
    let xsens::Message::MagneticField(raw) = xsens("041#0100FE000333") else { panic!() };
    near(scaled(raw, xsens::MAGNETIC_QUANTUM), [0.25, -0.5, 0.7998], 5e-5);
}

#[test]
fn worked_example_6_decodes_a_sample_time() {
    assert_eq!(xsens("005#00002710"), xsens::Message::SampleTime(10_000));
}

#[test]
fn worked_example_7_decodes_a_slope() {
    let Message::J1939(j1939::Message::Slope(slope)) = message(J1939, "0CF02980#00C07D00E07B0000") else {
        panic!()
    };
    near([slope.pitch_deg().unwrap(), slope.roll_deg().unwrap()], [1.5, -2.25], 0.0);
}

#[test]
fn worked_example_8_decodes_acceleration_and_turn_rate() {
    let sent_by_e2 = MessageSet::J1939(j1939::Network { source_address: Some(0xE2) });
    let Message::J1939(j1939::Message::Acceleration(triple)) =
        message(sent_by_e2, "0CF02DE2#007D007DD5800005")
    else {
        panic!()
    };
    near(triple.accelerations_mps2().unwrap(), [0.0, 0.0, 9.81], 1e-9);
    near([triple.latency_ms().unwrap()], [2.5], 0.0);
    assert!(!triple.has_error());
    let Message::J1939(j1939::Message::AngularRate(triple)) =
        message(sent_by_e2, "0CF02AE2#007D007D007D0005")
    else {
        panic!()
    };
    near(triple.rates_degps().unwrap(), [0.0; 3], 0.0);
    let other = MessageSet::J1939(j1939::Network { source_address: Some(0x80) });
    assert_eq!(other.decode(&frame("0CF02AE2#007D007D007D0005")), Ok(None));
}

#[test]
fn worked_example_9_decodes_bosch_and_sbg_messages() {
    let Message::Bosch(bosch::Message::Yaw(rate, acceleration)) =
        message(MessageSet::Bosch, "070#D0870000538F0000")
    else {
        panic!()
    };
    near([rate.degps()], [10.0], 5e-3);
    near([acceleration.g()], [0.5], 1e-4);
    let Message::Sbg(sbg::Message::Euler(raw)) = message(MessageSet::Sbg, "132#E8030CFE983A") else {
        panic!()
    };
    near(scaled(raw, sbg::EULER_QUANTUM_RAD), [0.1, -0.05, 1.5], 1e-12);
}

#[test]
fn unavailable_values_are_none() {
    let triple = |raw, figures| j1939::Triple { raw, figures, latency: 0xFF };
    assert_eq!(triple([0x7D00, 0xFE00, 0x7D00], 0).rates_degps(), None);
    assert_eq!(triple([0x7D00, 0x7D00, 0xFFFF], 0).accelerations_mps2(), None);
    assert!(triple([0; 3], 0b10_01_00).has_error());
    assert!(!triple([0; 3], 0b01_11_00).has_error());
    assert_eq!(triple([0; 3], 0).latency_ms(), None);
    let slope = j1939::Slope { pitch: 0xFE_0000, roll: 0xFF_FFFF, figures: 0, latency: 0 };
    assert_eq!((slope.pitch_deg(), slope.roll_deg()), (None, None));
}

#[test]
fn configured_base_shifts_xsens_message_ids_to_29_bits() {
    let based = MessageSet::Xsens(xsens::Ids { base: Some(0x19FF_0000) });
    let text = "19FF0032#000000000200";
    assert_eq!(message(based, text), Message::Xsens(xsens::Message::RateOfTurn([0, 0, 512])));
    assert_eq!(XSENS.decode(&frame(text)), Ok(None));
    assert_eq!(based.decode(&frame("032#000000000200")), Ok(None));
}

#[test]
fn frames_of_the_message_set_with_a_wrong_length_count_as_bad() {
    let mut codec = ImuCodec::new(XSENS);
    let mut none = |message| panic!("{message:?}");
    let remote = CanFrame::of_kind(FrameKind::Remote(CanId::Standard(0x34)), &[0; 6]).unwrap();
    let error = CanFrame::of_kind(FrameKind::Error(4), &[0; 8]).unwrap();
    for frame in [remote, error, frame("7FF#00"), frame("134#0000000009CF")] {
        codec.push(&frame.encode(), &mut none);
        codec.flush(&mut none);
    }
    codec.push(&frame("034#00000000").encode(), &mut none);
    assert_eq!(codec.counts(), CodecCounts { good_frames: 4, bad_frames: 1, skipped_bytes: 16 });
}

#[test]
fn frame_over_eight_bytes_is_skipped_completely() {
    // A CAN FD frame of 72 bytes. Its data must not be parsed, because they look like more frames.
    let mut bytes = [0; 72];
    bytes[0] = 0x34;
    bytes[4] = 12;
    let mut codec = ImuCodec::new(XSENS);
    codec.push(&bytes, &mut |message| panic!("{message:?}"));
    assert_eq!(codec.counts(), CodecCounts { good_frames: 0, bad_frames: 1, skipped_bytes: 72 });
}

mod strategies {
    use proptest::array::{uniform3, uniform4, uniform6};
    use proptest::prelude::*;

    use super::super::*;

    pub(super) fn xsens() -> impl Strategy<Value = Message> {
        use xsens::{DeltaV, Message as M, StatusWord, Utc};
        let three = || uniform3(any::<i16>());
        let four = || uniform4(any::<i16>());
        let counts = prop_oneof![
            any::<u8>().prop_map(M::Error),
            any::<u32>().prop_map(M::SampleTime),
            any::<u16>().prop_map(M::GroupCounter),
            (uniform6(any::<u8>()), any::<u16>())
                .prop_map(|(year_to_second, tenths_ms)| M::Utc(Utc { year_to_second, tenths_ms })),
            any::<u32>().prop_map(|word| M::StatusWord(StatusWord(word))),
            any::<i16>().prop_map(M::Temperature),
            any::<u32>().prop_map(M::BaroPressure),
            any::<[i32; 2]>().prop_map(M::LatLon),
            any::<i32>().prop_map(M::Altitude),
        ];
        let vectors = prop_oneof![
            four().prop_map(M::Quaternion),
            three().prop_map(M::EulerAngles),
            (three(), any::<u8>())
                .prop_map(|(mantissas, exponent)| M::DeltaV(DeltaV { mantissas, exponent })),
            three().prop_map(M::RateOfTurn),
            four().prop_map(M::DeltaQ),
            three().prop_map(M::Acceleration),
            three().prop_map(M::FreeAcceleration),
            three().prop_map(M::MagneticField),
            three().prop_map(M::AccelerationHr),
            three().prop_map(M::RateOfTurnHr),
            three().prop_map(M::Velocity),
        ];
        prop_oneof![counts, vectors].prop_map(Message::Xsens)
    }

    pub(super) fn sbg() -> impl Strategy<Value = Message> {
        use sbg::Message as M;
        let three = || uniform3(any::<i16>());
        prop_oneof![
            (any::<u32>(), any::<u16>(), any::<i16>()).prop_map(|(time_us, status, temperature)| {
                let status = sbg::ImuStatus(status);
                M::ImuInfo { time_us, status, temperature }
            }),
            three().prop_map(M::Acceleration),
            three().prop_map(M::Rate),
            any::<u32>().prop_map(M::EkfTime),
            uniform4(any::<i16>()).prop_map(M::Quaternion),
            three().prop_map(M::Euler),
            uniform3(any::<u16>()).prop_map(M::Accuracy),
        ]
        .prop_map(Message::Sbg)
    }

    pub(super) fn j1939() -> impl Strategy<Value = Message> {
        use j1939::{Message as M, Slope, Triple};
        let triple =
            || {
                (uniform3(any::<u16>()), any::<u8>(), any::<u8>())
                    .prop_map(|(raw, figures, latency)| Triple { raw, figures, latency })
            };
        let slope = (0u32..1 << 24, 0u32..1 << 24, any::<u8>(), any::<u8>())
            .prop_map(|(pitch, roll, figures, latency)| Slope { pitch, roll, figures, latency });
        prop_oneof![
            slope.prop_map(M::Slope),
            triple().prop_map(M::AngularRate),
            triple().prop_map(M::Acceleration),
        ]
        .prop_map(Message::J1939)
    }

    pub(super) fn bosch() -> impl Strategy<Value = Message> {
        use bosch::{Message as M, RawAcceleration, RawRate};
        let both = || {
            (any::<u16>(), any::<u16>())
                .prop_map(|(rate, acceleration)| (RawRate(rate), RawAcceleration(acceleration)))
        };
        prop_oneof![
            both().prop_map(|(rate, acceleration)| M::Yaw(rate, acceleration)),
            both().prop_map(|(rate, acceleration)| M::Roll(rate, acceleration)),
            both().prop_map(|(_, acceleration)| M::Vertical(acceleration)),
        ]
        .prop_map(Message::Bosch)
    }
}

fn encode(set: MessageSet) -> impl Fn(&Message) -> [u8; FRAME_BYTES] {
    move |message| set.encode(message).unwrap().encode()
}

headrace_sensor::codec_contract!(
    xsens_contract,
    codec: ImuCodec::new(XSENS),
    values: strategies::xsens(),
    encode: encode(XSENS),
    frames: ["034#0000000009CF", "021#76410000000030FB"].map(|text| frame(text).encode()),
);

headrace_sensor::codec_contract!(
    sbg_contract,
    codec: ImuCodec::new(MessageSet::Sbg),
    values: strategies::sbg(),
    encode: encode(MessageSet::Sbg),
    frames: [frame("132#E8030CFE983A").encode()],
);

headrace_sensor::codec_contract!(
    j1939_contract,
    codec: ImuCodec::new(J1939),
    values: strategies::j1939(),
    encode: encode(J1939),
    frames: ["0CF02980#00C07D00E07B0000", "0CF02DE2#007D007DD5800005"].map(|text| frame(text).encode()),
);

headrace_sensor::codec_contract!(
    bosch_contract,
    codec: ImuCodec::new(MessageSet::Bosch),
    values: strategies::bosch(),
    encode: encode(MessageSet::Bosch),
    frames: [frame("070#D0870000538F0000").encode()],
);
