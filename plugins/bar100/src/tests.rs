//! Tests the path from a vehicle file's table to a Bar100's readings, through the emulated sensor.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::Document;
use headrace_sensor::device::{
    Decoder as _, Device, DeviceKind as _, Direction, Emulated, EmulatorSetup, SensorKind,
};
use headrace_sensor::geometry::frames::{Mount, Rot, Vec3};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Pressure;
use headrace_sensor::reading::{Decoded, Packet, Reading, WaterPressure};

use crate::Bar100Kind;
use crate::calibration::{Overrides, STANDARD_ATMOSPHERE_BAR};
use crate::decoder::{Bar100Decoder, DecoderSettings};

fn sensor() -> SensorConfig {
    SensorConfig {
        id: "depth".to_owned(),
        plugin: "bar100".to_owned(),
        connect: "i2c:/dev/i2c-1:0x40".to_owned(),
        mount: Mount { position: Vec3::new(0.0, 0.0, -0.3), rotation: Rot::identity() },
        latency: DurNs::from_millis(9),
    }
}

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let root = Document::new("v.toml", own).root().unwrap();
    let device = Bar100Kind.configure(&sensor(), &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    Ok(device)
}

fn meaning(overrides: Overrides) -> DecoderSettings {
    DecoderSettings {
        overrides,
        ambient_bar: STANDARD_ATMOSPHERE_BAR,
        reject_busy: false,
        latency: DurNs::from_millis(9),
    }
}

fn decode(decoder: &mut Bar100Decoder, received: MonoNs, bytes: &[u8]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
    readings
}

fn pressure(decoded: &Decoded) -> WaterPressure {
    match decoded.reading {
        Reading::Pressure(pressure) => pressure,
        other => panic!("{other:?}"),
    }
}

#[test]
fn readings_are_withheld_until_the_calibration_is_known() {
    let mut decoder = Bar100Decoder::new(meaning(Overrides::default()));
    let measure = [0xAC, 0x40, 0x46, 0x46, 0x4F, 0xA0];
    let at = MonoNs(1_000_000_000);
    assert!(decode(&mut decoder, at, &measure).is_empty());
    assert_eq!(decoder.withheld(), 1);
    for read in [[0x12, 0x40, 0x5B, 0x3D], [0x13, 0x40, 0, 0], [0x14, 0x40, 0, 0], [0x15, 0x40, 0x42, 0xC8]] {
        assert!(decode(&mut decoder, at, &read).is_empty());
    }
    assert!(decode(&mut decoder, at, &measure).is_empty(), "the upper limit's low word is still unknown");
    decode(&mut decoder, at, &[0x16, 0x40, 0, 0]);
    let readings = decode(&mut decoder, at, &measure);
    assert_eq!(readings[0].valid_at, MonoNs(991_000_000));
    assert!((pressure(&readings[0]).pressure_pa - 590_112.0).abs() < 1.0);
    assert_eq!(decoder.withheld(), 2);
    assert_eq!(decoder.counts().good_frames, 8);
}

#[test]
fn log_without_calibration_uses_the_vehicle_file() {
    let device = configured("p_min_bar = 0\np_max_bar = 100\np_mode = \"paa\"\n").unwrap();
    assert_eq!(device.specification().kind, SensorKind::Depth);
    let overrides = Overrides {
        p_min_bar: Some(0.0),
        p_max_bar: Some(100.0),
        mode: Some(crate::calibration::PressureMode::Absolute),
    };
    let mut decoder = Bar100Decoder::new(meaning(overrides));
    let readings = decode(&mut decoder, MonoNs(0), &[0xAC, 0x60, 0x46, 0x46, 0x4F, 0xA0]);
    assert!((pressure(&readings[0]).pressure_pa - 490_112.0).abs() < 1.0);
    let mut strict = Bar100Decoder::new(DecoderSettings { reject_busy: true, ..meaning(overrides) });
    assert!(decode(&mut strict, MonoNs(0), &[0xAC, 0x60, 0x46, 0x46, 0x4F, 0xA0]).is_empty());
    assert_eq!(strict.withheld(), 1);
}

#[test]
fn emulated_sensor_decodes_to_the_true_pressure() {
    let start = MonoNs(5_000_000_000);
    let device = configured("rate_hz = 30\n").unwrap();
    let setup = EmulatorSetup { start, head: None, site: Site::default(), polled: true };
    let Emulated::Depth(mut emulator) = device.emulator(&setup) else { panic!("no depth sensor") };
    let mut decoder = Bar100Decoder::new(meaning(Overrides::default()));
    // The pressure falls by 981 Pa/s, because the vehicle ascends by 0.1 m/s.
    let pressure_pa = |at: MonoNs| 590_000.0 - 981.0 * at.as_secs_f64();
    let (mut readings, mut due) = (Vec::new(), Vec::new());
    emulator.begin(start + DurNs::from_millis(4), &mut due);
    emulator.begin(start + DurNs::from_millis(9_990), &mut due);
    for pressure in due {
        let felt = Pressure { pressure_pa: pressure_pa(pressure.at), ..pressure };
        emulator.tell(&felt, &mut |direction, received, bytes| {
            assert_eq!(direction, Direction::Received);
            readings.extend(decode(&mut decoder, received, bytes));
        });
    }
    assert_eq!((readings.len(), decoder.withheld()), (300, 0));
    assert_eq!(decoder.counts().good_frames, 305);
    assert_eq!(readings[0].valid_at, start);
    assert_eq!(readings[30].valid_at, start + DurNs::from_millis(1000));
    for decoded in &readings {
        let got = pressure(decoded);
        let error_pa = got.pressure_pa - pressure_pa(decoded.valid_at);
        assert!(error_pa.abs() <= got.resolution_pa / 2.0 + 1e-6, "{error_pa} Pa");
        assert!((got.temperature_degc - 10.0).abs() < 1e-9);
    }
}

#[test]
fn wrong_keys_of_the_vehicle_file_are_named() {
    let error = configured("p_mode = \"pax\"\n").err().unwrap();
    assert_eq!(error, "v.toml:1: p_mode = \"pax\": must be one of pr, pa, paa; did you mean \"pa\"?");
    let error = configured("p_min_bar = 50\np_max_bar = 10\n").err().unwrap();
    assert!(error.starts_with("v.toml:2: p_max_bar = 10: ") && error.contains("50 to 10 bar"), "{error}");
    assert!(configured("rate = 20\n").err().unwrap().contains("is not a key here"));
}
