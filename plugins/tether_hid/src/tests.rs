//! Tests the path from a vehicle file's table to a cable counter's readings, through the emulated counter.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::Document;
use headrace_sensor::device::{Decoder, Device, DeviceKind as _, Emulated, EmulatorSetup};
use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Payout;
use headrace_sensor::reading::{Decoded, Packet, Reading, TetherLength};

use crate::TetherHidKind;
use crate::decoder::{Counter, HidDecoder, LineDecoder};
use crate::report::{Endian, Report, ReportLayout, Width};
use crate::tracker::Counting;

/// Chainage of a vehicle that moves inwards at 0.5 m/s from chainage 20 m.
fn chainage_m(at: MonoNs) -> f64 {
    20.0 + 0.5 * at.as_secs_f64()
}

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let sensor = SensorConfig {
        id: "tether".to_owned(),
        plugin: "tether_hid".to_owned(),
        connect: "hid:1209:0001".to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: DurNs::from_millis(4),
    };
    let root = Document::new("v.toml", own).root().unwrap();
    let device = TetherHidKind.configure(&sensor, &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    assert_eq!(device.specification().sensor, sensor);
    Ok(device)
}

fn reference_counter() -> Counter {
    Counter {
        layout: ReportLayout::REFERENCE,
        auxiliary_is_ms: false,
        counting: Counting::Absolute,
        counts_per_metre: 2000.0,
        step_m: 0.0,
        max_speed_mps: 3.0,
        latency: DurNs::from_millis(4),
    }
}

fn decode(decoder: &mut dyn Decoder, received: MonoNs, bytes: &[u8]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
    readings
}

fn length(decoded: &Decoded) -> TetherLength {
    match decoded.reading {
        Reading::TetherLength(length) => length,
        other => panic!("{other:?}"),
    }
}

/// Passes the emulated device's messages to `decoder`, and compares each reading with the truth.
fn round_trip(own: &str, decoder: &mut dyn Decoder, zero_at_m: f64, scale: f64, reports: usize) {
    let setup = EmulatorSetup { start: MonoNs(7), head: None, site: Site::default(), polled: true };
    let Emulated::Tether(mut emulator) = configured(own).unwrap().emulator(&setup) else {
        panic!("no cable counter")
    };
    let (mut readings, mut due) = (Vec::new(), Vec::new());
    let mut until = setup.start;
    while due.len() < reports {
        until = until + DurNs::from_millis(10);
        emulator.begin(until, &mut due);
    }
    due.truncate(reports);
    for payout in due {
        let reeled = Payout { chainage_m: chainage_m(payout.at), ..payout };
        emulator.tell(&reeled, &mut |_, received, bytes| readings.extend(decode(decoder, received, bytes)));
    }
    assert_eq!(readings.len(), reports);
    assert_eq!(readings[0].valid_at, MonoNs(7));
    for decoded in &readings {
        let expected_m = (chainage_m(decoded.valid_at) - zero_at_m) / scale;
        let got = length(decoded);
        let error_m = got.length_m - expected_m;
        assert!(error_m.abs() <= got.resolution_m / 2.0 + 1e-9, "{error_m} m at {expected_m} m");
    }
}

#[test]
fn worked_example_1_gives_a_length_of_minus_61_728_m() {
    let mut decoder = HidDecoder::new(reference_counter()).unwrap();
    let report = [0x01, 0x2A, 0x01, 0xC0, 0x1D, 0xFE, 0xFF, 0xDC, 0x05, 0x00, 0x00];
    let readings = decode(&mut decoder, MonoNs(5_000_000), &report);
    assert_eq!(readings[0].valid_at, MonoNs(1_000_000));
    assert!((length(&readings[0]).length_m + 61.728).abs() < 1e-12);
    assert!((length(&readings[0]).resolution_m - 0.0005).abs() < 1e-15);
    assert_eq!(decoder.status(), Some(1));
}

#[test]
fn length_of_the_emulated_reference_counter_matches_the_cable() {
    let mut decoder = HidDecoder::new(reference_counter()).unwrap();
    round_trip("counts_per_metre = 2000\nzero_at_m = 12.5\nscale = 0.98\n", &mut decoder, 12.5, 0.98, 2000);
    assert_eq!(decoder.health(), crate::tracker::TrackerHealth::default());
}

#[test]
fn length_of_an_emulated_16_bit_counter_matches_the_cable() {
    let layout = ReportLayout {
        report_id: None,
        report_bytes: 4,
        offset: 1,
        width: Width::Bits16,
        signed: true,
        endian: Endian::Big,
        sequence_offset: None,
        status_offset: None,
        auxiliary_offset: None,
    };
    let counter = Counter { layout, counts_per_metre: -1500.0, ..reference_counter() };
    let own = "report_id = 0\nreport_bytes = 4\noffset = 1\nwidth_bits = 16\nendian = \"big\"\n\
               counts_per_metre = -1500\nzero_at_m = 10.0\n";
    // A count of 16 bits wraps after 22 m in either direction; the vehicle moves from 10 m to 60 m of chainage.
    round_trip(own, &mut HidDecoder::new(counter).unwrap(), 10.0, 1.0, 5000);
}

#[test]
fn length_of_an_emulated_delta_counter_matches_the_cable() {
    let layout = ReportLayout { width: Width::Bits8, ..ReportLayout::REFERENCE };
    let layout =
        ReportLayout { sequence_offset: None, status_offset: None, auxiliary_offset: None, ..layout };
    let counter = Counter { layout, counting: Counting::Delta, ..reference_counter() };
    let own = "mode = \"delta\"\nwidth_bits = 8\ncounts_per_metre = 2000\nzero_at_m = 20.0\n";
    round_trip(own, &mut HidDecoder::new(counter).unwrap(), 20.0, 1.0, 2000);
}

#[test]
fn counter_clock_is_followed_if_configured() {
    let mut decoder = HidDecoder::new(reference_counter()).unwrap();
    round_trip("counts_per_metre = 2000\n", &mut decoder, 0.0, 1.0, 200);
    assert_eq!(decoder.clock(), None);
    let mut decoder = HidDecoder::new(Counter { auxiliary_is_ms: true, ..reference_counter() }).unwrap();
    round_trip("counts_per_metre = 2000\nclock_ms_offset = 7\n", &mut decoder, 0.0, 1.0, 2000);
    let clock = decoder.clock().unwrap();
    assert_eq!((clock.stamps, clock.restarts, clock.jumps), (2000, 0, 0));
    assert_eq!(clock.span, DurNs::from_millis(39_980));
    assert!(clock.drift.unwrap().ppm.abs() < 1e-6, "{clock:?}");
    // A clock value from 2^31 ms on is negative on the wire, but must not count as a restart.
    let mut decoder = HidDecoder::new(Counter { auxiliary_is_ms: true, ..reference_counter() }).unwrap();
    for (second, ms) in [i32::MAX - 999, i32::MIN, i32::MIN + 1000].into_iter().enumerate() {
        let report = Report { sequence: None, status: None, count: 0, auxiliary: Some(ms) };
        let bytes = ReportLayout::REFERENCE.encode(&report);
        decode(&mut decoder, MonoNs(second as u64 * 1_000_000_000), &bytes);
    }
    assert_eq!(decoder.clock().unwrap().restarts, 0);
}

#[test]
fn length_of_an_emulated_line_monitor_matches_the_cable() {
    let mut decoder = LineDecoder::new(1.0, DurNs::from_millis(4));
    round_trip("kind = \"lci90\"\nzero_at_m = 30.0\n", &mut decoder, 30.0, 1.0, 500);
    let mut decoder = LineDecoder::new(0.3048, DurNs::from_millis(4));
    round_trip("kind = \"lci90\"\nunit = \"ft\"\nrate_hz = 20\n", &mut decoder, 0.0, 1.0, 500);
}

#[test]
fn line_has_the_time_of_its_first_byte() {
    let mut decoder = LineDecoder::new(1.0, DurNs::ZERO);
    let line = b"RD,00000125,000012.4,0152.304,1504\r\n";
    assert!(decode(&mut decoder, MonoNs(100), &line[..10]).is_empty());
    assert!(decode(&mut decoder, MonoNs(200), &line[10..20]).is_empty());
    let rest = [&line[20..], &line[..], &line[..5]].concat();
    let readings = decode(&mut decoder, MonoNs(300), &rest);
    assert_eq!(readings.iter().map(|decoded| decoded.valid_at.0).collect::<Vec<_>>(), [100, 300]);
    assert_eq!(decode(&mut decoder, MonoNs(400), &line[5..])[0].valid_at, MonoNs(300));
}

#[test]
fn wrong_keys_of_the_vehicle_file_are_named() {
    let error = |own| configured(own).err().unwrap();
    assert_eq!(error("kind = \"hid\"\n"), "v.toml:1: counts_per_metre: is missing");
    assert!(error("counts_per_metre = 2000\nwidth_bits = 24\n").contains("must be 8, 16 or 32"));
    assert!(error("counts_per_metre = 2000\noffset = 9\n").contains("the report has 11"));
    assert!(
        error("counts_per_metre = 2000\nclock_ms_offset = 8\n").contains("the auxiliary value at offset 8")
    );
    assert!(error("counts_per_metre = 9000\nwidth_bits = 8\n").contains("max_speed_mps"));
    assert!(error("kind = \"lci90\"\ncounts_per_metre = 2000\n").contains("is not a key here"));
    assert!(error("counts_per_metre = 2000\nscale = 0\n").contains("away from zero"));
}

#[test]
fn keys_override_step_and_noise_of_a_preset() {
    for (own, resolution_m, sd_m) in [
        ("preset = \"encoder_wheel\"\n", 0.0005, Some(0.005)),
        ("preset = \"magnet_wheel\"\n", 0.01, Some(0.01)),
        ("preset = \"magnet_wheel\"\nstep_m = 0.02\n", 0.02, Some(0.01)),
        ("preset = \"magnet_wheel\"\ncounts_per_metre = 25\n", 0.04, Some(0.01)),
        ("counts_per_metre = 2000\nstep_m = 0.05\n", 0.05, None),
        ("counts_per_metre = 2000\n", 0.0005, None),
    ] {
        let counter = configured(own).unwrap().counter().unwrap();
        let step_m = counter.step_m.unwrap();
        assert!((step_m - resolution_m).abs() < 1e-12, "{own}: {step_m}");
        assert_eq!(counter.sd_m, sd_m, "{own}");
    }
    let line = configured("kind = \"lci90\"\n").unwrap().counter().unwrap();
    assert_eq!((line.step_m, line.sd_m), (None, None), "its lines tell");
    for (wrong, said) in [
        ("preset = \"wheel\"\n", "encoder_wheel, magnet_wheel"),
        ("kind = \"lci90\"\npreset = \"magnet_wheel\"\n", "is not a key here"),
        ("counts_per_metre = 2000\nstep_m = 0\n", "must be a number from"),
    ] {
        let error = configured(wrong).err().unwrap();
        assert!(error.contains(said), "{error}");
    }
}
