//! Impossible timestamps, and clock jumps of several years.

use headrace_tests::{Folder, VEHICLE, raw_messages, write_log};
use mcap::WriteOptions;

use crate::run::{Ran, run};

const DAY_NS: u64 = 24 * 3600 * 1_000_000_000;

/// Commands of the program that read a dive log.
const READING: [&[&str]; 7] = [
    &["replay", "odd.mcap"],
    &["replay", "odd.mcap", "--smooth"],
    &["replay", "odd.mcap", "--from", "5s"],
    &["replay", "odd.mcap", "--from", "2777h"],
    &["verify", "odd.mcap"],
    &["trim", "odd.mcap", "-o", "trimmed.mcap", "--force", "--from", "2s", "--to", "2777h"],
    &["recover", "odd.mcap", "-o", "recovered.mcap", "--force"],
];

/// Function that computes a message's new timestamp from the message's number and old timestamp.
type Stamp<'a> = &'a dyn Fn(u64, u64) -> u64;

/// Writes a copy of the short dive's log, with timestamps from `stamp`.
fn odd(folder: &Folder, stamp: impl Fn(u64, u64) -> u64) {
    let dive = folder.read("dive.mcap");
    let mut messages = raw_messages(&dive);
    for (number, message) in (0..).zip(&mut messages) {
        message.log_time = stamp(number, message.log_time);
    }
    write_log(&folder.path("odd.mcap"), WriteOptions::new(), Some(VEHICLE), &messages);
}

/// Runs all commands and returns their results. Every command must end.
fn all(folder: &Folder) -> Vec<Ran> {
    READING.iter().map(|arguments| run(folder, arguments)).collect()
}

fn losses(ran: &Ran) -> Vec<&str> {
    let lines = ran.stdout.lines().filter_map(|line| {
        line.split_once("LOST: ").or_else(|| line.split_once("lost     ")).map(|(_, loss)| loss)
    });
    lines.collect()
}

#[test]
fn messages_with_impossible_times_are_skipped_and_reported() {
    let folder = Folder::with_dive();
    for last in [u64::MAX, u64::MAX - 1, i64::MAX as u64 + 1] {
        odd(&folder, |number, at| if number == 4000 { last } else { at });
        for (arguments, ran) in READING.iter().zip(all(&folder)) {
            let code = if arguments.contains(&"verify") { 1 } else { 3 };
            assert_eq!(ran.code, Some(code), "{arguments:?}: {} {}", ran.stdout, ran.stderr);
            if !arguments.contains(&"trim") {
                let is_reported =
                    losses(&ran).iter().any(|loss| loss.contains(&format!("1 messages stamped {last} ns")));
                assert!(is_reported, "{arguments:?}: {}", ran.stdout);
            }
        }
    }
    // In these logs, every message has an impossible time.
    for stamp in [u64::MAX, i64::MAX as u64, 0] {
        odd(&folder, |_, _| stamp);
        let codes: Vec<_> = all(&folder).iter().map(|ran| ran.code).collect();
        let (lost, verified) = if stamp == u64::MAX { (Some(3), Some(1)) } else { (Some(1), Some(1)) };
        assert_eq!((codes[0], codes[4]), (lost, verified), "{stamp}");
    }
}

#[test]
fn clock_jumps_cause_no_wait() {
    let folder = Folder::with_dive();
    let year = 364 * DAY_NS;
    let jumps: [(&str, Stamp<'_>, Option<i32>); 6] = [
        ("ahead a year", &|number, at| if number > 4000 { at + year } else { at }, Some(0)),
        ("to and fro", &|number, at| at + number / 1000 % 2 * year, Some(0)),
        ("another clock", &|number, at| if number % 3 == 0 { at + 100 * year } else { at }, Some(3)),
        ("stairs", &|number, at| at + number / 100 * year, Some(0)),
        ("zeros between", &|number, at| if number % 10 == 3 { 0 } else { at }, Some(0)),
        ("both ends", &|number, _| number % 2 * u64::MAX, Some(3)),
    ];
    for (what, stamp, code) in jumps {
        odd(&folder, stamp);
        let ran = all(&folder);
        let took: Vec<_> = ran.iter().map(|ran| (ran.code, (ran.took_s * 1e3).round())).collect();
        println!("{what}: {took:?} ms");
        if code == Some(3) {
            assert_eq!(ran[0].code, code, "{what}: {}", ran[0].stdout);
            assert!(!losses(&ran[0]).is_empty(), "{what}: {}", ran[0].stdout);
        }
        assert!(ran.iter().all(|ran| ran.most_mib < 200), "{what}");
    }
}
