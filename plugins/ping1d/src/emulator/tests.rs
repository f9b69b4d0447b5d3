use headrace_core::app::device::Decoder as _;
use headrace_core::app::reading::{EchoRange, Packet, Reading};
use headrace_core::frames::{Body, Point3, Pose, Rot, Tunnel};
use headrace_core::math::FRAC_PI_2;
use headrace_core::site::Site;

use super::*;
use crate::plugin::PingDecoder;
use crate::settings::tests::settings;

const RADIUS_M: f64 = 4.0;

/// A tube of 4 m radius, in which the vehicle drifts to the left at 0.1 m/s from its axis.
struct Tube {
    site: Site,
}

impl Truth for Tube {
    fn pose(&self, at: MonoNs) -> Pose {
        Pose {
            position: Point3::new(0.0, 0.1 * at.as_secs_f64(), RADIUS_M),
            attitude: Rot::<Tunnel, Body>::identity(),
        }
    }

    /// There is no wall ahead.
    fn range_m(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>) -> Option<f64> {
        let (y, z) = (origin.y(), origin.z() - RADIUS_M);
        let along = y * direction.y() + z * direction.z();
        let range = math::sqrt(along * along + RADIUS_M * RADIUS_M - y * y - z * z) - along;
        (direction.x() < 0.5).then_some(range)
    }

    fn site(&self) -> &Site {
        &self.site
    }
}

/// Sent times and readings with their times, all in ms.
fn run(text: &str, yaw_rad: f64, latency: DurNs) -> (Vec<u64>, Vec<(u64, EchoRange)>) {
    let tube = Tube { site: Site::default() };
    let settings = settings(text).unwrap();
    let rotation = Rot::from_roll_pitch_yaw(0.0, 0.0, yaw_rad);
    let mount = Mount { position: Vec3::new(0.3, 0.2, 0.0), rotation };
    let setup = EmulatorSetup { start: MonoNs(5_000_000), head: None };
    let mut emulator = PingEmulator::new(settings, mount, latency, &setup);
    let mut decoder = PingDecoder::new(settings, latency);
    let (mut sent, mut readings) = (Vec::new(), Vec::new());
    while readings.len() < 100 {
        let due = emulator.due();
        emulator.act(&tube, &mut |direction, at, bytes| {
            assert_eq!(at, due);
            if direction == Direction::Sent {
                sent.push(at.0 / 1_000_000);
                return;
            }
            decoder.decode(Packet { received: at, bytes }, &mut |decoded| match decoded.reading {
                Reading::Echo(echo) => readings.push((decoded.valid_at.0 / 1_000_000, echo)),
                other => panic!("{other:?}"),
            });
        });
    }
    assert_eq!(decoder.counts().bad_frames, 0);
    (sent, readings)
}

#[test]
fn readings_are_the_tube_in_the_devices_millimetres() {
    for device_mps in [1500.0, 1447.0] {
        let text = format!("sound_speed_mps = {device_mps}");
        let (sent, readings) = run(&text, FRAC_PI_2, DurNs::from_millis(20));
        for (k, (at, echo)) in (0..).zip(readings) {
            assert_eq!((at, sent[k]), (5 + 66 * k as u64, at));
            let true_m = RADIUS_M - 0.2 - 0.1 * (at as f64 / 1000.0);
            let expected = true_m * device_mps / 1447.0;
            assert!((echo.range_m.unwrap() - expected).abs() <= 0.000_501, "{echo:?} is not {expected}");
            assert!((echo.confidence, echo.sound_speed_mps) == (1.0, device_mps));
        }
    }
}

#[test]
fn where_there_is_no_wall_there_is_no_range_and_no_confidence() {
    let (_, readings) = run("interval_ms = 100", 0.0, DurNs::ZERO);
    let silent = EchoRange { range_m: None, confidence: 0.0, sound_speed_mps: 1500.0 };
    assert!(readings.iter().all(|(_, echo)| *echo == silent));
}
