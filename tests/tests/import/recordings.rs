//! Validation: headrace's decoders read recorded dives of other vehicles.
//!
//! `small.tlog` is a dive of a BlueROV2 with ArduSub at the surface, in waves (`recordings/bluerov2_ardusub_logs`). The
//! copy in this repository has the first 40 s. If `HEADRACE_RECORDINGS` is set, all 263 s are also read. With
//! `--nocapture` the tests print counts and ranges. Expected values come from `oracles/tlog.py`, another reader of the
//! same files. The crates `ping1d` and `imagenex881` test Ping360 frames and Imagenex 852 logs.

use std::path::{Path, PathBuf};

use headrace_geometry::frames::{Rot, Vec3};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_mavlink::decoder::{DecoderSettings, MavlinkDecoder, Part};
use headrace_mavlink::message::{ImuMessage, PressureMessage};
use headrace_mavlink::tlog::Tlog;
use headrace_sensor::device::Decoder as _;
use headrace_sensor::reading::{Decoded, Packet, Reading};
use headrace_tests::recordings;

/// Number of camera frames (component 100) with a checksum that matches no definition.
const BAD: u64 = 4;

/// Expected values of a file, from `oracles/tlog.py`. Pairs are minimum and maximum. Angles are in radians with the
/// autopilot's signs.
struct Wanted {
    frames: u64,
    attitudes: usize,
    roll: [f64; 2],
    pitch: [f64; 2],
    yaw: [f64; 2],
    /// Number of accelerometer readings (specific force). The gyros and the first pressure sensor have the same number
    /// of readings.
    forces: usize,
    mean_force_g: f64,
    /// Number of readings of the second pressure sensor.
    pressures: usize,
    pressure_hpa: [f64; 2],
    temperature_degc: [f64; 2],
}

const TRIMMED: Wanted = Wanted {
    frames: 6499,
    attitudes: 776,
    roll: [-0.054_222, -0.013_537],
    pitch: [-0.051_882, 0.055_919],
    yaw: [-2.378_987, -2.132_199],
    forces: 81,
    mean_force_g: 0.999_947,
    pressures: 188,
    pressure_hpa: [1015.4, 1016.5],
    temperature_degc: [12.45, 12.48],
};

const FULL_LENGTH: Wanted = Wanted {
    frames: 35_916,
    attitudes: 5245,
    roll: [-0.067_955, -0.000_952],
    pitch: [-0.053_024, 0.055_919],
    yaw: [-2.915_102, -2.074_750],
    forces: 528,
    mean_force_g: 0.999_963,
    pressures: 635,
    pressure_hpa: [1015.4, 1018.0],
    temperature_degc: [12.45, 12.60],
};

fn both() -> Vec<(PathBuf, Wanted)> {
    recordings::both("bluerov2_ardusub_logs/small.tlog", TRIMMED, FULL_LENGTH)
}

/// Decodes a whole telemetry file for one sensor of the autopilot. Returns the readings and the decoder.
fn readings(path: &Path, frames: u64, part: Part) -> (Vec<Decoded>, MavlinkDecoder) {
    let file = std::fs::read(path).unwrap();
    let meaning = DecoderSettings { part, system_id: Some(1), component_id: Some(1), latency: DurNs::ZERO };
    let (mut decoder, mut readings, mut first_us) = (MavlinkDecoder::new(meaning), Vec::new(), None);
    for logged in Tlog::new(&file) {
        let logged = logged.unwrap();
        let since_us = logged.utc_us - *first_us.get_or_insert(logged.utc_us);
        let packet = Packet { received: MonoNs(1_000_000_000 + since_us * 1000), bytes: logged.frame };
        decoder.decode(packet, &mut |decoded| readings.push(decoded));
    }
    let counts = decoder.counts();
    assert_eq!((counts.good_frames, decoder.withheld()), (frames - BAD, 0));
    // A bad frame may count twice, because a byte inside it may look like the start of another frame.
    assert!(counts.bad_frames >= BAD && counts.bad_frames <= 2 * BAD, "{counts:?}");
    (readings, decoder)
}

/// Smallest value, largest value and mean of the values.
fn spread(values: impl Iterator<Item = f64>) -> (f64, f64, f64) {
    let (mut least, mut most, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for value in values {
        (least, most) = (f64::min(least, value), f64::max(most, value));
        (sum, count) = (sum + value, count + 1.0);
    }
    (least, most, sum / count)
}

#[test]
fn bluerov_attitude_rates_and_forces_are_read() {
    for (path, wanted) in both() {
        check_imu(&path, &wanted);
    }
}

fn check_imu(path: &Path, wanted: &Wanted) {
    let (readings, decoder) = readings(path, wanted.frames, Part::Imu { message: Some(ImuMessage::Raw) });
    let (mut attitudes, mut rates, mut forces) = (Vec::new(), Vec::new(), Vec::new());
    for decoded in &readings {
        match decoded.reading {
            Reading::Attitude(attitude) => attitudes.push((decoded.valid_at, attitude)),
            Reading::AngularRate(rate) => rates.push(rate),
            Reading::SpecificForce(force) => forces.push((decoded.valid_at, force)),
            other => panic!("{other:?}"),
        }
    }
    let counts = (attitudes.len(), rates.len(), forces.len());
    assert_eq!(counts, (wanted.attitudes, wanted.forces, wanted.forces));
    let radians = |of: fn((f64, f64, f64)) -> f64| {
        spread(attitudes.iter().map(|(_, attitude)| of(attitude.roll_pitch_yaw())))
    };
    let (roll, pitch, yaw) = (radians(|it| it.0), radians(|it| it.1), radians(|it| it.2));
    let gravity = spread(forces.iter().map(|(_, force)| force.norm()));
    println!("attitudes {}, rates and forces {}", attitudes.len(), forces.len());
    println!("roll {roll:.4?}, pitch {pitch:.4?}, yaw {yaw:.4?} rad; least, most, mean");
    println!("specific force {gravity:.4?} m/s^2, autopilot's clock {:?}", decoder.since_boot());
    let near = |got: (f64, f64, f64), [least, most]: [f64; 2]| {
        assert!((got.0 - least).abs() < 1e-5 && (got.1 - most).abs() < 1e-5, "{got:?}");
    };
    near(roll, wanted.roll);
    // headrace's pitch and yaw have the opposite sign of the autopilot's pitch and yaw.
    let reversed = |[least, most]: [f64; 2]| [-most, -least];
    near(pitch, reversed(wanted.pitch));
    near(yaw, reversed(wanted.yaw));
    assert!((gravity.2 - wanted.mean_force_g * 9.806_65).abs() < 1e-4, "{gravity:?}");
    assert!(rates.iter().all(|rate| rate.norm() < 0.2));
    let up = spread(forces.iter().map(|(at, force)| up(&attitudes, *at, *force)));
    println!("angle between the force and up {up:.3?} degrees");
    assert!(up.1 < 6.0 && up.2 < 2.0, "{up:?}");
}

/// Angle between the measured force and the upward direction, which follows from the latest attitude, degrees.
///
/// While the vehicle hardly moves, this angle is small if the axes of both measurements are right.
fn up(
    attitudes: &[(MonoNs, Rot<headrace_sensor::reading::Level, headrace_geometry::frames::Sensor>)],
    at: MonoNs,
    force: Vec3<headrace_geometry::frames::Sensor>,
) -> f64 {
    let before = attitudes.partition_point(|(measured_at, _)| *measured_at <= at).max(1) - 1;
    let level = attitudes[before].1 * force;
    headrace_geometry::math::acos((level.z() / level.norm()).clamp(-1.0, 1.0)).to_degrees()
}

#[test]
fn bluerov_pressures_are_read() {
    for (path, wanted) in both() {
        check_pressures(&path, &wanted);
    }
}

fn check_pressures(path: &Path, wanted: &Wanted) {
    let parts = [
        (PressureMessage::Second, wanted.pressures),
        (PressureMessage::First, wanted.forces),
        (PressureMessage::Third, 0),
    ];
    for (message, count) in parts {
        let (readings, decoder) =
            readings(path, wanted.frames, Part::Pressure { message, resolution_pa: 10.0 });
        let water: Vec<_> = readings
            .iter()
            .map(|decoded| match decoded.reading {
                Reading::Pressure(water) => water,
                other => panic!("{other:?}"),
            })
            .collect();
        assert_eq!((water.len(), decoder.passed_over()), (count, wanted.frames - BAD - count as u64));
        if water.is_empty() {
            continue;
        }
        let pressure = spread(water.iter().map(|water| water.pressure_pa));
        let temperature = spread(water.iter().map(|water| water.temperature_degc));
        println!("{message:?}: {count} pressures {pressure:.1?} Pa, {temperature:.2?} degrees Celsius");
        // The vehicle is at the surface, so the pressure differs from the standard atmosphere only by the weather and
        // half a metre of water.
        assert!(pressure.0 > 100_000.0 && pressure.1 < 102_000.0, "{pressure:?}");
        if message == PressureMessage::Second {
            let [least, most] = wanted.pressure_hpa.map(|hpa| 100.0 * hpa);
            assert!((pressure.0 - least).abs() < 0.1 && (pressure.1 - most).abs() < 0.1);
            let [least, most] = wanted.temperature_degc;
            assert!((temperature.0 - least).abs() < 1e-9 && (temperature.1 - most).abs() < 1e-9);
        }
    }
}
