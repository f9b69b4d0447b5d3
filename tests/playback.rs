//! A recorded dive is watched from anywhere: pauses, single ticks, jumps on and back change no result.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    reason = "clippy.toml's leave for tests doesn't reach their helpers"
)]

mod common;
#[path = "common/shipped.rs"]
mod shipped;

use std::io::Write;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::Folder;
use crossbeam::channel::unbounded;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::files_of;
use headrace_replay::playback::{Playback, Watcher, Wish};
use headrace_replay::player::Player;
use headrace_replay::states::States;
use headrace_vehicle::VehicleConfig;
use proptest::prelude::*;

/// Each place where the dive stood: the moment, the tick, the digest, and whether it was the end.
#[derive(Default)]
struct Stood(Vec<(MonoNs, u64, u64, bool)>);

impl Watcher for Stood {
    fn ticked(&mut self, _: &Loop) {}

    fn passed(&mut self, _: &Loop) {}

    fn stands(&mut self, dive: &Loop, at: MonoNs, ended: bool) {
        self.0.push((at, dive.ticks(), dive.digest(), ended));
    }
}

fn vehicle() -> VehicleConfig {
    shipped::scene_from(
        "vehicle = \"vehicle.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 1\nspeed_mps = 0.2\n",
        &|_| Ok(common::VEHICLE.into()),
    )
    .vehicle
}

fn armed(vehicle: &VehicleConfig) -> Loop {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.arm(vehicle.navigation()).unwrap()
}

/// Plays a log by wishes; where it stood, and its digest at the end of what it played.
fn play(folder: &Folder, log: &str, wishes: &[Wish], between: Duration) -> (Stood, u64) {
    let mut dive = armed(&vehicle());
    let mut player = Player::open(&files_of(&[folder.path(log)]).unwrap()).unwrap();
    player.connect(dive.sources());
    let (to_say, said) = unbounded();
    for wish in wishes {
        to_say.send(*wish).unwrap();
    }
    drop(to_say);
    let mut stood = Stood::default();
    let states = States::temporary().unwrap();
    let mut playback = Playback::new(&mut dive, &mut player, states, Pace::default(), between).unwrap();
    playback.play(&said, &mut stood).unwrap();
    assert!(player.losses().is_empty(), "{:?}", player.losses());
    (stood, dive.digest())
}

/// Digest and tick at the end of each tick of a dive that is played through.
fn through(folder: &Folder, log: &str) -> Vec<(MonoNs, u64, u64)> {
    let mut dive = armed(&vehicle());
    let mut player = Player::open(&files_of(&[folder.path(log)]).unwrap()).unwrap();
    player.connect(dive.sources());
    let mut ticks = Vec::new();
    drive(&mut dive, &mut player, Pace::default(), &mut |dive| {
        ticks.push((dive.now(), dive.ticks(), dive.digest()));
    })
    .unwrap();
    ticks
}

/// The dive as a simulation gives it, by log time; as our recorder writes it, by ticks; and so in parts.
fn logs() -> Folder {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "ticks.mcap", &[]);
    std::fs::create_dir(folder.path("parts")).unwrap();
    folder.record("dive.mcap", "parts/dive.mcap", &["--rotate", "5s"]);
    folder
}

#[test]
fn every_jump_lands_in_the_state_of_a_dive_played_through() {
    let folder = logs();
    for log in ["dive.mcap", "ticks.mcap", "parts"] {
        let ticks = through(&folder, log);
        // Before the last two ticks, where a step has no end of its own to stand at.
        let (begun, late) = (ticks[0].0, ticks[ticks.len() - 3].0);
        let span = late.since(begun).0;
        for between in [Duration::from_millis(5), Duration::from_millis(40), Duration::MAX] {
            let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
                cases: 8,
                failure_persistence: None,
                ..ProptestConfig::default()
            });
            let jumps = proptest::collection::vec(0..span, 2..8);
            let result = runner.run(&jumps, |jumps| {
                let mut wishes = vec![Wish::Pause];
                wishes.extend(jumps.iter().flat_map(|to| [Wish::Seek(begun + DurNs(*to)), Wish::Step(1)]));
                wishes.push(Wish::Go);
                let (stood, digest) = play(&folder, log, &wishes, between);
                for (at, tick, digest, _) in &stood.0[1..] {
                    let expected = ticks.iter().find(|(now, ..)| now == at);
                    prop_assert_eq!(expected, Some(&(*at, *tick, *digest)));
                }
                prop_assert_eq!(stood.0.len(), 2 + 2 * jumps.len());
                prop_assert_eq!(stood.0[stood.0.len() - 1].3, true);
                prop_assert_eq!(digest, ticks[ticks.len() - 1].2);
                Ok(())
            });
            result.unwrap_or_else(|why| panic!("{log}, {between:?} between states: {why}"));
        }
    }
}

#[test]
fn at_the_end_it_stands_until_it_is_sent_back() {
    let folder = logs();
    let ticks = through(&folder, "ticks.mcap");
    let [begun, before, last] = [0, ticks.len() - 2, ticks.len() - 1].map(|number| ticks[number]);
    let beyond = last.0 + DurNs(5_000_000_000);
    let wishes = [
        Wish::Pause,
        Wish::Seek(before.0),
        Wish::Step(1),
        Wish::Step(1),
        Wish::Seek(beyond),
        Wish::Step(2),
        Wish::Seek(begun.0),
        Wish::Go,
    ];
    let (stood, digest) = play(&folder, "ticks.mcap", &wishes, Duration::from_millis(5));
    let at = |(at, tick, digest): (MonoNs, u64, u64), ended| (at, tick, digest, ended);
    // Each time that it comes to the end, or is sent on from there.
    let expected = [
        at(before, false),
        at(last, false),
        at(last, true),
        at(last, true),
        at(last, false),
        at(last, true),
        at(last, true),
        at(begun, false),
        at(last, true),
    ];
    assert_eq!(stood.0[1..], expected);
    assert_eq!(digest, last.2);
}

#[test]
fn a_replay_from_the_middle_gives_the_whole_dive_s_report() {
    let folder = logs();
    let (code, whole) = folder.replay("ticks.mcap", &[]);
    assert_eq!(code, Some(0));
    // The first makes the states, the second begins with them.
    for _ in 0..2 {
        let (code, later) = folder.replay("ticks.mcap", &["--from", "0:15"]);
        assert_eq!(code, Some(0));
        assert_eq!(later, whole);
        let (code, in_parts) = folder.replay("parts", &["--from", "0:15"]);
        assert_eq!((code, &in_parts["digest"]), (Some(0), &whole["digest"]));
        assert_eq!(in_parts["log"]["messages"], whole["log"]["messages"]);
    }
    assert!(folder.path("parts.states").exists());
    let states = folder.read("ticks.mcap.states");
    assert!(states.starts_with(b"headrace states\n"));
    // With another target they are another dive's, and are made anew.
    let (_, other) = folder.replay("ticks.mcap", &["--target", "0.7"]);
    assert_eq!(folder.replay("ticks.mcap", &["--target", "0.7", "--from", "15s"]).1, other);
    assert_ne!(folder.read("ticks.mcap.states"), states);
    // A file that is cut goes as far as it goes; one that is damaged is named; another kind of file stays as it is.
    let states = folder.read("ticks.mcap.states");
    folder.write("ticks.mcap.states", &states[..states.len() * 2 / 3]);
    assert_eq!(folder.replay("ticks.mcap", &["--target", "0.7", "--from", "15s"]).1, other);
    folder.write("ticks.mcap.states", "somebody's notes");
    let answer = folder.headrace(&["replay", "ticks.mcap", "--from", "15s"]);
    assert_eq!(answer.code, Some(0));
    assert!(answer.stderr.contains("it is another kind of file, and stays as it is"), "{}", answer.stderr);
    assert_eq!(folder.read("ticks.mcap.states"), b"somebody's notes");
}

#[test]
fn lines_on_standard_input_pause_step_and_seek() {
    let folder = logs();
    let mut program = Command::new(env!("CARGO_BIN_EXE_headrace"))
        .args(["replay", "ticks.mcap", "--speed", "1x", "--interactive"])
        .current_dir(folder.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = "pause\nseek 12s\nstep 3\nback 5s\nstop\nahead 0:02\nspeed max\ngo\n";
    program.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let answer = program.wait_with_output().unwrap();
    let (stdout, stderr) = (String::from_utf8_lossy(&answer.stdout), String::from_utf8_lossy(&answer.stderr));
    assert_eq!(answer.status.code(), Some(0), "{stderr}");
    let stood: Vec<&str> = stdout
        .lines()
        .filter_map(|line| line.strip_prefix("AT       "))
        .map(|line| line.split(": tick").next().unwrap())
        .collect();
    assert_eq!(
        stood[1..],
        ["0:00:12.000", "0:00:12.060", "0:00:07.060", "0:00:09.060", "0:00:20.020, the end"]
    );
    insta::assert_snapshot!(stderr, @r#"headrace: "stop" isn't understood; there are pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end"#);
    let whole = folder.replay("ticks.mcap", &[]).1;
    let digest = whole["digest"].as_str().unwrap();
    assert!(stdout.contains(&format!("digest {digest}")), "{stdout}");
}
