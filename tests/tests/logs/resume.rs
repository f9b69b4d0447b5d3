//! A dive that was interrupted is rebuilt from its log. During the rebuilding, new packets are only recorded.
//! Afterwards, the dive gives the same results as a dive that was not interrupted, bit for bit.

use std::path::{Path, PathBuf};
use std::time::Duration;

use headrace_monitor::App;
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_replay::log::{DiveLog, LogHeader, MessageKind, Recorder, Rotation, SourceInfo, Unfinished};
use headrace_replay::rebuild::{Rebuild, Rebuilt};
use headrace_replay::record::{QUEUE_BYTES, RecorderOutlet};
use headrace_replay::saved_state::{Consumed, SavedState};
use headrace_simulator::Scene;
use headrace_tests::{Folder, scenes};

use crate::snapshots::{LEGS, Packet, armed, packets, run};

/// Records packets as a dive, and cuts off the last part of the file. Returns the number of readable packets.
fn record_and_cut(scene: &Scene, packets: &[Packet], log: &Path) -> usize {
    let vehicle = &scene.vehicle;
    let ids = vehicle.sensor_configs.iter().map(|sensor| sensor.id.clone()).chain(["console".to_owned()]);
    let source = |id| SourceInfo { id, plugin: "any".to_owned(), connect: String::new() };
    let header = LogHeader {
        vehicle_toml: scene.vehicle_text.clone(),
        sources: ids.map(source).collect(),
        ticks: true,
        ..LogHeader::default()
    };
    let rotation = Rotation { every: None, dive: "one".to_owned() };
    let (port, handle) = Recorder::create(log, &header, &rotation, QUEUE_BYTES, None).unwrap();
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.add_plugin(&RecorderOutlet::new([port])).unwrap();
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let mut ports: Vec<Port> =
        (0..vehicle.sensors.len()).map(|source| dive.take_port(source).unwrap()).collect();
    ports.push(dive.take_console().unwrap());
    for some in packets.chunks(23) {
        for packet in some {
            ports[packet.source].send(packet.at, &packet.bytes).unwrap();
        }
        while dive.has_waiting() {
            dive.tick(some[some.len() - 1].at);
            std::thread::sleep(Duration::from_micros(20));
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    drop(dive);
    handle.finish().unwrap();
    let file = std::fs::OpenOptions::new().write(true).open(log).unwrap();
    file.set_len(file.metadata().unwrap().len() * 9 / 10).unwrap();
    let (mut reader, mut readable) = (DiveLog::open(&[log.to_owned()]).unwrap(), 0);
    while let Some(message) = reader.next().unwrap() {
        readable += usize::from(matches!(message.kind, MessageKind::Raw { .. }));
    }
    readable
}

/// A loop whose ports haven't been taken out yet.
fn with_ports(scene: &Scene) -> Loop {
    let mut app = App::new(scene.vehicle.mission());
    for sensor in &scene.vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.arm(scene.vehicle.navigation()).unwrap()
}

/// A dive that was interrupted, with the expected results of the whole dive.
struct Interrupted {
    scene: Scene,
    log: PathBuf,
    /// Packets in the log.
    before: Vec<Packet>,
    /// Packets after the interruption.
    after: Vec<Packet>,
    /// Expected state of a dive that has consumed the packets before and after the interruption.
    expected: Vec<u8>,
    digest: u64,
}

impl Interrupted {
    fn new(folder: &Folder) -> Self {
        let scene = scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{LEGS}"));
        let all = packets(&scene);
        let (log, recorded) = (folder.path("dive.mcap"), all.len() / 2);
        let readable = record_and_cut(&scene, &all[..recorded], &log);
        assert!(
            readable > recorded / 2 && readable < recorded,
            "{readable} of {recorded} packets are readable"
        );
        let (before, after) = (all[..readable].to_vec(), all[recorded..].to_vec());
        let mut whole = armed(&scene.vehicle);
        run(&mut whole, &before);
        run(&mut whole, &after);
        let (expected, digest) = (whole.0.save().unwrap(), whole.0.view().digest());
        Self { scene, log, before, after, expected, digest }
    }

    /// Rebuilds the dive and continues it. `held` packets arrive during the rebuilding. `waiting` packets are still in
    /// the rings when the dive goes on.
    fn resume(&self, held: usize, waiting: usize, saved: &Path) -> (Loop, Rebuilt) {
        let unfinished = Unfinished::read(&self.log).unwrap().unwrap();
        assert_eq!(unfinished.files, std::slice::from_ref(&self.log));
        let mut rebuild =
            Rebuild::start(with_ports(&self.scene), unfinished.files.clone(), saved.to_owned()).unwrap();
        let (mut dive, mut ports) = armed(&self.scene.vehicle);
        dive.hold(unfinished.next_tick());
        for some in self.after[..held].chunks(23) {
            for packet in some {
                ports[packet.source].send(packet.at, &packet.bytes).unwrap();
            }
            dive.tick(some[some.len() - 1].at);
            rebuild.take(&dive.view().placed().inbox);
            assert_eq!(dive.view().tally().samples, 0, "a held loop processes nothing");
        }
        for packet in &self.after[held..held + waiting] {
            ports[packet.source].send(packet.at, &packet.bytes).unwrap();
        }
        while !rebuild.is_near() {
            std::thread::sleep(Duration::from_millis(5));
        }
        let rebuilt = rebuild.finish().unwrap();
        let ticks = dive.ticks();
        dive.go_on(Some(&rebuilt.snapshot)).unwrap();
        assert_eq!(dive.ticks(), ticks, "the numbers of the ticks continue");
        assert_eq!(dive.has_waiting(), waiting > 0, "no packet is dropped");
        dive.tick(self.after[held + waiting - 1].at);
        let mut dive = (dive, ports);
        run(&mut dive, &self.after[held + waiting..]);
        (dive.0, rebuilt)
    }

    #[track_caller]
    fn is_as_expected(&self, dive: &Loop, which: &str) {
        assert_eq!(dive.view().digest(), self.digest, "{which}");
        // The beginning of a state isn't compared. It contains the number of ticks, which the interruption changes.
        let state = dive.save().unwrap();
        let tail = self.expected.len().min(state.len()) - 64;
        assert_eq!(state.len(), self.expected.len(), "{which}");
        assert!(state[state.len() - tail..] == self.expected[self.expected.len() - tail..], "{which}");
    }
}

#[test]
fn resumed_dive_equals_an_uninterrupted_one_however_many_packets_arrive_meanwhile() {
    let folder = Folder::new();
    let dive = Interrupted::new(&folder);
    let none = folder.path("none");
    for (held, waiting) in [(0, 1), (1, 0), (23, 7), (2300, 200)] {
        let (resumed, rebuilt) = dive.resume(held, waiting, &none);
        let which = format!("{held} packets recorded meanwhile, {waiting} waiting");
        dive.is_as_expected(&resumed, &which);
        assert_eq!(rebuilt.consumed.packets, (dive.before.len() + held) as u64, "{which}");
        assert_eq!((rebuilt.saved_packets, rebuilt.losses), (0, Vec::new()), "{which}");
        assert_eq!(rebuilt.files[0].messages, dive.before.len() as u64, "{which}");
    }
}

#[test]
fn saved_state_shortens_the_replay_only_if_it_fits_the_log() {
    let folder = Folder::new();
    let dive = Interrupted::new(&folder);
    let path = SavedState::path(&dive.log);
    let saved = |packets: &[Packet]| {
        let (mut half, mut consumed) = (armed(&dive.scene.vehicle), Consumed::default());
        for some in packets.chunks(23) {
            run(&mut half, some);
            consumed.add_tick(&half.0.view().placed().inbox);
        }
        SavedState { consumed, snapshot: half.0.save().unwrap() }
    };
    let part = dive.before.len() / 3 / 23 * 23;
    let state = saved(&dive.before[..part]);
    state.write(&path).unwrap();
    let (resumed, rebuilt) = dive.resume(230, 5, &path);
    assert_eq!(rebuilt.saved_packets, part as u64);
    dive.is_as_expected(&resumed, "a state that fits");

    // Saved states that don't fit the log: one with a different packet, one with more packets than the log, damaged
    // ones, and one of another program.
    let mut other = dive.before[..part].to_vec();
    other[part / 2].bytes[0] ^= 1;
    let longer: Vec<Packet> = dive.before.iter().chain(&dive.after[..2300]).cloned().collect();
    for (which, packets) in [("another packet", &other), ("too long", &longer)] {
        saved(packets).write(&path).unwrap();
        let (resumed, rebuilt) = dive.resume(23, 5, &path);
        assert_eq!(rebuilt.saved_packets, 0, "{which}");
        dive.is_as_expected(&resumed, which);
    }
    state.write(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    for (which, at) in [("another program", 20), ("one bit", bytes.len() / 2), ("cut off", usize::MAX)] {
        let mut damaged = bytes.clone();
        match damaged.get_mut(at) {
            Some(byte) => *byte ^= 1,
            None => damaged.truncate(bytes.len() / 2),
        }
        std::fs::write(&path, damaged).unwrap();
        let (resumed, rebuilt) = dive.resume(23, 5, &path);
        assert_eq!(rebuilt.saved_packets, 0, "{which}");
        dive.is_as_expected(&resumed, which);
    }
}
