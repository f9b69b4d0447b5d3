use headrace_sensor::device::Decoder as _;
use headrace_sensor::geometry::math::{PI, TAU};
use headrace_sensor::geometry::site::Site;
use headrace_sensor::reading::{Packet, Reading, SonarReturn};

use super::*;
use crate::plugin::HeadDecoder;
use crate::settings::counts_of_rad;
use crate::settings::tests::settings;

/// Radius of the tube in which the head pings, m.
const RADIUS_M: f64 = 4.0;

/// Result of an emulated run: send and receive times of messages, ns, and the readings with their times.
struct Run {
    sent: Vec<u64>,
    received: Vec<u64>,
    readings: Vec<(u64, SonarReturn)>,
}

fn run(text: &str, latency: DurNs, program: HeadProgram, pings: usize) -> Run {
    let settings = settings(text).unwrap();
    let start = MonoNs(7_000_000_000);
    let setup = EmulatorSetup { start, head: Some(program), site: Site::default(), polled: true };
    let mut emulator = HeadEmulator::new(settings.clone(), latency, &setup);
    let mut decoder = HeadDecoder::new(settings.clone(), latency);
    let mut run = Run { sent: Vec::new(), received: Vec::new(), readings: Vec::new() };
    let mut due = Vec::new();
    let last = start + DurNs(settings.ping_period.0 * (pings as i64 - 1));
    // The emulator's `begin` is called twice in this run, and each ping must still be emitted only once.
    emulator.begin(start + DurNs(settings.ping_period.0 / 2), &mut due);
    emulator.begin(last + DurNs(1), &mut due);
    for sounding in due {
        let heard = Sounding { range_m: Some(RADIUS_M), ..sounding };
        emulator.tell(&heard, &mut |direction, at, bytes| {
            if direction == Direction::Sent {
                run.sent.push(at.0);
                return;
            }
            run.received.push(at.0);
            decoder.decode(Packet { received: at, bytes }, &mut |decoded| match decoded.reading {
                Reading::Sonar(sonar) => run.readings.push((decoded.valid_at.0, sonar)),
                other => panic!("{other:?}"),
            });
        });
    }
    assert_eq!(run.received.len(), pings);
    assert_eq!(decoder.counts().bad_frames, 0);
    run
}

fn turning(start_rad: f64, growing: bool) -> HeadProgram {
    HeadProgram { start_rad, growing, sector: None }
}

/// Sensor angles of the readings, in counts of 0.3 degrees.
fn counts(run: &Run) -> Vec<i32> {
    run.readings.iter().map(|(_, sonar)| counts_of_rad(sonar.angle_rad)).collect()
}

#[test]
fn pings_occur_at_the_start_and_once_per_ping_period() {
    let run = run("mode = \"fastest\"", DurNs::from_millis(5), turning(0.0, true), 400);
    for (i, k) in (0..400_u64).enumerate() {
        let ping = 7_000_000_000 + k * 32_000_000;
        assert_eq!((run.sent[i], run.received[i]), (ping, ping + 5_000_000));
        assert_eq!(run.readings[i].0, ping);
    }
}

#[test]
fn readings_are_the_tube_radius_in_device_metres() {
    for returns in ["profile", "imx", "igx"] {
        let text = format!("mode = \"slow\"\nreturns = \"{returns}\"");
        let run = run(&text, DurNs::ZERO, turning(1.0, true), 1200);
        for (_, sonar) in &run.readings {
            let expected = RADIUS_M * 1500.0 / 1447.0;
            assert!((sonar.range_m.unwrap() - expected).abs() <= 0.005, "{sonar:?}");
        }
    }
}

#[test]
fn wall_beyond_the_range_setting_gives_no_echo() {
    let near = run("mode = \"slow\"\nrange_m = 4", DurNs::ZERO, turning(0.0, true), 3);
    assert!(near.readings.iter().all(|(_, sonar)| sonar.range_m.is_none()));
    let fine = run("mode = \"slow\"\nrange_m = 5", DurNs::ZERO, turning(0.0, true), 3);
    assert!(fine.readings.iter().all(|(_, sonar)| sonar.range_m.is_some()));
}

#[test]
fn second_turn_repeats_the_angles_of_the_first_in_either_direction() {
    for (mode, step) in [("slow", 1), ("medium", 2), ("fast", 3), ("faster", 4), ("fastest", 8)] {
        for growing in [true, false] {
            let pings = 1200 / step as usize;
            let text = format!("mode = \"{mode}\"");
            let run = run(&text, DurNs::ZERO, turning(2.0, growing), 2 * pings);
            let got = counts(&run);
            let signed = if growing { step } else { -step };
            for (k, got) in (0..).zip(&got) {
                assert_eq!((got - 382 - k * signed).rem_euclid(1200), 0, "{mode} ping {k}");
            }
            assert_eq!(got[..pings], got[pings..]);
        }
    }
}

#[test]
fn angle_sign_and_offset_do_not_move_the_scan_program_in_the_sensor_frame() {
    let text = "mode = \"fast\"\nangle_sign = \"inverted\"\nangle_offset_deg = 33";
    let run = run(text, DurNs::ZERO, turning(PI / 2.0, true), 50);
    for (k, got) in (0..).zip(counts(&run)) {
        assert_eq!((got - 300 - 3 * k).rem_euclid(1200), 0);
    }
}

fn check_sweep(text: &str, step: i32, least: i32, size: i32, start: i32, growing: bool) {
    let rad = |counts: i32| f64::from(counts) * TAU / 1200.0;
    let program = HeadProgram { start_rad: rad(start), growing, sector: Some((rad(least), rad(size))) };
    let one_way = (size + step - 1) / step;
    let period = 2 * one_way as usize;
    let run = run(text, DurNs::ZERO, program, 3 * period + 1);
    let got: Vec<i32> = counts(&run).iter().map(|count| (count - least).rem_euclid(1200)).collect();
    assert_eq!(got[0], (start - least).rem_euclid(1200));
    assert_eq!(got[..period], got[period..2 * period], "{text}");
    // Each end of the sector is pinged once per sweep, at the turning point.
    let ends = |end: i32| got[..period].iter().filter(|count| **count == end.rem_euclid(1200)).count();
    assert_eq!((ends(0), ends(size)), if size == 1200 { (2, 2) } else { (1, 1) });
    assert!(got.iter().all(|count| *count <= size), "{text}: {got:?}");
    let changes = got.windows(2).map(|pair| (pair[1] - pair[0] + 600).rem_euclid(1200) - 600);
    assert!(changes.into_iter().all(|change| change != 0 && change.abs() <= step));
}

#[test]
fn sector_sweep_pings_each_end_once() {
    for text in ["mode = \"fast\"", "mode = \"fast\"\nangle_sign = \"inverted\"\nangle_offset_deg = 10"] {
        for (least, size) in [(0, 600), (600, 600), (0, 300), (300, 300), (900, 300), (0, 1200)] {
            check_sweep(text, 3, least, size, least, true);
            check_sweep(text, 3, least, size, least + size, false);
        }
    }
}

#[test]
fn step_that_does_not_divide_the_sector_is_shortened_at_the_sector_end() {
    check_sweep("mode = \"fastest\"", 8, 0, 300, 0, true);
    check_sweep("mode = \"fast\"", 3, 400, 400, 800, false);
}

#[test]
fn head_stays_in_its_commanded_sector() {
    let settings = settings("mode = \"fastest\"").unwrap();
    // The sector is 90 degrees wide about 180 degrees: positions 1050 to 150, across the wrap.
    let command = Command { sector_deg: 90.0, train_deg: 180.0, ..settings.command };
    let mut head = Head::new(1046, true);
    let positions: Vec<u16> = (0..79).map(|_| head.obey(&command).position).collect();
    assert_eq!(positions[..3], [1046, 1054, 1062]);
    assert_eq!(positions[20], 6);
    assert_eq!(positions[38..41], [150, 142, 134]);
    assert_eq!(positions[75..79], [1054, 1050, 1058, 1066]);
}

#[test]
fn head_reverses_once_on_command() {
    let settings = settings("mode = \"fast\"").unwrap();
    let mut head = Head::new(600, true);
    let mut ping = |reverse| {
        let ping = head.obey(&Command { reverse, ..settings.command });
        (ping.position, ping.clockwise)
    };
    assert_eq!([ping(false), ping(true), ping(false)], [(600, true), (603, false), (600, false)]);
    assert_eq!([ping(true), ping(false)], [(597, true), (600, true)]);
}

#[test]
fn answer_has_the_position_of_the_head() {
    let settings = settings("mode = \"fast\"").unwrap();
    let setup = EmulatorSetup {
        start: MonoNs(0),
        head: Some(turning(0.0, true)),
        site: Site::default(),
        polled: true,
    };
    let mut emulator = HeadEmulator::new(settings.clone(), DurNs::ZERO, &setup);
    let mut due = Vec::new();
    emulator.begin(MonoNs(1), &mut due);
    let elsewhere = Sounding { reported_rad: f64::to_radians(30.0), ..due[0] };
    let mut decoder = HeadDecoder::new(settings, DurNs::ZERO);
    let mut angles = Vec::new();
    emulator.tell(&elsewhere, &mut |direction, received, bytes| {
        if direction == Direction::Received {
            decoder.decode(Packet { received, bytes }, &mut |decoded| angles.push(decoded.reading));
        }
    });
    assert!(matches!(angles[..], [Reading::Sonar(sonar)] if counts_of_rad(sonar.angle_rad) == 100));
}

#[test]
fn emulator_answers_imported_soundings_without_being_started() {
    let settings = settings("mode = \"fastest\"\nrange_m = 5").unwrap();
    let setup = EmulatorSetup { start: MonoNs(0), head: None, site: Site::default(), polled: true };
    let mut emulator = HeadEmulator::new(settings.clone(), DurNs(0), &setup);
    let mut decoder = HeadDecoder::new(settings, DurNs(0));
    let mut angles = Vec::new();
    for angle_rad in [0.3, -2.0, 3.0] {
        let heard = Sounding { range_m: Some(RADIUS_M), ..Sounding::due(MonoNs(5), angle_rad) };
        emulator.tell(&heard, &mut |direction, received, bytes| {
            if direction == Direction::Received {
                decoder.decode(Packet { received, bytes }, &mut |decoded| match decoded.reading {
                    Reading::Sonar(sonar) => angles.push(counts_of_rad(sonar.angle_rad)),
                    other => panic!("{other:?}"),
                });
            }
        });
    }
    assert_eq!(angles, [0.3, -2.0, 3.0].map(counts_of_rad));
}
