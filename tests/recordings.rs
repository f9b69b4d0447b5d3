//! val: recorded dives of other vehicles through our decoders. Ping360 frames and Imagenex 852 logs are read in the tests
//! of their crates (`ping1d`, `imagenex881`).
//!
//! `small.tlog` is 263 s of a BlueROV2 with ArduSub at the surface, in waves (ardusub_log_tools, MIT), in `../shared/data`;
//! the test is skipped where that is absent. With `--nocapture` it prints counts and ranges. What is expected was found by
//! another reader of the same file, written from the definitions in another language.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

use headrace_geometry::frames::{Rot, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_mavlink::decoder::{MavlinkDecoder, Meaning, Part};
use headrace_mavlink::message::{ImuMessage, PressureMessage};
use headrace_mavlink::tlog::Tlog;
use headrace_sensor::device::Decoder as _;
use headrace_sensor::reading::{Decoded, Packet, Reading};

const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/bluerov2_ardusub_logs/small.tlog");

const FRAMES: u64 = 35_916;
/// Frames of the camera (component 100) whose checksum fits no definition.
const BAD: u64 = 4;

fn recording() -> Option<Vec<u8>> {
    let file = std::fs::read(FILE).ok();
    if file.is_none() {
        eprintln!("skipped: {FILE} not there");
    }
    file
}

/// What a part says in the whole recording, and its decoder.
fn readings(file: &[u8], part: Part) -> (Vec<Decoded>, MavlinkDecoder) {
    let meaning = Meaning { part, system_id: Some(1), component_id: Some(1), latency: DurNs::ZERO };
    let (mut decoder, mut readings, mut first_us) = (MavlinkDecoder::new(meaning), Vec::new(), None);
    for logged in Tlog::new(file) {
        let logged = logged.unwrap();
        let since_us = logged.utc_us - *first_us.get_or_insert(logged.utc_us);
        let packet = Packet { received: MonoNs(1_000_000_000 + since_us * 1000), bytes: logged.frame };
        decoder.decode(packet, &mut |decoded| readings.push(decoded));
    }
    let counts = decoder.counts();
    assert_eq!((counts.good_frames, decoder.withheld()), (FRAMES - BAD, 0));
    // A bad frame may hold more than one byte that could begin one.
    assert!(counts.bad_frames >= BAD && counts.bad_frames <= 2 * BAD, "{counts:?}");
    (readings, decoder)
}

/// Smallest, largest and mean.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64, f64) {
    let (mut least, mut most, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for value in values {
        (least, most) = (f64::min(least, value), f64::max(most, value));
        (sum, count) = (sum + value, count + 1.0);
    }
    (least, most, sum / count)
}

#[test]
fn a_bluerovs_attitude_rates_and_forces_are_read() {
    let Some(file) = recording() else { return };
    let (readings, decoder) = readings(&file, Part::Imu { message: Some(ImuMessage::Raw) });
    let (mut attitudes, mut rates, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for decoded in &readings {
        match decoded.reading {
            Reading::Attitude(attitude) => attitudes.push((decoded.valid_at, attitude)),
            Reading::AngularRate(rate) => rates.push(rate),
            Reading::SpecificForce(force) => forces.push((decoded.valid_at, force)),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!((attitudes.len(), rates.len(), forces.len()), (5245, 528, 528));
    let degrees = |of: fn((f64, f64, f64)) -> f64| {
        spread(attitudes.iter().map(|(_, attitude)| of(attitude.roll_pitch_yaw()).to_degrees()))
    };
    let (roll, pitch, yaw) = (degrees(|it| it.0), degrees(|it| it.1), degrees(|it| it.2));
    let gravity = spread(forces.iter().map(|(_, force)| force.norm()));
    println!("attitudes {}, rates and forces {}", attitudes.len(), forces.len());
    println!("roll {roll:.3?}, pitch {pitch:.3?}, yaw {yaw:.3?} degrees; least, most, mean");
    println!("specific force {gravity:.4?} m/s^2, autopilot's clock {:?}", decoder.since_boot());
    let near = |got: f64, wanted_rad: f64| assert!((got - wanted_rad.to_degrees()).abs() < 1e-3, "{got}");
    // Pitch and yaw the other way round than the autopilot's.
    near(roll.0, -0.067_955);
    near(roll.1, -0.000_952);
    near(pitch.0, -0.055_919);
    near(pitch.1, 0.053_024);
    near(yaw.0, 2.074_750);
    near(yaw.1, 2.915_102);
    assert!((gravity.2 - 0.999_963 * 9.806_65).abs() < 1e-4, "{gravity:?}");
    assert!(rates.iter().all(|rate| rate.norm() < 0.2));
    let up = spread(forces.iter().map(|(at, force)| up(&attitudes, *at, *force)));
    println!("angle between the force and up {up:.3?} degrees");
    assert!(up.1 < 6.0 && up.2 < 2.0, "{up:?}");
}

/// The angle between a force and up by the attitude last told before it, degrees: small for a vehicle that hardly moves,
/// and only if both have their axes right.
fn up(
    attitudes: &[(MonoNs, Rot<headrace_sensor::reading::Level, headrace_geometry::frames::Sensor>)],
    at: MonoNs,
    force: Vec3<headrace_geometry::frames::Sensor>,
) -> f64 {
    let before = attitudes.partition_point(|(told, _)| *told <= at).max(1) - 1;
    let level = attitudes[before].1 * force;
    headrace_geometry::math::acos((level.z() / level.norm()).clamp(-1.0, 1.0)).to_degrees()
}

#[test]
fn a_bluerovs_pressures_are_read() {
    let Some(file) = recording() else { return };
    let parts = [(PressureMessage::Second, 635), (PressureMessage::First, 528), (PressureMessage::Third, 0)];
    for (message, count) in parts {
        let (readings, decoder) = readings(&file, Part::Pressure { message, resolution_pa: 10.0 });
        let water: Vec<_> = readings
            .iter()
            .map(|decoded| match decoded.reading {
                Reading::Pressure(water) => water,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!((water.len(), decoder.passed_over()), (count, FRAMES - BAD - count as u64));
        if water.is_empty() {
            continue;
        }
        let pressure = spread(water.iter().map(|water| water.pressure_pa));
        let temperature = spread(water.iter().map(|water| water.temperature_degc));
        println!("{message:?}: {count} pressures {pressure:.1?} Pa, {temperature:.2?} degrees Celsius");
        // At the surface: half a metre of water and the weather, no more.
        assert!(pressure.0 > 100_000.0 && pressure.1 < 102_000.0, "{pressure:?}");
        if message == PressureMessage::Second {
            assert!((pressure.0 - 101_540.0).abs() < 0.1 && (pressure.1 - 101_800.0).abs() < 0.1);
            assert!((temperature.0 - 12.45).abs() < 1e-9 && (temperature.1 - 12.60).abs() < 1e-9);
        }
    }
}
