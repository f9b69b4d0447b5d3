//! Tests the path from a vehicle file's table to an A50's readings, through the emulated device.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::Document;
use headrace_sensor::device::{
    Decoder as _, Device, DeviceKind as _, Direction, Emulated, EmulatorSetup, Sense,
};
use headrace_sensor::driver::{Driver as _, Wire};
use headrace_sensor::geometry::frames::{Mount, Rot, Sensor, Vec3};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::GroundVelocity;
use headrace_sensor::reading::{Decoded, Packet, Reading};

use crate::A50Kind;
use crate::decoder::{A50Decoder, DecoderSettings, Withheld};
use crate::driver::A50Driver;
use crate::report::tests::EXAMPLE;
use crate::report::{Against, Velocity};

const START: MonoNs = MonoNs(5_000_000_000);
const LATENCY: DurNs = DurNs::from_millis(4);

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let sensor = SensorConfig {
        id: "dvl".to_owned(),
        plugin: "a50".to_owned(),
        connect: "tcp:192.168.194.95:16171".to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: LATENCY,
    };
    let root = Document::new("v.toml", own).root().unwrap();
    let device = A50Kind.configure(&sensor, &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    assert_eq!(device.specification().sensor, sensor);
    Ok(device)
}

fn decoder() -> A50Decoder {
    A50Decoder::new(DecoderSettings { fom_max_mps: 0.4, max_speed_mps: 3.0, latency: LATENCY })
}

fn decode(decoder: &mut A50Decoder, received: MonoNs, bytes: &[u8]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
    readings
}

/// A report that the decoder accepts.
fn good() -> Velocity {
    Velocity {
        against: Against::Bottom,
        velocity_mps: [0.3, 0.02, -0.01],
        fom_mps: 0.002,
        altitude_m: 1.5,
        valid_beams: 4,
        is_valid: true,
        status: 0,
        times_us: Some([1_000_000, 1_120_000]),
    }
}

#[test]
fn encoded_velocities_are_decoded_with_their_times() {
    let setup = EmulatorSetup { start: START, head: None, site: Site::default(), polled: true };
    let device = configured("rate_hz = 12.5\n").unwrap();
    assert_eq!(device.sense(), Sense::Velocity);
    let Emulated::VelocityLog(mut emulator) = device.emulator(&setup) else { panic!() };
    let truth = |at: MonoNs| -> Vec3<Sensor> {
        let t = at.since(START).as_secs_f64();
        Vec3::new(0.3 + 0.01 * t, -0.1, 0.02 * t)
    };
    let (mut due, mut readings, mut decoder) = (Vec::new(), Vec::new(), decoder());
    emulator.begin(START + DurNs::from_millis(4001), &mut due);
    assert_eq!(due.len(), 51);
    for moved in due {
        let moved = GroundVelocity { velocity_mps: truth(moved.at), ..moved };
        emulator.tell(&moved, &mut |direction, received, bytes| {
            assert_eq!((direction, received), (Direction::Received, moved.at + DurNs::from_millis(104)));
            readings.extend(decode(&mut decoder, received, bytes));
        });
    }
    assert_eq!((readings.len(), decoder.withheld()), (51, 0));
    for decoded in readings {
        assert_eq!(decoded.reading, Reading::VelocityOverGround(truth(decoded.valid_at)));
    }
}

#[test]
fn reports_of_a_stationary_vehicle_do_not_count_as_repeats() {
    let setup = EmulatorSetup { start: START, head: None, site: Site::default(), polled: true };
    let Emulated::VelocityLog(mut emulator) = configured("").unwrap().emulator(&setup) else { panic!() };
    let (mut due, mut heard, mut decoder) = (Vec::new(), 0, decoder());
    emulator.begin(START + DurNs::from_millis(1000), &mut due);
    for moved in &due {
        emulator.tell(moved, &mut |_, received, bytes| heard += decode(&mut decoder, received, bytes).len());
    }
    assert_eq!((due.len(), heard), (8, 8));
}

#[test]
fn device_axes_are_converted_and_the_device_delay_is_subtracted() {
    let got = decode(&mut decoder(), START, &good().encode());
    let valid_at = START - DurNs::from_millis(124);
    assert_eq!(
        got,
        [Decoded { valid_at, reading: Reading::VelocityOverGround(Vec3::new(0.3, -0.02, 0.01)) }]
    );
}

#[test]
fn validity_time_of_a_report_without_times_is_receive_time_less_latency() {
    let report = Velocity { times_us: None, ..good() };
    assert_eq!(decode(&mut decoder(), START, &report.encode())[0].valid_at, START - LATENCY);
}

#[test]
fn split_line_has_the_time_of_its_first_byte() {
    let mut decoder = decoder();
    let (first, rest) = EXAMPLE.as_bytes().split_at(700);
    assert_eq!(decode(&mut decoder, START, first), []);
    let got = decode(&mut decoder, START + DurNs::from_millis(30), rest);
    assert_eq!(got[0].valid_at, START - LATENCY - DurNs(189_319_000));
}

#[test]
fn unusable_reports_are_withheld_and_counted_by_reason() {
    let none = Withheld::default();
    for (report, wanted) in [
        (Velocity { is_valid: false, ..good() }, Withheld { invalid: 1, ..none }),
        (Velocity { status: 1, ..good() }, Withheld { status: 1, ..none }),
        (Velocity { against: Against::Water, ..good() }, Withheld { water: 1, ..none }),
        (Velocity { valid_beams: 2, ..good() }, Withheld { beams: 1, ..none }),
        (Velocity { altitude_m: -1.0, ..good() }, Withheld { altitude: 1, ..none }),
        (Velocity { altitude_m: 50.1, ..good() }, Withheld { altitude: 1, ..none }),
        (Velocity { fom_mps: 0.41, ..good() }, Withheld { fom: 1, ..none }),
        (Velocity { fom_mps: -0.1, ..good() }, Withheld { fom: 1, ..none }),
        (Velocity { velocity_mps: [2.0, 2.0, 1.1], ..good() }, Withheld { speed: 1, ..none }),
        (Velocity { times_us: Some([1_000_000, 900_000]), ..good() }, Withheld { times: 1, ..none }),
        (Velocity { times_us: Some([1_000_000, 3_100_000]), ..good() }, Withheld { times: 1, ..none }),
        (Velocity { times_us: Some([i64::MIN, i64::MAX]), ..good() }, Withheld { times: 1, ..none }),
    ] {
        let mut decoder = decoder();
        assert_eq!(decode(&mut decoder, START, &report.encode()), [], "{report:?}");
        assert_eq!((decoder.left_out(), decoder.withheld()), (wanted, 1), "{report:?}");
    }
    let edge = Velocity { valid_beams: 3, altitude_m: 0.05, fom_mps: 0.4, ..good() };
    assert_eq!(decode(&mut decoder(), START, &edge.encode()).len(), 1);
}

#[test]
fn repeated_reports_are_withheld_and_counted() {
    let mut decoder = decoder();
    let later = Some([1_100_000, 1_220_000]);
    let reports = [
        (good(), 1),
        (good(), 0),
        // This report has the previous report's timestamp, but another velocity.
        (Velocity { velocity_mps: [0.4, 0.0, 0.0], ..good() }, 0),
        (Velocity { velocity_mps: [0.4, 0.0, 0.0], times_us: later, ..good() }, 0),
        (Velocity { times_us: Some([1_200_000, 1_320_000]), ..good() }, 1),
        (Velocity { times_us: Some([1_300_000, 1_420_000]), altitude_m: 1.501, ..good() }, 1),
    ];
    for (number, (report, heard)) in reports.into_iter().enumerate() {
        assert_eq!(decode(&mut decoder, START, &report.encode()).len(), heard, "report {number}");
    }
    assert_eq!(decoder.left_out(), Withheld { repeated: 3, ..Withheld::default() });
}

#[test]
fn wrong_keys_of_the_vehicle_file_are_named() {
    let error = |own| configured(own).err().unwrap();
    assert!(error("fom_max_mps = 0\n").starts_with("v.toml:1: fom_max_mps = 0: must be a number from 0.001"));
    assert!(error("max_speed_mps = 20\n").contains("from 0.1 to 10"));
    assert!(error("min_beams = 3\n").contains("is not a key here"));
    assert!(configured("fom_max_mps = 0.05\nmax_speed_mps = 1.5\nrate_hz = 10\n").is_ok());
}

struct Nowhere;

impl Wire for Nowhere {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, _: MonoNs, _: &[u8]) {}
}

#[test]
fn unknown_format_is_reported_until_a_velocity_arrives() {
    // Reports of older firmware have no type. Reports of a later format might have other field names.
    let older = EXAMPLE.replace("json_v3.2", "json_v1").replace("\"type\": \"velocity\", ", "");
    let renamed = EXAMPLE.replace("json_v3.2", "json_v9").replace("\"vx\"", "\"v_x\"");
    for (line, format) in [(older, "json_v1"), (renamed, "json_v9")] {
        assert_ne!(line, EXAMPLE);
        let mut driver = A50Driver::new();
        driver.opened(START, &mut Nowhere);
        for _ in 0..20 {
            driver.heard(START, line.as_bytes(), &mut Nowhere);
        }
        let health = driver.health();
        let complaint = health.complaint.unwrap();
        assert!(complaint.contains(&format!("format {format} ")), "{complaint}");
        assert_eq!(health.good_frames, 0, "no velocity has been received");
        driver.heard(START, EXAMPLE.as_bytes(), &mut Nowhere);
        assert_eq!((driver.health().complaint, driver.health().good_frames), (None, 1));
    }
}

#[test]
fn device_without_velocities_is_reported() {
    let mut driver = A50Driver::new();
    driver.heard(START, "{\"a\":1}\n".repeat(20).as_bytes(), &mut Nowhere);
    assert!(driver.health().complaint.unwrap().contains("without a velocity or a format"));
    let mut driver = A50Driver::new();
    let with_escapes = "{\"format\":\"\u{1b}[31m\"}\n";
    driver.heard(START, with_escapes.repeat(20).as_bytes(), &mut Nowhere);
    assert!(!driver.health().complaint.unwrap_or_default().contains('\u{1b}'));
}
