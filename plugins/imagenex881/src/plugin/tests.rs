use headrace_sensor::geometry::math::PI;
use headrace_sensor::geometry::time::MonoNs;

use super::*;
use crate::codec::Status;
use crate::settings::tests::{sensor, settings};

const LATENCY: DurNs = DurNs(2_000_000);

fn decoder(text: &str) -> HeadDecoder {
    HeadDecoder::new(settings(text).unwrap(), LATENCY)
}

fn good() -> Return {
    let header = Header {
        tag: Tag::Ipx,
        head_id: 0x10,
        status: Status(0x41),
        position: 750,
        clockwise: true,
        range_m: 10,
        profile_counts: 537,
    };
    Return { header, echo: Bytes::default() }
}

fn bytes(value: &Return) -> Vec<u8> {
    value.encode().unwrap().as_slice().to_vec()
}

fn decode(decoder: &mut HeadDecoder, received_ms: i64, bytes: &[u8]) -> Vec<(i64, SonarReturn)> {
    let mut got = Vec::new();
    let packet = Packet { received: MonoNs(0) + DurNs::from_millis(received_ms), bytes };
    decoder.decode(packet, &mut |decoded| match decoded.reading {
        Reading::Sonar(sonar) => got.push((decoded.valid_at.since(MonoNs(0)).0 / 1_000_000, sonar)),
        other => panic!("{other:?}"),
    });
    got
}

#[test]
fn reading_is_valid_one_latency_before_its_return() {
    let got = decode(&mut decoder("mode = \"fast\""), 100, &bytes(&good()));
    let expected = SonarReturn {
        angle_rad: PI / 4.0,
        range_m: Some(5.37),
        resolution_m: 0.01,
        max_range_m: 10.0,
        sound_speed_mps: 1500.0,
    };
    assert_eq!(got, [(98, expected)]);
}

#[test]
fn short_range_setting_has_2_mm_resolution() {
    let mut decoder = decoder("mode = \"fast\"\nrange_m = 3");
    let near = Return { header: Header { range_m: 3, profile_counts: 1234, ..good().header }, ..good() };
    let [(_, sonar)] = decode(&mut decoder, 0, &bytes(&near))[..] else { panic!() };
    assert_eq!((sonar.range_m, sonar.resolution_m), (Some(2.468), 0.002));
    let silent = Return { header: Header { profile_counts: 0, ..near.header }, ..near };
    let [(_, sonar)] = decode(&mut decoder, 20, &bytes(&silent))[..] else { panic!() };
    assert_eq!(sonar.range_m, None);
}

#[test]
fn angle_uses_sign_and_offset() {
    let mut decoder = decoder("mode = \"fast\"\nangle_sign = \"inverted\"\nangle_offset_deg = 180");
    let [(_, sonar)] = decode(&mut decoder, 0, &bytes(&good()))[..] else { panic!() };
    assert!((sonar.angle_rad - 0.75 * PI).abs() < 1e-12);
}

#[test]
fn untrustworthy_returns_are_rejected_and_counted() {
    let mut decoder = decoder("mode = \"fast\"");
    let header = good().header;
    let bad = [
        Header { status: Status(0x01), ..header },
        Header { status: Status(0xC0), ..header },
        Header { head_id: 0x12, ..header },
        Header { tag: Tag::Ina, ..header },
        Header { range_m: 20, ..header },
        Header { profile_counts: 1001, ..header },
    ];
    for (i, header) in (0..).zip(bad) {
        assert_eq!(decode(&mut decoder, i * 20, &bytes(&Return { header, ..good() })), [], "{header:?}");
    }
    let mut too_far = bytes(&good());
    [too_far[5], too_far[6]] = [0x31, 0x49]; // position 1201
    assert_eq!(decode(&mut decoder, 200, &too_far), []);
    assert_eq!(decode(&mut decoder, 220, &bytes(&good())).len(), 1);
    let rejected = Rejected { status: 2, head_id: 1, tag: 1, range_setting: 1, beyond_range: 1 };
    assert_eq!(decoder.rejected(), rejected);
    let counts = CodecCounts { good_frames: 7, bad_frames: 1, skipped_bytes: 13 };
    assert_eq!((decoder.counts(), decoder.withheld()), (counts, 6));
}

#[test]
fn split_return_has_the_time_of_its_first_byte() {
    let mut decoder = decoder("mode = \"fast\"");
    let two = [bytes(&good()), bytes(&good())].concat();
    assert_eq!(decode(&mut decoder, 100, &two[..5]), []);
    assert_eq!(decode(&mut decoder, 101, &two[5..9]), []);
    let times: Vec<i64> = decode(&mut decoder, 102, &two[9..]).iter().map(|(ms, _)| *ms).collect();
    assert_eq!(times, [98, 100]);
}

#[test]
fn return_after_a_truncated_return_is_timed_by_its_own_arrival() {
    let mut decoder = decoder("mode = \"fast\"");
    let whole = bytes(&good());
    assert_eq!(decode(&mut decoder, 100, &whole[..9]), []);
    assert_eq!(decode(&mut decoder, 118, &whole[..6]), []);
    let [(ms, _)] = decode(&mut decoder, 119, &whole[6..])[..] else { panic!() };
    assert_eq!(ms, 116);
}

#[test]
fn return_after_a_long_silence_is_timed_by_its_own_arrival() {
    let mut decoder = decoder("mode = \"fast\"");
    assert_eq!(decode(&mut decoder, 100, &bytes(&good())[..5]), []);
    let [(ms, _)] = decode(&mut decoder, 5000, &bytes(&good()))[..] else { panic!() };
    assert_eq!(ms, 4998);
}

#[test]
fn head_specification_follows_its_settings() {
    let settings = settings("mode = \"slow\"\nangle_offset_deg = 90").unwrap();
    let head = Imagenex881 { sensor: sensor(), settings };
    assert_eq!(head.specification().kind, SensorKind::Head);
    let spec = head.head().unwrap();
    assert_eq!((spec.ping_period_s, spec.range_m[1]), (0.018, 10.0));
    assert!((spec.step_rad - 0.3_f64.to_radians()).abs() < 1e-15);
}

#[test]
fn removing_echo_data_from_returns_does_not_change_readings() {
    let echo = Bytes::new(&[0x5A; 252]).unwrap();
    let long = Return { header: Header { tag: Tag::Imx, ..good().header }, echo };
    let packet = [bytes(&long), bytes(&good()), bytes(&long)].concat();
    let mut shorter = Vec::new();
    assert_eq!(without_echoes(&packet, &mut shorter), Some(()));
    assert_eq!(shorter, [bytes(&good()), bytes(&good()), bytes(&good())].concat());
    let read = |bytes: &[u8]| decode(&mut decoder("mode = \"fast\""), 100, bytes);
    assert_eq!(read(&shorter), read(&packet));
    assert_eq!(read(&packet).len(), 3);
    // The packets are half a return, foreign bytes, and a return without an echo.
    for kept in [&packet[..400], &packet[1..], &bytes(&good())] {
        assert_eq!(without_echoes(kept, &mut Vec::new()), None);
    }
}
