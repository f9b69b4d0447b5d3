//! Tests the path from a vehicle file's table to the readings of its sensors, through the emulated autopilot.

use headrace_sensor::SensorConfig;
use headrace_sensor::codec::CodecCounts;
use headrace_sensor::config::Document;
use headrace_sensor::device::{
    Decoder as _, Device, DeviceKind as _, Direction, Emulated, Emulator, EmulatorSetup, Sense,
};
use headrace_sensor::driver::{DriverSetup, Wire};
use headrace_sensor::geometry::frames::{Mount, Rot, Sensor, Vec3};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::{Inertia, Measurement, Pressure, Sounding};
use headrace_sensor::reading::{Decoded, Level, Packet, Reading};

use crate::decoder::{DecoderSettings, DistancePart, MavlinkDecoder, Part};
use crate::dialect::{ATTITUDE_DATA, HEARTBEAT_DATA, MavAutopilot, MavType};
use crate::frame::{encode, without_identity};
use crate::message::{Distance, ImuMessage, Message, Pressure as PressureValues, PressureMessage};
use crate::{MavHeader, MavlinkKind};

/// Recorded ATTITUDE, RAW_IMU and SCALED_PRESSURE2 messages of an ArduSub, from a telemetry log.
pub(crate) const RECORDED_ATTITUDE: &[u8] = &[
    0xFD, 0x1C, 0x00, 0x00, 0xEC, 0x01, 0x01, 0x1E, 0x00, 0x00, 0x53, 0x84, 0x0A, 0x00, 0x9C, 0x11, 0xC7,
    0xBC, 0x2B, 0x3E, 0xCA, 0x3C, 0xA0, 0x45, 0x16, 0xC0, 0x16, 0x73, 0xBF, 0xBC, 0x59, 0x0E, 0x30, 0x3C,
    0x07, 0x07, 0x37, 0xBA, 0x07, 0xBA,
];
pub(crate) const RECORDED_RAW_IMU: &[u8] = &[
    0xFD, 0x1D, 0x00, 0x00, 0xC9, 0x01, 0x01, 0x1B, 0x00, 0x00, 0x48, 0xFA, 0x13, 0x29, 0x00, 0x00, 0x00,
    0x00, 0x25, 0x00, 0x18, 0x00, 0x29, 0xFC, 0xF1, 0xFF, 0x11, 0x00, 0x00, 0x00, 0x63, 0xFF, 0x47, 0x00,
    0x5A, 0x01, 0x00, 0x9A, 0x0B, 0x4A, 0xD4,
];
pub(crate) const RECORDED_PRESSURE: &[u8] = &[
    0xFD, 0x0E, 0x00, 0x00, 0xD7, 0x01, 0x01, 0x89, 0x00, 0x00, 0x17, 0x84, 0x0A, 0x00, 0x33, 0xF3, 0x7D,
    0x44, 0x00, 0x00, 0x00, 0x00, 0xDD, 0x04, 0xF8, 0x5F,
];

const START: MonoNs = MonoNs(2_000_000_000);
const LATENCY: DurNs = DurNs::from_millis(5);

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let sensor = SensorConfig {
        id: "autopilot".to_owned(),
        plugin: "mavlink".to_owned(),
        connect: "udp:0.0.0.0:14550".to_owned(),
        mount: Mount { position: Vec3::zero(), rotation: Rot::identity() },
        latency: LATENCY,
    };
    let root = Document::new("v.toml", own).root().unwrap();
    let device = MavlinkKind.configure(&sensor, &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    assert_eq!(device.specification().sensor, sensor);
    Ok(device)
}

fn decoder(part: Part) -> MavlinkDecoder {
    MavlinkDecoder::new(DecoderSettings { part, system_id: None, component_id: None, latency: LATENCY })
}

const RAW_IMU: Part = Part::Imu { message: Some(ImuMessage::Raw) };
const PRESSURE: Part = Part::Pressure { message: PressureMessage::Second, resolution_pa: 10.0 };
const DISTANCE: DistancePart =
    DistancePart { orientation: None, sensor_id: None, unknown_confidence: 0.7, sound_speed_mps: 1450.0 };

fn decode(decoder: &mut MavlinkDecoder, received: MonoNs, bytes: &[u8]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
    readings
}

fn decode_message(decoder: &mut MavlinkDecoder, message: &Message) -> Vec<Reading> {
    let frame = message.to_frame(MavHeader { system_id: 1, component_id: 1, sequence: 0 });
    let readings = decode(decoder, START, frame.raw_bytes());
    readings.into_iter().map(|decoded| decoded.reading).collect()
}

/// Readings of one sensor, sent by the emulated autopilot. `feel` fills in the measurements.
fn emulated<M: Measurement>(
    emulator: &mut dyn Emulator<M>,
    decoder: &mut MavlinkDecoder,
    count: usize,
    feel: impl Fn(M) -> M,
) -> Vec<Decoded> {
    let (mut due, mut readings) = (Vec::new(), Vec::new());
    let mut until = START;
    while due.len() < count {
        until = until + DurNs::from_millis(7);
        emulator.begin(until, &mut due);
    }
    for measured in due.into_iter().take(count) {
        emulator.tell(&feel(measured), &mut |direction, received, bytes| {
            assert_eq!((direction, received), (Direction::Received, measured.at() + LATENCY));
            readings.extend(decode(decoder, received, bytes));
        });
    }
    let counts = decoder.counts();
    assert_eq!((counts.bad_frames, counts.skipped_bytes, decoder.withheld()), (0, 0, 0));
    readings
}

fn setup() -> EmulatorSetup {
    EmulatorSetup {
        start: START,
        head: None,
        site: Site { sound_speed_mps: 1450.0, ..Site::default() },
        polled: true,
    }
}

/// Motion of a vehicle that yaws to the left, nose down and heeling, without acceleration.
fn felt(inertia: Inertia) -> Inertia {
    let t = inertia.at.since(START).as_secs_f64();
    let attitude: Rot<Level, Sensor> = Rot::from_roll_pitch_yaw(0.1, 0.3, 0.5 + 0.2 * t);
    Inertia {
        attitude,
        rate_radps: attitude.inverse() * Vec3::new(0.0, 0.0, 0.2),
        force_mps2: attitude.inverse() * Vec3::new(0.0, 0.0, 9.81),
        ..inertia
    }
}

#[test]
fn attitude_rates_and_forces_match_the_emulated_motion() {
    for (own, part, each) in [
        ("part = \"imu\"\n", RAW_IMU, 3),
        ("part = \"imu\"\nmessage = \"scaled_imu2\"\n", Part::Imu { message: Some(ImuMessage::Scaled2) }, 3),
        ("part = \"imu\"\nmessage = \"attitude\"\n", Part::Imu { message: None }, 2),
    ] {
        let device = configured(own).unwrap();
        assert_eq!(device.sense(), Sense::Inertial);
        let Emulated::Inertial(mut emulator) = device.emulator(&setup()) else { panic!() };
        let mut decoder = decoder(part);
        let readings = emulated(emulator.as_mut(), &mut decoder, 50, felt);
        assert_eq!(readings.len(), 50 * each);
        // The tolerance is two raw units for rate and force, and the rounding of single precision for angles.
        for decoded in &readings {
            let truth = felt(Inertia::due(decoded.valid_at, DurNs::ZERO));
            match decoded.reading {
                Reading::Attitude(got) => {
                    let [w, x, y, z] = (got.inverse() * truth.attitude).wxyz();
                    assert!(2.0 * math::atan2(math::sqrt(x * x + y * y + z * z), w.abs()) < 1e-6);
                }
                Reading::AngularRate(got) => assert!((got + -truth.rate_radps).norm() < 1e-3),
                Reading::SpecificForce(got) => assert!((got + -truth.force_mps2).norm() < 0.01),
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(decoder.since_boot(), Some(DurNs::from_millis(980)));
    }
}

#[test]
fn pressures_match_the_emulated_pressures_within_half_a_quantum() {
    for (own, message) in
        [("", PressureMessage::Second), ("message = \"scaled_pressure\"\n", PressureMessage::First)]
    {
        let device = configured(&format!("part = \"pressure\"\n{own}")).unwrap();
        assert_eq!(device.sense(), Sense::Depth);
        let Emulated::Depth(mut emulator) = device.emulator(&setup()) else { panic!() };
        let truth_pa = |at: MonoNs| 150_000.0 + 1234.5 * at.since(START).as_secs_f64();
        let mut decoder = decoder(Part::Pressure { message, resolution_pa: 10.0 });
        let readings = emulated(emulator.as_mut(), &mut decoder, 40, |felt: Pressure| Pressure {
            pressure_pa: truth_pa(felt.at),
            ..felt
        });
        assert_eq!(readings.len(), 40);
        for decoded in &readings {
            let Reading::Pressure(water) = decoded.reading else { panic!() };
            assert!((water.pressure_pa - truth_pa(decoded.valid_at)).abs() < 5.02);
            assert!((water.resolution_pa, water.temperature_degc) == (10.0, 10.0));
        }
    }
}

#[test]
fn decoded_distances_match_the_emulated_distances() {
    let own = "part = \"distance\"\norientation = 25\nsensor_id = 3\nsound_speed_mps = 1500\n";
    let device = configured(own).unwrap();
    assert_eq!(device.sense(), Sense::Echosounder);
    let Emulated::Echosounder(mut emulator) = device.emulator(&setup()) else { panic!() };
    let part =
        DistancePart { orientation: Some(25), sensor_id: Some(3), sound_speed_mps: 1500.0, ..DISTANCE };
    let mut decoder = decoder(Part::Distance(part));
    let heard = [Some(2.345), None, Some(0.1), Some(60.0)];
    let soundings = std::cell::Cell::new(0);
    let readings = emulated(emulator.as_mut(), &mut decoder, 4, |sounding: Sounding| {
        soundings.set(soundings.get() + 1);
        Sounding { range_m: heard[soundings.get() - 1], ..sounding }
    });
    let echo = |decoded: &Decoded| match decoded.reading {
        Reading::Echo(echo) => (echo.range_m, echo.confidence, echo.sound_speed_mps),
        other => panic!("{other:?}"),
    };
    let ranges: Vec<_> = readings.iter().map(echo).collect();
    // 2.345 m in the site's water is 2.426 m at the sensor's speed of sound setting.
    assert_eq!(
        ranges,
        [(Some(2.43), 1.0, 1500.0), (None, 0.0, 1500.0), (None, 0.0, 1500.0), (None, 0.0, 1500.0)]
    );
}

#[test]
fn mavlink_axes_are_converted_to_headrace_axes() {
    let attitude = ATTITUDE_DATA {
        time_boot_ms: 1,
        roll: 0.1,
        pitch: 0.2,
        yaw: 0.3,
        rollspeed: 1.0,
        pitchspeed: 2.0,
        yawspeed: 3.0,
    };
    let mut decoder = decoder(Part::Imu { message: None });
    let readings = decode_message(&mut decoder, &Message::Attitude(attitude));
    let Reading::Attitude(attitude) = readings[0] else { panic!() };
    let (roll, pitch, yaw) = attitude.roll_pitch_yaw();
    assert!((roll - 0.1).abs() < 1e-7 && (pitch + 0.2).abs() < 1e-7 && (yaw + 0.3).abs() < 1e-7);
    // Nose up on the wire is nose up in headrace's axes: the body's x axis rises.
    let nose = attitude * Vec3::new(1.0, 0.0, 0.0);
    assert!((nose.z() - 0.198_669).abs() < 1e-6, "{nose:?}");
    assert_eq!(readings[1], Reading::AngularRate(Vec3::new(1.0, -2.0, -3.0)));
}

#[test]
fn each_sensor_kind_uses_only_its_own_mavlink_messages() {
    let line = [RECORDED_ATTITUDE, RECORDED_RAW_IMU, RECORDED_PRESSURE].concat();
    for (part, readings, passed_over) in [
        (RAW_IMU, 3, 1),
        (Part::Imu { message: None }, 2, 2),
        (PRESSURE, 1, 2),
        (Part::Distance(DISTANCE), 0, 3),
    ] {
        let mut decoder = decoder(part);
        assert_eq!(decode(&mut decoder, START, &line).len(), readings, "{part:?}");
        assert_eq!((decoder.passed_over(), decoder.withheld()), (passed_over, 0), "{part:?}");
        assert_eq!(decoder.counts(), CodecCounts { good_frames: 3, ..CodecCounts::default() });
    }
}

#[test]
fn only_the_configured_sender_is_used() {
    for (system_id, component_id, readings) in
        [(Some(1), Some(1), 1), (Some(2), None, 0), (None, Some(2), 0), (None, None, 1)]
    {
        let mut decoder = MavlinkDecoder::new(DecoderSettings {
            part: PRESSURE,
            system_id,
            component_id,
            latency: LATENCY,
        });
        assert_eq!(decode(&mut decoder, START, RECORDED_PRESSURE).len(), readings);
    }
}

#[test]
fn impossible_values_are_withheld() {
    let attitude = |[roll, pitch, yaw]: [f32; 3]| {
        Message::Attitude(ATTITUDE_DATA { roll, pitch, yaw, ..ATTITUDE_DATA::DEFAULT })
    };
    let pressure = |absolute_hpa| {
        let message = PressureMessage::Second;
        Message::Pressure(PressureValues { message, time_boot_ms: 1, absolute_hpa, temperature_cdegc: 0 })
    };
    for (part, message) in [
        (RAW_IMU, attitude([f32::NAN, 0.0, 0.0])),
        (RAW_IMU, attitude([0.0, 1.6, 0.0])),
        (RAW_IMU, attitude([0.0, 0.0, 4.0])),
        (PRESSURE, pressure(0.0)),
        (PRESSURE, pressure(f32::INFINITY)),
    ] {
        let mut decoder = decoder(part);
        assert_eq!(decode_message(&mut decoder, &message), [], "{message:?}");
        assert_eq!(decoder.withheld(), 1, "{message:?}");
    }
}

#[test]
fn distance_confidence_follows_the_sensor_quality() {
    let distance = Distance {
        time_boot_ms: 1,
        least_cm: 20,
        most_cm: 3000,
        distance_cm: 250,
        sensor_id: 0,
        orientation: 25,
        quality_percent: 0,
    };
    let mut decoder = decoder(Part::Distance(DISTANCE));
    let mut echo = |distance| match decode_message(&mut decoder, &Message::Distance(distance))[..] {
        [Reading::Echo(echo)] => Some((echo.range_m, echo.confidence)),
        _ => None,
    };
    assert_eq!(echo(distance), Some((Some(2.5), 0.7)));
    assert_eq!(echo(Distance { quality_percent: 80, ..distance }), Some((Some(2.5), 0.8)));
    assert_eq!(echo(Distance { quality_percent: 1, ..distance }), Some((None, 0.0)));
    assert_eq!(echo(Distance { distance_cm: 3001, ..distance }), Some((None, 0.0)));
    assert_eq!(echo(Distance { distance_cm: 0, least_cm: 0, ..distance }), Some((None, 0.0)));
    assert_eq!(echo(Distance { quality_percent: 101, ..distance }), None);
    assert_eq!(echo(Distance { most_cm: 20, ..distance }), None);
}

#[test]
fn wrong_keys_of_the_vehicle_file_are_named() {
    let error = |own| configured(own).err().unwrap();
    assert_eq!(error("rate_hz = 10\n"), "v.toml:1: part: is missing");
    assert!(error("part = \"gps\"\n").contains("must be one of imu, pressure, distance"));
    assert!(error("part = \"imu\"\nmessage = \"scaled_pressure2\"\n").contains("raw_imu, scaled_imu"));
    assert!(error("part = \"imu\"\norientation = 25\n").contains("is not a key here"));
    assert!(error("part = \"pressure\"\nsystem_id = 0\n").contains("from 1 to 255"));
    assert!(configured("part = \"distance\"\nmin_confidence = 0.2\nunknown_confidence = 0.5\n").is_ok());
}

#[test]
fn anonymising_removes_positions_and_ids_but_keeps_readings() {
    // The removed messages are GLOBAL_POSITION_INT in versions 1 and 2. The message in version 2 is signed.
    let first = [&[0xFE, 28, 0, 1, 1, 33][..], &[7; 28], &[0, 0]].concat();
    let second = [&[0xFD, 20, 1, 0, 0, 1, 1, 33, 0, 0][..], &[7; 20], &[0, 0], &[9; 13]].concat();
    let packet = [&first, RECORDED_ATTITUDE, &second, RECORDED_PRESSURE].concat();
    let mut shorter = Vec::new();
    assert_eq!(without_identity(&packet, &mut shorter), Some(()));
    assert_eq!(shorter, [RECORDED_ATTITUDE, RECORDED_PRESSURE].concat());
    for kept in [RECORDED_ATTITUDE, &packet[..50], &packet[1..]] {
        assert_eq!(without_identity(kept, &mut Vec::new()), None);
    }
    let mut nothing = Vec::new();
    assert_eq!((without_identity(&first, &mut nothing), nothing), (Some(()), Vec::new()));
}

/// Collects the messages that the driver delivers.
#[derive(Default)]
struct Delivered(Vec<u8>);

impl Wire for Delivered {
    fn send(&mut self, _: &[u8]) {}

    fn exchange(&mut self, _: &[u8], _: DurNs, _: usize) {}

    fn deliver(&mut self, _: MonoNs, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }
}

fn pressure_of(system_id: u32, absolute_hpa: f32) -> Vec<u8> {
    let message = PressureMessage::Second;
    let pressure =
        Message::Pressure(PressureValues { message, time_boot_ms: 1, absolute_hpa, temperature_cdegc: 0 });
    pressure.to_frame(MavHeader { system_id, component_id: 1, sequence: 0 }).raw_bytes().to_vec()
}

fn heartbeat_of(system_id: u32, mavtype: MavType, autopilot: MavAutopilot) -> Vec<u8> {
    let heartbeat = HEARTBEAT_DATA { mavtype, autopilot, ..HEARTBEAT_DATA::DEFAULT };
    encode(MavHeader { system_id, component_id: 1, sequence: 0 }, &heartbeat).raw_bytes().to_vec()
}

#[test]
fn only_the_autopilot_received_first_is_used() {
    let autopilot = heartbeat_of(7, MavType::MAV_TYPE_SUBMARINE, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    let station = heartbeat_of(255, MavType::MAV_TYPE_GCS, MavAutopilot::MAV_AUTOPILOT_INVALID);
    let other = heartbeat_of(3, MavType::MAV_TYPE_SUBMARINE, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    for (configured, believed) in [("", 7), ("system_id = 3\n", 3)] {
        let device = configured_part(configured);
        let mut driver = device.driver(&DriverSetup { begun: START, head: None });
        let mut wire = Delivered::default();
        assert!(!driver.accepts(&pressure_of(9, 1000.0)), "{configured}");
        assert!(!driver.accepts(&station), "{configured}");
        assert_eq!(driver.accepts(&autopilot), believed == 7);
        assert!(driver.accepts(&other));
        driver.heard(START, &[station.clone(), pressure_of(9, 900.0)].concat(), &mut wire);
        assert_eq!(wire.0, [], "no system is accepted yet");
        for _ in 0..100 {
            let all = [autopilot.clone(), pressure_of(3, 800.0), pressure_of(7, 1100.0), other.clone()];
            driver.heard(START, &all.concat(), &mut wire);
        }
        let own = pressure_of(believed, if believed == 7 { 1100.0 } else { 800.0 });
        assert_eq!(wire.0, own.repeat(100), "{configured}");
        let health = driver.health();
        assert_eq!(health.strangers.messages(), 202, "{configured}");
        assert_eq!(health.identity.unwrap(), format!("MAVLink system {believed}"));
        let strangers = if believed == 7 { "255, system 9, system 3" } else { "255, system 9, system 7" };
        assert_eq!(health.strangers.words().unwrap(), format!("ignored: system {strangers}"));
    }
}

#[test]
fn log_of_many_systems_gives_the_readings_of_one_system() {
    let autopilot = heartbeat_of(7, MavType::MAV_TYPE_SUBMARINE, MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    for (first, believed) in [(autopilot, 1100.0), (Vec::new(), 800.0)] {
        let mut decoder = decoder(PRESSURE);
        let mut readings = decode(&mut decoder, START, &first);
        for _ in 0..50 {
            let line = [pressure_of(3, 800.0), pressure_of(7, 1100.0)].concat();
            readings.extend(decode(&mut decoder, START, &line));
        }
        assert_eq!((readings.len(), decoder.withheld()), (50, 50));
        for decoded in readings {
            let Reading::Pressure(water) = decoded.reading else { panic!() };
            assert!((water.pressure_pa - believed * 100.0).abs() < 1e-6, "{water:?}");
        }
    }
}

#[test]
fn missing_heartbeat_or_wrong_system_is_reported() {
    for (configured, words) in
        [("", "no autopilot heartbeat"), ("system_id = 3\n", "no messages from system 3")]
    {
        let device = configured_part(configured);
        let mut driver = device.driver(&DriverSetup { begun: START, head: None });
        driver.heard(START, &pressure_of(9, 900.0).repeat(60), &mut Delivered::default());
        assert!(driver.health().complaint.unwrap().contains(words), "{configured}");
        assert_eq!(driver.health().good_frames, 0);
    }
}

fn configured_part(own: &str) -> Box<dyn Device> {
    configured(&format!("part = \"pressure\"\n{own}")).unwrap()
}
