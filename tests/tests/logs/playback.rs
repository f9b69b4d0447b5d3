//! Playback of a recorded dive: pauses, single ticks and seeks change no result and suppress no loss.

use std::io::Write;
use std::process::{Output, Stdio};
use std::time::Duration;

use crossbeam::channel::unbounded;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::run::Loop;
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::{LogHeader, LogWriter, SourceInfo, files_of};
use headrace_replay::playback::{Playback, PlaybackCommand, PlaybackObserver};
use headrace_replay::player::Player;
use headrace_replay::snapshot_store::SnapshotStore;
use headrace_tests::Folder;
use headrace_tests::scenes;
use headrace_vehicle::VehicleConfig;
use proptest::prelude::*;
use serde_json::Value;

/// Records each stop of a playback: time, tick number, digest, and whether playback was at the end of the log.
#[derive(Default)]
struct Stops(Vec<(MonoNs, u64, u64, bool)>);

impl PlaybackObserver for Stops {
    fn after_tick(&mut self, _: &Loop) {}

    fn after_skipped_tick(&mut self, _: &Loop) {}

    fn stopped(&mut self, dive: &Loop, at: MonoNs, ended: bool) {
        self.0.push((at, dive.ticks(), dive.view().digest(), ended));
    }
}

fn vehicle() -> VehicleConfig {
    scenes::scene_from(
        "vehicle = \"vehicle.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 1\nspeed_mps = 0.2\n",
        &|_| Ok(headrace_tests::VEHICLE.into()),
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

/// Result of a replayed dive.
#[derive(Debug, PartialEq)]
struct Outcome {
    digest: u64,
    messages: u64,
    losses: Vec<String>,
}

impl Outcome {
    fn of(dive: &Loop, player: &Player) -> Self {
        Self { digest: dive.view().digest(), messages: player.played(), losses: player.losses() }
    }
}

/// A headrace log replays its packets in the order in which the live loop consumed them, which can differ from the
/// order of their receive times. A log without ticks replays in time order.
#[test]
fn headrace_logs_replay_in_recorded_order_but_other_logs_in_order_of_time() {
    let folder = Folder::new();
    // Source and receive time of each packet, in the order in which the packets are recorded.
    let recorded = [(2, 3_000), (0, 1_000), (1, 2_000), (1, 2_500), (0, 2_200)];
    for (ticks, wanted) in [(true, [2, 0, 1, 1, 0]), (false, [0, 1, 0, 1, 2])] {
        let mut app = App::new(vehicle().mission());
        for sensor in vehicle().sensors.iter().take(3) {
            app.add_device(sensor.as_ref()).unwrap();
        }
        let mut dive = app.arm(vehicle().navigation()).unwrap();
        let named = |id: &str| SourceInfo { id: id.to_owned(), ..SourceInfo::default() };
        let sources = dive.sources().iter().map(|source| named(&source.id)).collect();
        let header = LogHeader { sources, ticks, ..LogHeader::default() };
        let mut log = LogWriter::new(Vec::new(), &header).unwrap();
        for (source, at) in recorded {
            log.raw(source, MonoNs(at), MonoNs(at), &[]).unwrap();
        }
        if ticks {
            log.tick(0, MonoNs(4_000), &recorded.map(|(source, _)| source)).unwrap();
        }
        let (bytes, _) = log.finish().unwrap();
        folder.write("order.mcap", bytes);
        let mut player = Player::open(&files_of(&[folder.path("order.mcap")]).unwrap()).unwrap();
        player.connect(dive.sources());
        // Source of each packet, in the order in which the loop consumes the packets.
        let mut consumed = Vec::new();
        let mut note =
            |dive: &Loop| consumed.extend(dive.view().placed().inbox.iter().map(|(source, _)| source.0));
        drive(&mut dive, &mut player, Pace::default(), &mut note).unwrap();
        assert_eq!(consumed, wanted, "ticks: {ticks}");
    }
}

/// Plays a log with these commands. Playback makes a snapshot after each `interval` of computing time. Returns the
/// stops and the result.
fn play(folder: &Folder, log: &str, commands: &[PlaybackCommand], interval: Duration) -> (Stops, Outcome) {
    let mut dive = armed(&vehicle());
    let mut player = Player::open(&files_of(&[folder.path(log)]).unwrap()).unwrap();
    player.connect(dive.sources());
    let (sender, receiver) = unbounded();
    for command in commands {
        sender.send(*command).unwrap();
    }
    drop(sender);
    let mut stops = Stops::default();
    let store = SnapshotStore::new(64 << 20, interval);
    let mut playback = Playback::new(&mut dive, &mut player, store, Pace::default()).unwrap();
    playback.play(&receiver, &mut stops).unwrap();
    (stops, Outcome::of(&dive, &player))
}

/// Replays a log from start to end without stops. Returns time, tick number and digest after each tick, and the result.
fn through(folder: &Folder, log: &str) -> (Vec<(MonoNs, u64, u64)>, Outcome) {
    let mut dive = armed(&vehicle());
    let mut player = Player::open(&files_of(&[folder.path(log)]).unwrap()).unwrap();
    player.connect(dive.sources());
    let mut ticks = Vec::new();
    drive(&mut dive, &mut player, Pace::default(), &mut |dive| {
        ticks.push((dive.now(), dive.ticks(), dive.view().digest()));
    })
    .unwrap();
    (ticks, Outcome::of(&dive, &player))
}

/// A folder with logs of one dive in three forms: written by the simulator (replayed by time), by the recorder
/// (replayed by ticks), and by the recorder in several parts.
fn logs() -> Folder {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "ticks.mcap", &[]);
    std::fs::create_dir(folder.path("parts")).unwrap();
    folder.record("dive.mcap", "parts/dive.mcap", &["--rotate", "5s"]);
    folder
}

#[test]
fn every_seek_reaches_the_state_of_a_straight_replay() {
    let folder = logs();
    for log in ["dive.mcap", "ticks.mcap", "parts"] {
        let (ticks, outcome) = through(&folder, log);
        assert!(outcome.losses.is_empty(), "{:?}", outcome.losses);
        // Seeks end before the last two ticks, because a single step from one of the last ticks reaches the end of the
        // log.
        let (begun, late) = (ticks[0].0, ticks[ticks.len() - 3].0);
        let span = late.since(begun).0;
        for interval in [Duration::from_millis(5), Duration::from_millis(40), Duration::MAX] {
            let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
                cases: 8,
                failure_persistence: None,
                ..ProptestConfig::default()
            });
            let jumps = proptest::collection::vec(0..span, 2..8);
            let result = runner.run(&jumps, |jumps| {
                let mut commands = vec![PlaybackCommand::Pause];
                let jump = |to: &i64| [PlaybackCommand::Seek(begun + DurNs(*to)), PlaybackCommand::Step(1)];
                commands.extend(jumps.iter().flat_map(jump));
                commands.push(PlaybackCommand::Go);
                let (stops, ended) = play(&folder, log, &commands, interval);
                for (at, tick, digest, _) in &stops.0[1..] {
                    let expected = ticks.iter().find(|(now, ..)| now == at);
                    prop_assert_eq!(expected, Some(&(*at, *tick, *digest)));
                }
                prop_assert_eq!(stops.0.len(), 2 + 2 * jumps.len());
                prop_assert_eq!(stops.0[stops.0.len() - 1].3, true);
                prop_assert_eq!(&ended, &outcome);
                Ok(())
            });
            result.unwrap_or_else(|why| panic!("{log}, a snapshot each {interval:?}: {why}"));
        }
    }
}

#[test]
fn playback_waits_at_the_end_for_a_seek() {
    let folder = logs();
    let (ticks, outcome) = through(&folder, "ticks.mcap");
    let [begun, before, last] = [0, ticks.len() - 2, ticks.len() - 1].map(|number| ticks[number]);
    let beyond = last.0 + DurNs(5_000_000_000);
    let commands = [
        PlaybackCommand::Pause,
        PlaybackCommand::Seek(before.0),
        PlaybackCommand::Step(1),
        PlaybackCommand::Step(1),
        PlaybackCommand::Seek(beyond),
        PlaybackCommand::Step(2),
        PlaybackCommand::Seek(begun.0),
        PlaybackCommand::Go,
    ];
    let (stops, ended) = play(&folder, "ticks.mcap", &commands, Duration::from_millis(5));
    let at = |(at, tick, digest): (MonoNs, u64, u64), ended| (at, tick, digest, ended);
    // Playback stops each time it reaches the end of the log, and each time it is resumed there.
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
    assert_eq!(stops.0[1..], expected);
    assert_eq!(ended, outcome);
}

/// Damages one byte in each of three chunks of a log. Two of these chunks are adjacent and in the middle of the log.
/// The third chunk comes later.
fn damage(folder: &Folder, log: &str) {
    let mut bytes = folder.read(log);
    let mut chunks = Vec::new();
    let mut at = mcap::MAGIC.len();
    while at + 9 <= bytes.len() - mcap::MAGIC.len() {
        if bytes[at] == mcap::records::op::CHUNK {
            chunks.push(at);
        }
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap());
        at += 9 + usize::try_from(len).unwrap();
    }
    for number in [chunks.len() / 2, chunks.len() / 2 + 1, chunks.len() * 3 / 4] {
        // The damaged byte lies after the chunk's header.
        bytes[chunks[number] + 100] ^= 0x55;
    }
    folder.write(log, bytes);
}

#[test]
fn seeking_over_damage_reports_the_same_losses_as_a_straight_replay() {
    let folder = logs();
    damage(&folder, "dive.mcap");
    damage(&folder, "ticks.mcap");
    damage(&folder, "parts/dive.part002.mcap");
    damage(&folder, "parts/dive.part003.mcap");
    for log in ["dive.mcap", "ticks.mcap", "parts"] {
        let (ticks, outcome) = through(&folder, log);
        assert_eq!(outcome.losses.len(), if log == "parts" { 6 } else { 3 }, "{log}: {:?}", outcome.losses);
        let at = |share: usize| PlaybackCommand::Seek(ticks[(ticks.len() - 1) * share / 100].0);
        for interval in [Duration::from_millis(5), Duration::MAX] {
            // The seeks lead to the end of the log, to a time before the damage, to a snapshot after the damage, and
            // between the damaged places.
            for jumps in [&[95, 10][..], &[100, 20, 90, 10], &[60, 5, 58, 96, 56]] {
                let mut commands = vec![PlaybackCommand::Pause];
                commands.extend(jumps.iter().map(|share| at(*share)));
                commands.push(PlaybackCommand::Go);
                let (_, ended) = play(&folder, log, &commands, interval);
                assert_eq!(ended, outcome, "{log}, a snapshot each {interval:?}, jumps to {jumps:?} %");
            }
        }
    }
    // The report and the exit code must also be the same as for a replay without pauses and seeks.
    for log in ["ticks.mcap", "parts"] {
        let (code, straight) = folder.replay(log, &[]);
        assert_eq!(code, Some(3));
        let lines = "pause\nseek 18s\nback 16s\nahead 15s\nseek 1s\ngo\n";
        let answer = interactive(&folder, &[log, "--json"], lines);
        assert_eq!(answer.status.code(), Some(3), "{}", String::from_utf8_lossy(&answer.stderr));
        let report: serde_json::Value = serde_json::from_slice(&answer.stdout).unwrap();
        assert_eq!(report, straight, "{log}");
    }
}

#[test]
fn damage_seen_before_seeking_back_is_reported_at_the_end() {
    let folder = logs();
    damage(&folder, "ticks.mcap");
    let losses = |lines: &str| {
        let answer = interactive(&folder, &["ticks.mcap", "--json"], lines);
        let report: serde_json::Value = serde_json::from_slice(&answer.stdout).unwrap();
        (answer.status.code(), report["log"]["losses"].clone())
    };
    let all = folder.replay("ticks.mcap", &[]).1["log"]["losses"].clone();
    assert_eq!(all.as_array().unwrap().len(), 3);
    for lines in [
        "pause\nseek 19s\nseek 1s\nend\n",
        "pause\nseek 19s\nback 18s\nahead 3s\nend\n",
        "pause\nseek 1h\nback 10s\nback 1h\nend\n",
        "pause\nseek 19s\nseek 1s\ngo\n",
    ] {
        // Only the number of losses is compared, because their times may be known more exactly after the whole log has
        // been read.
        let (code, listed) = losses(lines);
        assert_eq!((code, listed.as_array().unwrap().len()), (Some(3), 3), "{lines}: {listed}");
    }
}

#[test]
fn replay_started_in_the_middle_reports_the_whole_dive() {
    let folder = logs();
    let (code, whole) = folder.replay("ticks.mcap", &[]);
    assert_eq!(code, Some(0));
    let (code, later) = folder.replay("ticks.mcap", &["--from", "0:15"]);
    assert_eq!(code, Some(0));
    assert_eq!(later, whole);
    let (code, in_parts) = folder.replay("parts", &["--from", "0:15"]);
    assert_eq!((code, &in_parts["digest"]), (Some(0), &whole["digest"]));
    assert_eq!(in_parts["log"]["messages"], whole["log"]["messages"]);
}

/// Runs `replay --interactive` with `lines` on standard input.
fn interactive(folder: &Folder, arguments: &[&str], lines: &str) -> Output {
    let mut program = headrace_tests::program()
        .args(["replay", "--interactive"])
        .args(arguments)
        .current_dir(folder.path("."))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    program.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    program.wait_with_output().unwrap()
}

/// Targets other than the first one are judged in a second replay of the whole log. A replay that was stopped covers
/// less of the dive, so figures for the first target aren't comparable with figures for other targets.
#[test]
fn stopped_replay_reports_the_first_target_only() {
    let folder = logs();
    let arguments = ["ticks.mcap", "--speed", "1x", "--target", "0.5,0.3", "--report", "left.json"];
    let answer = interactive(&folder, &arguments, "pause\nseek 12s\nend\n");
    let report: Value = serde_json::from_slice(&folder.read("left.json")).unwrap();
    assert_eq!(report["other_targets"], serde_json::json!([]));
    let said = String::from_utf8_lossy(&answer.stderr);
    assert!(said.contains("the replay was stopped before the end of the log"), "{said}");
}

#[test]
fn commands_on_standard_input_pause_step_and_seek() {
    let folder = logs();
    let lines = "pause\nseek 12s\nstep 3\nback 5s\nstop\nahead 0:02\nspeed max\ngo\n";
    let answer = interactive(&folder, &["ticks.mcap", "--speed", "1x"], lines);
    let (stdout, stderr) = (String::from_utf8_lossy(&answer.stdout), String::from_utf8_lossy(&answer.stderr));
    assert_eq!(answer.status.code(), Some(0), "{stderr}");
    let stops: Vec<&str> = stdout
        .lines()
        .filter_map(|line| line.strip_prefix("AT       "))
        .map(|line| line.split(": tick").next().unwrap())
        .collect();
    assert_eq!(
        stops[1..],
        ["0:00:12.000", "0:00:12.060", "0:00:07.060", "0:00:09.060", "0:00:20.020  (end)"]
    );
    insta::assert_snapshot!(stderr, @r#"headrace: "stop" isn't a command; expected one of: pause, go, step [TICKS], seek TIME, ahead TIME, back TIME, speed N|max, end or quit"#);
    assert!(stdout.contains(" samples, target "), "{stdout}");
}
