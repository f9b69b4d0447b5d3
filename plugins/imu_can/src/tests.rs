//! Tests the path from a vehicle file's table to an inertial unit's readings, through the emulated unit.

use headrace_sensor::SensorConfig;
use headrace_sensor::config::Document;
use headrace_sensor::device::{Decoder as _, Device, DeviceKind as _, Direction, Emulated, EmulatorSetup};
use headrace_sensor::geometry::frames::{Body, Mount, Rot, Sensor, Vec3};
use headrace_sensor::geometry::math;
use headrace_sensor::geometry::site::Site;
use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::measurement::Inertia;
use headrace_sensor::reading::{Decoded, Level, Packet, Reading};

use crate::ImuCanKind;
use crate::codec::{Message, MessageSet};
use crate::decoder::{AxisOrder, DecoderSettings, ImuDecoder};
use crate::sets::{bosch, j1939, sbg, xsens};

/// A vehicle that rotates at constant rates about its x axis and about the vertical.
#[derive(Clone, Copy)]
struct Going {
    roll_radps: f64,
    yaw_radps: f64,
}

const GRAVITY_MPS2: f64 = 9.81;

impl Going {
    fn new(roll_radps: f64, yaw_radps: f64) -> Self {
        Self { roll_radps, yaw_radps }
    }

    fn body(&self, at: MonoNs) -> Rot<Level, Body> {
        let t = at.as_secs_f64();
        Rot::from_roll_pitch_yaw(self.roll_radps * t, 0.1, 0.4 + self.yaw_radps * t)
    }

    fn attitude(&self, at: MonoNs) -> Rot<Level, Sensor> {
        self.body(at) * sensor().mount.rotation
    }

    /// Inertial measurement of the vehicle's unit. The vehicle doesn't accelerate.
    fn felt(&self, inertia: Inertia) -> Inertia {
        let yaw = self.body(inertia.at).inverse() * Vec3::<Level>::new(0.0, 0.0, self.yaw_radps);
        let body = yaw + Vec3::new(self.roll_radps, 0.0, 0.0);
        let attitude = self.attitude(inertia.at);
        Inertia {
            attitude,
            rate_radps: sensor().mount.rotation.inverse() * body,
            force_mps2: attitude.inverse() * Vec3::new(0.0, 0.0, GRAVITY_MPS2),
            ..inertia
        }
    }
}

fn sensor() -> SensorConfig {
    SensorConfig {
        id: "imu".to_owned(),
        plugin: "imu_can".to_owned(),
        connect: "can:can0".to_owned(),
        mount: Mount {
            position: Vec3::new(0.5, 0.1, 0.0),
            rotation: Rot::from_roll_pitch_yaw(0.02, -0.03, 1.5),
        },
        latency: DurNs::from_millis(3),
    }
}

fn configured(own: &str) -> Result<Box<dyn Device>, String> {
    let root = Document::new("v.toml", own).root().unwrap();
    let device = ImuCanKind.configure(&sensor(), &root).map_err(|error| error.to_string())?;
    root.finish().map_err(|error| error.to_string())?;
    assert_eq!(device.specification().sensor, sensor());
    Ok(device)
}

fn meaning(set: MessageSet) -> DecoderSettings {
    DecoderSettings {
        set,
        axis_order: AxisOrder::Yxz,
        sample_time_tick: DurNs(100_000),
        latency: DurNs::from_millis(3),
    }
}

const XSENS: MessageSet = MessageSet::Xsens(xsens::Ids { base: None });
const J1939: MessageSet = MessageSet::J1939(j1939::Network { source_address: None });

/// Encodes messages as frames, and decodes these into readings.
fn readings(decoder: &mut ImuDecoder, set: MessageSet, messages: &[Message]) -> Vec<Decoded> {
    let mut readings = Vec::new();
    for message in messages {
        let bytes = set.encode(message).unwrap().encode();
        let packet = Packet { received: MonoNs(1_000_000_000), bytes: &bytes };
        decoder.decode(packet, &mut |decoded| readings.push(decoded));
    }
    readings
}

/// Readings decoded from `samples` samples of the emulated unit, whose motion is `truth`.
fn emulated(own: &str, decoder: &mut ImuDecoder, truth: &Going, samples: usize) -> Vec<Decoded> {
    let start = MonoNs(2_000_000_000);
    let setup = EmulatorSetup { start, head: None, site: Site::default(), polled: true };
    let Emulated::Inertial(mut emulator) = configured(own).unwrap().emulator(&setup) else {
        panic!("no inertial unit")
    };
    let (mut readings, mut due, mut until) = (Vec::new(), Vec::new(), start);
    while due.len() < samples {
        until = until + DurNs::from_millis(3);
        emulator.begin(until, &mut due);
    }
    due.truncate(samples);
    for inertia in due {
        emulator.tell(&truth.felt(inertia), &mut |direction, received, bytes| {
            assert_eq!(direction, Direction::Received);
            decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded));
        });
    }
    assert_eq!(decoder.counts().bad_frames, 0);
    assert_eq!((decoder.passed_over(), decoder.withheld()), (0, 0));
    readings
}

/// Compares every reading with the unit's true motion. The tolerance of a rate or force is the size of one raw unit on
/// the wire.
fn check(readings: &[Decoded], truth: &Going, rate_quantum: f64, force_quantum: f64) {
    for decoded in readings {
        let felt = truth.felt(Inertia::due(decoded.valid_at, DurNs::ZERO));
        match decoded.reading {
            Reading::Attitude(got) => {
                let [w, x, y, z] = (got.inverse() * felt.attitude).wxyz();
                let error = 2.0 * math::atan2(math::sqrt(x * x + y * y + z * z), w.abs());
                assert!(error < 1e-4, "{error} rad");
            }
            Reading::AngularRate(got) => {
                let error = (got + -felt.rate_radps).norm();
                assert!(error < rate_quantum, "{error} rad/s");
            }
            Reading::SpecificForce(got) => {
                let error = (got + -felt.force_mps2).norm();
                assert!(error < force_quantum, "{error} m/s^2");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn readings_of_an_emulated_xsens_unit_match_its_motion() {
    for (roll, yaw) in [(0.0, 0.0), (0.0, 0.2), (0.3, 0.0)] {
        let truth = Going::new(roll, yaw);
        let mut decoder = ImuDecoder::new(meaning(XSENS));
        let readings = emulated("preset = \"xsens_mti600\"\n", &mut decoder, &truth, 500);
        assert_eq!(readings.len(), 1500);
        assert_eq!(readings[0].valid_at, MonoNs(2_000_000_000));
        check(&readings, &truth, 1.0 / 512.0, 1.0 / 256.0);
        assert_eq!(decoder.sample_time(), Some(DurNs::from_millis(4990)));
    }
}

#[test]
fn unit_at_rest_gives_zero_rate_and_constant_readings() {
    let truth = Going::new(0.0, 0.0);
    let mut decoder = ImuDecoder::new(meaning(XSENS));
    let readings = emulated("preset = \"xsens_mti600\"\n", &mut decoder, &truth, 500);
    for decoded in &readings[3..] {
        match decoded.reading {
            Reading::AngularRate(rate) => assert_eq!(rate, Vec3::zero()),
            _ => assert!(readings[..3].iter().any(|first| first.reading == decoded.reading)),
        }
    }
}

#[test]
fn readings_of_an_emulated_sbg_unit_match_its_motion_in_headrace_axes() {
    let truth = Going::new(0.1, 0.0);
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Sbg));
    let readings = emulated("preset = \"sbg_ellipse\"\nrate_hz = 50\n", &mut decoder, &truth, 200);
    assert_eq!(readings.len(), 600);
    check(&readings, &truth, 1e-3, 1e-2);
}

#[test]
fn readings_of_an_emulated_j1939_unit_match_its_motion_in_either_axis_order() {
    for (key, axis_order) in [("yxz", AxisOrder::Yxz), ("xyz", AxisOrder::Xyz)] {
        let truth = Going::new(0.0, 0.0);
        let mut decoder = ImuDecoder::new(DecoderSettings { axis_order, ..meaning(J1939) });
        let own = format!("preset = \"j1939\"\naxis_order = \"{key}\"\n");
        let readings = emulated(&own, &mut decoder, &truth, 100);
        assert_eq!(readings.len(), 200);
        check(&readings, &truth, 1.0_f64.to_radians() / 128.0, 0.01);
    }
}

#[test]
fn emulated_bosch_unit_gives_force_only() {
    let truth = Going::new(0.0, 0.0);
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Bosch));
    let readings = emulated("preset = \"bosch_mm5\"\n", &mut decoder, &truth, 100);
    assert_eq!(readings.len(), 100);
    check(&readings, &truth, 0.0, 0.002);
}

#[test]
fn invalid_attitude_is_withheld() {
    let mut decoder = ImuDecoder::new(meaning(XSENS));
    let quaternion = xsens::Message::Quaternion([32_767, 0, 0, 0]);
    let rate = xsens::Message::RateOfTurn([512, 0, 0]);
    let status = |bits| xsens::Message::StatusWord(xsens::StatusWord(bits));
    let messages = [
        quaternion,
        status(0b01),
        quaternion,
        rate,
        status(0b10),
        quaternion,
        xsens::Message::Quaternion([0; 4]),
        xsens::Message::GroupCounter(7),
    ]
    .map(Message::Xsens);
    let got = readings(&mut decoder, XSENS, &messages);
    let attitude = Reading::Attitude(Rot::identity());
    let expected = [attitude, Reading::AngularRate(Vec3::new(1.0, 0.0, 0.0)), attitude];
    assert_eq!(got.iter().map(|decoded| decoded.reading).collect::<Vec<_>>(), expected);
    assert_eq!(decoder.withheld(), 2);
    assert_eq!(got[0].valid_at, MonoNs(997_000_000));
    assert_eq!(decoder.group(), Some(7));
}

#[test]
fn frames_of_other_devices_are_ignored() {
    let mut decoder = ImuDecoder::new(meaning(XSENS));
    let other = Message::Sbg(sbg::Message::Rate([0; 3]));
    assert_eq!(readings(&mut decoder, MessageSet::Sbg, &[other, other]), []);
    assert_eq!((decoder.passed_over(), decoder.withheld(), decoder.counts().good_frames), (2, 0, 2));
}

#[test]
fn euler_angles_are_used_only_without_quaternions() {
    let mut decoder = ImuDecoder::new(meaning(XSENS));
    let euler = Message::Xsens(xsens::Message::EulerAngles([1600, -416, -11_520]));
    let quaternion = Message::Xsens(xsens::Message::Quaternion([32_767, 0, 0, 0]));
    let got = readings(&mut decoder, XSENS, &[euler, quaternion, euler]);
    assert_eq!(got.len(), 2);
    let Reading::Attitude(attitude) = got[0].reading else { panic!() };
    let (roll, pitch, yaw) = attitude.roll_pitch_yaw();
    let deg = [roll, pitch, yaw].map(f64::to_degrees);
    for (got, expected) in deg.iter().zip([12.5, -3.25, -90.0]) {
        assert!((got - expected).abs() < 1e-9, "{deg:?}");
    }
}

#[test]
fn sbg_at_rest_has_upward_force_and_yaw_grows_to_the_left() {
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Sbg));
    // At rest the device's z axis, which points down, reads -9.81. A heading of -1.5 rad is nearly west, to the left of
    // north.
    let messages = [sbg::Message::Acceleration([0, 0, -981]), sbg::Message::Euler([0, 1000, -15_000])];
    let got = readings(&mut decoder, MessageSet::Sbg, &messages.map(Message::Sbg));
    let Reading::SpecificForce(force) = got[0].reading else { panic!() };
    assert!((force.z() - 9.81).abs() < 1e-9);
    let Reading::Attitude(attitude) = got[1].reading else { panic!() };
    let (roll, pitch, yaw) = attitude.roll_pitch_yaw();
    assert!(roll.abs() < 1e-9 && (pitch + 0.1).abs() < 1e-9 && (yaw - 1.5).abs() < 1e-9);
}

#[test]
fn invalid_j1939_values_are_withheld() {
    let mut decoder = ImuDecoder::new(meaning(J1939));
    let triple = |raw, figures, latency| j1939::Triple { raw, figures, latency };
    let level = [32_000, 32_000, 32_981];
    let messages = [
        j1939::Message::Acceleration(triple(level, 0, 5)),
        j1939::Message::Acceleration(triple([32_000, 0xFE00, 32_000], 0, 5)),
        j1939::Message::Acceleration(triple(level, 0b10_00_00, 5)),
        j1939::Message::AngularRate(triple([32_128, 32_000, 32_000], 0b11_11_11, 0xFF)),
    ];
    let got = readings(&mut decoder, J1939, &messages.map(Message::J1939));
    assert_eq!((got.len(), decoder.withheld()), (2, 2));
    assert_eq!(got[0].valid_at, MonoNs(1_000_000_000 - 3_000_000 - 2_500_000));
    assert_eq!(got[1].valid_at, MonoNs(1_000_000_000 - 3_000_000));
    // The first rate on the wire is the pitch rate, which turns about y.
    let Reading::AngularRate(rate) = got[1].reading else { panic!() };
    assert_eq!(rate, Vec3::new(0.0, 1.0_f64.to_radians(), 0.0));
}

#[test]
fn bosch_force_is_reported_when_its_last_component_arrives() {
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Bosch));
    let (rate, force) = (bosch::RawRate::nearest(0.0), bosch::RawAcceleration::nearest(1.0));
    let messages = [
        bosch::Message::Yaw(rate, force),
        bosch::Message::Roll(rate, force),
        bosch::Message::Yaw(rate, force),
        bosch::Message::Vertical(force),
        bosch::Message::Vertical(force),
    ];
    let got = readings(&mut decoder, MessageSet::Bosch, &messages.map(Message::Bosch));
    assert_eq!(got.len(), 1);
}

#[test]
fn wrong_keys_of_the_vehicle_file_are_named() {
    let error = |own| configured(own).err().unwrap();
    assert_eq!(error("rate_hz = 100\n"), "v.toml:1: preset: is missing");
    assert!(error("preset = \"vectornav\"\n").contains("xsens_mti600, sbg_ellipse, j1939, bosch_mm5"));
    assert!(error("preset = \"xsens_mti600\"\nid_base = 0x19FF0021\n").contains("must end in 00"));
    assert!(error("preset = \"sbg_ellipse\"\nid_base = 0\n").contains("is not a key here"));
    assert!(configured("preset = \"xsens_mti600\"\nid_base = 0x19FF0000\n").is_ok());
    assert!(configured("preset = \"j1939\"\nsource_address = 0xE2\n").is_ok());
}

#[test]
fn sbg_values_with_bad_status_are_withheld() {
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Sbg));
    let info = |status| sbg::Message::ImuInfo { time_us: 0, status: sbg::ImuStatus(status), temperature: 0 };
    let samples = [sbg::Message::Acceleration([0; 3]), sbg::Message::Rate([0; 3])];
    assert_eq!(readings(&mut decoder, MessageSet::Sbg, &samples.map(Message::Sbg)).len(), 2);
    // The checked bits are the accelerometer bits, the gyro bits and the response bit. The overall test bit combines
    // other bits and isn't checked.
    for (bit, expected) in [(0, 0), (1, 2), (2, 1), (4, 1), (5, 1), (7, 1), (8, 1), (9, 1), (10, 2)] {
        let messages = [info(0x3FF & !(1 << bit)), samples[0], samples[1]].map(Message::Sbg);
        assert_eq!(readings(&mut decoder, MessageSet::Sbg, &messages).len(), expected, "bit {bit}");
    }
    assert_eq!(decoder.withheld(), 8);
}

#[test]
fn only_the_first_received_kind_of_sbg_time_is_followed() {
    let mut decoder = ImuDecoder::new(meaning(MessageSet::Sbg));
    assert_eq!(decoder.clock(), None);
    let info = |time_us| sbg::Message::ImuInfo { time_us, status: sbg::ALL_WELL, temperature: 0 };
    let messages = [sbg::Message::EkfTime(5000), info(1), sbg::Message::EkfTime(6000), info(900)];
    readings(&mut decoder, MessageSet::Sbg, &messages.map(Message::Sbg));
    let clock = decoder.clock().unwrap();
    assert_eq!((clock.stamps, clock.restarts), (2, 0));
}

#[test]
fn emulated_unit_sends_no_unmeasured_values() {
    let setup = EmulatorSetup { start: MonoNs(0), head: None, site: Site::default(), polled: true };
    for (own, set, whole, without) in [
        ("preset = \"xsens_mti600\"", XSENS, 4, 3),
        ("preset = \"sbg_ellipse\"", MessageSet::Sbg, 4, 3),
        ("preset = \"j1939\"", J1939, 3, 2),
    ] {
        let Emulated::Inertial(mut emulator) = configured(own).unwrap().emulator(&setup) else {
            panic!("no inertial unit")
        };
        let mut felt = Inertia::due(MonoNs(0), DurNs::ZERO);
        let mut decoded_of = |felt: &Inertia| {
            let (mut decoder, mut readings, mut frames) = (ImuDecoder::new(meaning(set)), Vec::new(), 0);
            emulator.tell(felt, &mut |_, received, bytes| {
                frames += 1;
                decoder.decode(Packet { received, bytes }, &mut |decoded| readings.push(decoded.reading));
            });
            (frames, readings)
        };
        assert_eq!(decoded_of(&felt).0, whole, "{own}");
        felt.attitude = Rot::from_roll_pitch_yaw(f64::NAN, f64::NAN, f64::NAN);
        let (frames, readings) = decoded_of(&felt);
        assert_eq!(frames, without, "{own}");
        assert!(
            matches!(readings[..], [Reading::AngularRate(_), Reading::SpecificForce(_)])
                || matches!(readings[..], [Reading::SpecificForce(_), Reading::AngularRate(_)]),
            "{readings:?}"
        );
        felt.rate_radps = Vec3::new(0.0, f64::NAN, 0.0);
        assert!(matches!(decoded_of(&felt).1[..], [Reading::SpecificForce(_)]), "{own}");
    }
}
