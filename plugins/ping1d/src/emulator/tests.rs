use headrace_sensor::device::Decoder as _;
use headrace_sensor::geometry::site::Site;
use headrace_sensor::reading::{EchoRange, Packet, Reading};

use super::*;
use crate::plugin::PingDecoder;
use crate::settings::tests::settings;

/// Runs the emulator; returns the send times of the messages, and the readings with their times, ms.
///
/// `range_m` returns the distance of the wall at a time in seconds.
fn run(
    text: &str,
    range_m: impl Fn(f64) -> Option<f64>,
    latency: DurNs,
) -> (Vec<u64>, Vec<(u64, EchoRange)>) {
    let settings = settings(text).unwrap();
    let setup = EmulatorSetup { start: MonoNs(5_000_000), head: None, site: Site::default(), polled: true };
    let mut emulator = PingEmulator::new(settings, latency, &setup);
    let mut decoder = PingDecoder::new(settings, latency);
    let (mut sent, mut readings, mut due) = (Vec::new(), Vec::new(), Vec::new());
    emulator.begin(setup.start + DurNs(settings.interval.0 * 99 + 1), &mut due);
    assert_eq!(due.len(), 100);
    for sounding in due {
        let heard = Sounding { range_m: range_m(sounding.at.as_secs_f64()), ..sounding };
        emulator.tell(&heard, &mut |direction, at, bytes| {
            if direction == Direction::Sent {
                assert_eq!(at, heard.at);
                sent.push(at.0 / 1_000_000);
                return;
            }
            assert_eq!(at, heard.at + latency);
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
fn distances_are_scaled_by_the_sound_speed_setting_of_the_device() {
    let wall_m = |at_s: f64| 3.8 - 0.1 * at_s;
    for device_mps in [1500.0, 1447.0] {
        let text = format!("sound_speed_mps = {device_mps}");
        let (sent, readings) = run(&text, |at_s| Some(wall_m(at_s)), DurNs::from_millis(20));
        for (k, (at, echo)) in (0..).zip(readings) {
            assert_eq!((at, sent[k]), (5 + 66 * k as u64, at));
            let expected = wall_m(at as f64 / 1000.0) * device_mps / 1447.0;
            assert!((echo.range_m.unwrap() - expected).abs() <= 0.000_501, "{echo:?} is not {expected}");
            assert!((echo.confidence, echo.sound_speed_mps) == (1.0, device_mps));
        }
    }
}

#[test]
fn missing_wall_gives_no_range_and_no_confidence() {
    let (_, readings) = run("interval_ms = 100", |_| None, DurNs::ZERO);
    let silent = EchoRange { range_m: None, confidence: 0.0, sound_speed_mps: 1500.0 };
    assert!(readings.iter().all(|(_, echo)| *echo == silent));
}
