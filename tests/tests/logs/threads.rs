//! Replays on several threads, and loops that share a navigation, give the same ticks as one thread, bit for bit.
//!
//! This also applies if the feed ends with an error or by a panic.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bevy_ecs::prelude::{Res, ResMut, Resource};
use headrace_geometry::time::DurNs;
use headrace_monitor::merge::{Inbox, MAX_TICK_BYTES};
use headrace_monitor::outlet::Outlet;
use headrace_monitor::report::Report;
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_monitor::stage::PlaceStage;
use headrace_monitor::view::DiveView;
use headrace_monitor::{App, Plugin, PluginError};
use headrace_replay::drive::{Coming, DriveError, Pace, PacketSource, drive};
use headrace_replay::log::LogError;
use headrace_replay::threads::{drive_on, drive_together};
use headrace_sensor::reading::SourceId;
use headrace_simulator::Scene;
use headrace_tests::{Folder, scenes};
use headrace_vehicle::VehicleConfig;
use serde_json::Value;

use crate::snapshots::{EFFECTS, LEGS, Packet, packets};

const THREADS: [usize; 3] = [1, 2, 3];

/// End of the test's feed of packets: normal, with an error, or by a panic.
#[derive(Clone, Copy, PartialEq)]
enum End {
    /// The feed ends regularly after its last packet.
    Last,
    /// The feed ends with an error at this packet.
    Error(usize),
    /// The feed ends by a panic at this packet.
    Panic(usize),
}

struct Feed {
    packets: Vec<Packet>,
    next: usize,
    end: End,
}

impl PacketSource for Feed {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        assert!(self.end != End::Panic(self.next), "the feed breaks here");
        if self.end == End::Error(self.next) {
            return Err(LogError::Open {
                path: "dive.mcap".into(),
                source: std::io::Error::other("it broke"),
            });
        }
        let coming = |packet: &Packet| Coming {
            at: packet.at,
            source: SourceId(u16::try_from(packet.source).unwrap()),
            len: packet.bytes.len(),
        };
        Ok(self.packets.get(self.next).map(coming))
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        let packet = &self.packets[self.next];
        port.send(packet.at, &packet.bytes)?;
        self.next += 1;
        Ok(())
    }
}

/// A scene with four heads and back-and-forth motion, in which an operator gives commands. Sections fail, some fails
/// become final, and later passes clear them.
fn scene() -> Scene {
    scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{LEGS}{EFFECTS}"))
}

fn armed(vehicle: &VehicleConfig, plugin: Option<&dyn Plugin>) -> Loop {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.keep_results();
    if let Some(plugin) = plugin {
        app.add_plugin(plugin).unwrap();
    }
    app.arm(vehicle.navigation()).unwrap()
}

/// Hash of all data that a loop publishes in a tick.
fn of_tick(dive: &Loop) -> u64 {
    let mut hasher = DefaultHasher::new();
    let inbox = &dive.view().placed().inbox;
    inbox.iter().for_each(|(source, packet)| (source.0, packet.received.0, packet.bytes).hash(&mut hasher));
    for (name, stream) in dive.view().streams() {
        (name, stream.value(), stream.words(), stream.records(), stream.lost()).hash(&mut hasher);
    }
    let heard = (dive.view().readings(), dive.view().health(), dive.view().vehicle(), dive.view().tally());
    let alerts: Vec<_> = dive.view().alert_list().iter().collect();
    let results = (dive.view().notices().collect::<Vec<_>>(), dive.view().live_state(), alerts);
    let console = dive.view().console_counts();
    (dive.ticks(), dive.now().0, format!("{heard:?} {results:?} {console:?}")).hash(&mut hasher);
    hasher.finish()
}

/// Result of a dive on some number of threads: each tick's hash, the error at the end, the report and the final state.
#[derive(PartialEq)]
struct Dived {
    ticks: Vec<u64>,
    error: Option<String>,
    report: Value,
    state: Vec<u8>,
}

fn dived(threads: usize, scene: &Scene, tick_ms: i64, packets: &[Packet], end: End) -> Dived {
    let mut dive = armed(&scene.vehicle, None);
    let mut feed = Feed { packets: packets.to_vec(), next: 0, end };
    let (mut ticks, tick) = (Vec::new(), DurNs::from_millis(tick_ms));
    let mut note = |dive: &Loop| ticks.push(of_tick(dive));
    let driven = match threads {
        // For zero threads, the function `drive` runs the dive. Its result is the reference for `drive_on`.
        0 => drive(&mut dive, &mut feed, Pace { tick, speed: None }, &mut note),
        threads => drive_on(threads, &mut dive, &mut feed, tick, &mut note),
    };
    let error = driven.err().map(|error| error.to_string());
    let (report, state) = ended(&mut dive);
    Dived { ticks, error, report, state }
}

/// Saves the state, and then finishes the dive. Returns report and state.
fn ended(dive: &mut Loop) -> (Value, Vec<u8>) {
    let state = dive.save().unwrap();
    dive.finish(&mut |_, _| ());
    (serde_json::to_value(Report::of(dive)).unwrap(), state)
}

fn same(one: &Dived, other: &Dived, what: &str) {
    let parts = one.ticks.iter().zip(&other.ticks).position(|(one, other)| one != other);
    assert_eq!(parts, None, "{what}: first tick that differs");
    assert_eq!(one.ticks.len(), other.ticks.len(), "{what}: ticks");
    assert_eq!(one.error, other.error, "{what}");
    assert_eq!(one.report, other.report, "{what}");
    assert!(one.state == other.state, "{what}: the final states differ");
}

#[test]
fn number_of_threads_does_not_change_any_tick() {
    let scene = scene();
    let packets = packets(&scene);
    for tick_ms in [20, 777] {
        let one = dived(0, &scene, tick_ms, &packets, End::Last);
        assert!(one.report["dive"]["samples_valid"].as_u64().unwrap() > 1000, "{}", one.report["dive"]);
        assert!(one.ticks.len() > 50 && one.error.is_none());
        for threads in THREADS {
            let other = dived(threads, &scene, tick_ms, &packets, End::Last);
            same(&one, &other, &format!("{threads} threads, ticks of {tick_ms} ms"));
        }
    }
}

#[test]
fn failing_feed_ends_the_dive_at_the_same_tick_on_any_number_of_threads() {
    let scene = scene();
    let packets = packets(&scene);
    for at in [0, 1, packets.len() / 3, packets.len() - 1] {
        let one = dived(0, &scene, 20, &packets, End::Error(at));
        assert!(one.error.is_some());
        for threads in THREADS {
            let other = dived(threads, &scene, 20, &packets, End::Error(at));
            same(&one, &other, &format!("{threads} threads, an error at packet {at}"));
        }
    }
}

#[test]
fn panicking_thread_gives_an_error_and_does_not_block_the_loop() {
    let scene = scene();
    let packets = packets(&scene);
    for (threads, at) in [(2, 0), (2, 5000), (3, 5000)] {
        let mut feed = Feed { packets: packets.clone(), next: 0, end: End::Panic(at) };
        let mut dive = armed(&scene.vehicle, None);
        let driven = drive_on(threads, &mut dive, &mut feed, DurNs::from_millis(20), &mut |_| ());
        let words = driven.unwrap_err().to_string();
        assert!(
            words.contains("reads and places pings") && words.contains("the feed breaks here"),
            "{words}"
        );
    }
    // If the caller's function panics, the panic must be passed on to the caller, and all threads must end.
    let mut feed = Feed { packets, next: 0, end: End::Last };
    let mut dive = armed(&scene.vehicle, None);
    let caught = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        drive_on(3, &mut dive, &mut feed, DurNs::from_millis(20), &mut |dive| assert!(dive.ticks() < 50))
    }));
    assert!(caught.is_err());
}

/// An outlet that falls behind at times. Whenever it does, the loop must hold packets back.
#[derive(Clone, Default)]
struct Behind(Arc<AtomicU64>);

impl Plugin for Behind {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.add_outlet(self.clone());
        Ok(())
    }
}

impl Outlet for Behind {
    fn publish(&mut self, _: &DiveView<'_>) -> usize {
        let ticks = self.0.fetch_add(1, Ordering::Relaxed) + 1;
        if ticks.is_multiple_of(16) { 0 } else { MAX_TICK_BYTES }
    }
}

/// A plugin that adds a system to the placer, which is the part of the loop that places pings. It counts the packets
/// that the system sees.
struct Placing;

#[derive(Resource, Default)]
struct Seen(usize);

impl Plugin for Placing {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.placer.insert_resource(Seen::default());
        app.placer.add_systems_after(PlaceStage::Decode, see);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "systems take their parameters by value")]
fn see(inbox: Res<'_, Inbox>, mut seen: ResMut<'_, Seen>) {
    seen.0 += inbox.len();
}

#[test]
fn slow_output_plugin_changes_no_result() {
    let scene = scene();
    let packets = packets(&scene);
    let expected = dived(0, &scene, 20, &packets, End::Last).report;
    for threads in THREADS {
        let run = |plugin: &dyn Plugin| {
            let mut dive = armed(&scene.vehicle, Some(plugin));
            let mut feed = Feed { packets: packets.clone(), next: 0, end: End::Last };
            drive_on(threads, &mut dive, &mut feed, DurNs::from_millis(20), &mut |_| ()).unwrap();
            dive
        };
        let behind = Behind::default();
        let mut dive = run(&behind);
        assert!(behind.0.load(Ordering::Relaxed) > 100);
        let report = ended(&mut dive).0;
        assert_eq!((&report["digest"], &report["sources"]), (&expected["digest"], &expected["sources"]));
        assert_eq!(
            run(&Placing).placer().unwrap().resource::<Seen>().unwrap().0,
            packets.len(),
            "{threads} threads"
        );
    }
}

/// A loop that is split among threads refuses to be saved or split again.
#[test]
fn split_loop_cannot_be_saved_or_split_again() {
    let scene = scene();
    let mut dive = armed(&scene.vehicle, None);
    let saved = dive.save().unwrap();
    let (placer, adviser) = dive.split().unwrap();
    assert!(dive.is_split() && dive.split().is_none());
    assert!(dive.save().is_err() && dive.restore(&saved).is_err());
    dive.join(placer, adviser);
    assert!(!dive.is_split() && dive.save().unwrap() == saved);
    dive.restore(&saved).unwrap();
}

#[test]
fn loops_that_share_a_navigation_give_the_same_results_as_alone() {
    let scene = scene();
    let packets = packets(&scene);
    let asked = [(0.3, 0.25), (0.5, 0.25), (0.8, 1.0), (1.2, 0.5)];
    let vehicle = |(target_m, section_m): (f64, f64)| {
        let mut vehicle = scene.vehicle.mission();
        (vehicle.target.max_hole_m, vehicle.section_m) = (target_m, section_m);
        vehicle
    };
    let loops = || -> Vec<Loop> {
        let armed = |asked: &(f64, f64)| {
            let mut app = App::new(vehicle(*asked));
            for sensor in &scene.vehicle.sensors {
                app.add_device(sensor.as_ref()).unwrap();
            }
            app.arm(scene.vehicle.navigation()).unwrap()
        };
        asked.iter().map(armed).collect()
    };
    let (tick, feed) = (DurNs::from_millis(20), |end| Feed { packets: packets.clone(), next: 0, end });
    for end in [End::Last, End::Error(packets.len() / 2)] {
        let alone = |mut dive: Loop| {
            let driven = drive(&mut dive, &mut feed(end), Pace { tick, speed: None }, &mut |_| ());
            assert_eq!(driven.is_err(), end != End::Last);
            ended(&mut dive)
        };
        let alone: Vec<(Value, Vec<u8>)> = loops().into_iter().map(alone).collect();
        assert!(alone.windows(2).all(|pair| pair[0].0["digest"] != pair[1].0["digest"]));
        for threads in [1, 2, 3, 9] {
            let mut together = loops();
            let driven = drive_together(threads, &mut together, &mut feed(end), tick);
            assert_eq!(driven.is_err(), end != End::Last);
            for ((asked, mut dive), alone) in asked.iter().zip(together).zip(&alone) {
                let (report, state) = ended(&mut dive);
                assert_eq!(report, alone.0, "{asked:?}, {threads} threads");
                assert!(state == alone.1, "{asked:?}, {threads} threads: the states differ");
            }
        }
    }
}

#[test]
fn loops_with_different_mission_settings_cannot_share_a_navigation() {
    let scene = scene();
    let (mut first, mut other) = (scene.vehicle.mission(), scene.vehicle.mission());
    (first.length_m, other.site.sound_speed_mps) = (50.0, first.site.sound_speed_mps + 1.0);
    let armed = |mission| {
        let mut app = App::new(mission);
        for sensor in &scene.vehicle.sensors {
            app.add_device(sensor.as_ref()).unwrap();
        }
        app.arm(scene.vehicle.navigation()).unwrap()
    };
    let mut feed = Feed { packets: Vec::new(), next: 0, end: End::Last };
    let mut loops = vec![armed(first), armed(other)];
    let driven = drive_together(2, &mut loops, &mut feed, DurNs::from_millis(20));
    assert!(matches!(driven, Err(DriveError::Unlike { number: 1 })), "{driven:?}");
}

/// Replays two logs with the program itself. One log is damaged in the middle, and the other one is truncated.
#[test]
fn number_of_threads_does_not_change_the_losses_of_damaged_logs() {
    let folder = Folder::with_dive();
    folder.record("dive.mcap", "live.mcap", &[]);
    let whole = folder.read("live.mcap");
    let mut damaged = whole.clone();
    let middle = whole.len() / 2;
    damaged[middle..middle + 2000].iter_mut().for_each(|byte| *byte ^= 0x5a);
    folder.write("damaged.mcap", damaged);
    folder.write("cut.mcap", &whole[..whole.len() * 2 / 3]);
    for log in ["live.mcap", "damaged.mcap", "cut.mcap"] {
        let run = |command: &str, threads: usize| {
            let answer = folder.headrace(&[command, log, "--json", "--threads", &threads.to_string()]);
            (answer.code, answer.stdout, answer.stderr)
        };
        let (one, verified) = (folder.replay(log, &["--threads", "1"]), run("verify", 1));
        assert_eq!(one.0, Some(if log == "live.mcap" { 0 } else { 3 }), "{}", one.1["log"]);
        for threads in [2, 3] {
            let other = folder.replay(log, &["--threads", &threads.to_string()]);
            assert_eq!(one, other, "{log}, {threads} threads");
            assert_eq!(verified, run("verify", threads), "{log}, {threads} threads");
        }
    }
}
