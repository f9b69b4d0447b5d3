//! Alerts and operator commands are the same for any tick length, in a replay and in `verify`.
//!
//! Commands change no result except the alerts.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::alert_list::{AlertChange, AlertState, Figures, ListKind, ListedAlert};
use headrace_monitor::console::{CONSOLE_ID, Command, ConsoleCounts, ConsoleInput, NoteText, Who};
use headrace_monitor::messages::Notice;
use headrace_monitor::report::Report;
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_replay::log::{LogHeader, LogWriter, SourceInfo};
use headrace_sensor::device::Direction;
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::{Folder, scenes};
use serde_json::Value;

/// The vehicle is fast over a stretch and then goes back over a part of this stretch. During the dive, a head dies and
/// recovers.
const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\n
[[trajectory.legs]]\ndistance_m = 10\nspeed_mps = 0.18\n
[[trajectory.legs]]\ndistance_m = 8\nspeed_mps = 0.4\n
[[trajectory.legs]]\ndistance_m = 6\nspeed_mps = -0.18\n
[[trajectory.legs]]\ndistance_m = 12\nspeed_mps = 0.18\n
[[effects.device_faults]]\nkind = \"die\"\nsensors = [\"sonar_1\"]\nfrom_s = 35\nfor_s = 12\n";
/// Time at which the head dies, seconds after the start.
const DIES_S: f64 = 35.0;

struct Packet {
    source: usize,
    at: MonoNs,
    bytes: Vec<u8>,
}

fn sent(scene: &Scene) -> Vec<Packet> {
    let mut simulation = Simulation::new(scene).unwrap();
    let mut all = Vec::new();
    while let Some(message) = simulation.next_message() {
        if message.direction == Direction::Received {
            let (source, at) = (usize::from(message.source), message.at);
            all.push(Packet { source, at, bytes: message.bytes.to_vec() });
        }
    }
    all
}

fn after(seconds: f64) -> MonoNs {
    START + DurNs::from_secs_f64(seconds)
}

/// Operator actions. Some of them are invalid commands.
const COMMANDS: [(f64, &str); 14] = [
    (12.0, r#"{"do":"note","text":"start of the lining","by":"AB"}"#),
    (20.0, r#"{"do":"voice","id":7,"by":"AB"}"#),
    (25.0, r#"{"do":"voiced","id":7,"seconds":5}"#),
    (26.0, r#"{"do":"voiced","id":8,"seconds":5}"#),
    (40.0, r#"{"do":"acknowledge","alert":0,"by":"AB"}"#),
    (61.0, r#"{"do":"limits","battery_pct":19.5}"#),
    (63.0, r#"{"do":"silence","by":"AB"}"#),
    (63.1, r#"{"do":"dance"}"#),
    (66.0, r#"{"do":"acknowledge","alert":0,"by":"CD"}"#),
    (70.0, r#"{"do":"recording","fails":true}"#),
    (71.0, r#"{"do":"mark","by":"joystick"}"#),
    (80.0, r#"{"do":"recording","fails":false}"#),
    (100.0, r#"{"do":"acknowledge","alert":4711,"by":"AB"}"#),
    (110.0, r#"{"do":"acknowledge","alert":0,"by":"CD"}"#),
];

fn with_commands(scene: &Scene) -> Vec<Packet> {
    let mut all = sent(scene);
    let source = scene.vehicle.sensors.len();
    let commands = COMMANDS.map(|(at_s, json)| Packet { source, at: after(at_s), bytes: json.into() });
    all.extend(commands);
    all.sort_by_key(|packet| (packet.at, packet.source));
    all
}

fn armed(scene: &Scene) -> (Loop, Vec<Port>) {
    let mut app = App::new(scene.vehicle.mission());
    for sensor in &scene.vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(scene.vehicle.navigation()).unwrap();
    let count = scene.vehicle.sensors.len();
    let mut ports: Vec<Port> = (0..count).map(|source| dive.take_port(source).unwrap()).collect();
    ports.push(dive.take_console().unwrap());
    (dive, ports)
}

type Change = (MonoNs, AlertChange, ListedAlert);

/// Runs a dive in ticks of `tick_ms`. Returns the loop and all changes of alerts.
fn dive(scene: &Scene, packets: &[Packet], tick_ms: i64) -> (Loop, Vec<Change>) {
    let (mut dive, mut ports) = armed(scene);
    let mut changes = Vec::new();
    let mut until = START + DurNs::from_millis(tick_ms);
    let take = |notice: &Notice, changes: &mut Vec<Change>| {
        if let Notice::Listed { change, at, alert } = notice {
            changes.push((*at, *change, *alert));
        }
    };
    for packet in packets {
        let port = &mut ports[packet.source];
        if packet.at >= until || !port.has_room(packet.bytes.len()) {
            while dive.has_waiting() {
                dive.tick(packet.at);
                dive.view().notices().for_each(|notice| take(&notice, &mut changes));
            }
            while packet.at >= until {
                until = until + DurNs::from_millis(tick_ms);
            }
        }
        port.send(packet.at, &packet.bytes).unwrap();
    }
    while dive.has_waiting() {
        dive.tick(until);
        dive.view().notices().for_each(|notice| take(&notice, &mut changes));
    }
    dive.finish(&mut |notice, _| take(notice, &mut changes));
    (dive, changes)
}

fn streams(dive: &Loop) -> Vec<(&'static str, u64)> {
    dive.view().streams().into_iter().map(|(name, stream)| (name, stream.value())).collect()
}

fn json(dive: &Loop) -> Value {
    serde_json::to_value(Report::of(dive)).unwrap()
}

#[test]
fn tick_boundaries_do_not_change_alerts_and_commands() {
    let scene = scenes::scene(SCENE);
    let packets = with_commands(&scene);
    let (expected, changes) = dive(&scene, &packets, 20);
    let report = json(&expected);
    let kinds: Vec<&str> = changes.iter().map(|(_, _, alert)| alert.kind.as_str()).collect();
    for kind in ["missed", "too_fast", "sensor_silent", "not_recorded", "battery_left"] {
        assert!(kinds.contains(&kind), "{kinds:?}");
    }
    let done: Vec<AlertChange> = changes.iter().map(|(_, change, _)| *change).collect();
    for change in ["raised", "acknowledged", "silenced", "rectified", "cleared", "changed"] {
        assert!(done.iter().any(|done| done.as_str() == change), "{change}");
    }
    // Alerts whose condition is over are expected to require no action.
    let around = expected.view().surroundings();
    let asks = |alert: &&ListedAlert| !alert.advice(&around).is_empty();
    let (holding, over): (Vec<_>, Vec<_>) =
        changes.iter().map(|(.., alert)| alert).partition(|alert| alert.state == AlertState::Active);
    assert!(holding.iter().any(asks) && over.iter().all(|alert| !asks(alert)));
    assert_eq!(report["notes"].as_array().unwrap().len(), 3);
    assert_eq!(report["notes"][0]["text"], "start of the lining");
    let x_m = report["notes"][0]["chainage_m"].as_f64().unwrap();
    assert!((1.0..4.0).contains(&x_m), "{x_m}");
    let voice = &report["notes"][1];
    assert_eq!(voice["voice"], serde_json::json!({"id": 7, "seconds": 5}));
    assert_eq!(
        voice["at_s"],
        expected.view().clock().seconds(after(20.0)),
        "the note has the time at which it began"
    );
    let counts = ConsoleCounts { packets: 14, invalid: 1, without_effect: 2 };
    assert_eq!(expected.view().console_counts(), counts);
    assert_eq!(report["sources"].as_array().unwrap().len(), scene.vehicle.sensors.len());
    for tick_ms in [1, 333, 5000] {
        let (other, other_changes) = dive(&scene, &packets, tick_ms);
        assert_eq!(streams(&other), streams(&expected), "ticks of {tick_ms} ms");
        assert_eq!(json(&other), report, "ticks of {tick_ms} ms");
        assert_eq!(other_changes, changes, "ticks of {tick_ms} ms");
    }
}

#[test]
fn commands_change_no_result_except_alerts() {
    let scene = scenes::scene(SCENE);
    let (plain, _) = dive(&scene, &sent(&scene), 20);
    let (operated, _) = dive(&scene, &with_commands(&scene), 20);
    for ((name, one), (_, other)) in streams(&plain).into_iter().zip(streams(&operated)) {
        assert_eq!(one == other, name != "alerts", "{name}");
    }
    let (mut one, mut other) = (json(&plain), json(&operated));
    for report in [&mut one, &mut other] {
        for key in ["digest", "alert_list", "notes", "console"] {
            report.as_object_mut().unwrap().remove(key).unwrap();
        }
    }
    assert_eq!(one, other);
    // Invalid operator commands change nothing at all.
    let mut packets = sent(&scene);
    let source = scene.vehicle.sensors.len();
    for (number, bytes) in
        [&b"\0\xff"[..], b"{", b"{\"do\":\"silence\"}", &[b' '; 4000]].into_iter().enumerate()
    {
        packets
            .insert(1000 * number, Packet { source, at: packets[1000 * number].at, bytes: bytes.to_vec() });
    }
    let (odd, _) = dive(&scene, &packets, 20);
    assert_eq!(streams(&odd), streams(&plain));
    assert_eq!(odd.view().console_counts(), ConsoleCounts { packets: 4, invalid: 4, without_effect: 0 });
}

#[test]
fn too_fast_stretch_and_dead_head_are_alerted_once_and_in_time() {
    let scene = scenes::scene(SCENE);
    let (dive, changes) = dive(&scene, &sent(&scene), 20);
    let raised = |kind: ListKind| -> Vec<f64> {
        let raised =
            changes.iter().filter(|(_, change, alert)| *change == AlertChange::Raised && alert.kind == kind);
        raised.map(|(at, ..)| at.since(START).as_secs_f64()).collect()
    };
    // On the way back any speed is allowed, so the second too-fast alert is raised only after the way back.
    let too_fast = raised(ListKind::TooFast);
    assert!(matches!(too_fast[..], [first, again] if first < 10.0 && again > 100.0), "{too_fast:?}");
    // After the fast stretch, the too-fast alert still shows the speed that was too fast, not the later, lower speed.
    let fast = dive.view().alert_list().iter().find(|alert| alert.kind == ListKind::TooFast).unwrap();
    let Figures::Advice(figures) = fast.figures else { panic!("{:?}", fast.figures) };
    assert!(figures.speed_mps > 1.2 * figures.v_max_mps, "{figures:?}");
    let [silent_s] = raised(ListKind::SensorSilent)[..] else {
        panic!("{:?}", raised(ListKind::SensorSilent))
    };
    // The alert for the dead head is raised 2 s after the head's last reading, at the next update. No latch time delays
    // the alert, because none is configured.
    assert!((DIES_S + 1.5..DIES_S + 2.3).contains(&silent_s), "{silent_s}");
    let head = dive.view().alert_list().iter().find(|alert| alert.kind == ListKind::SensorSilent).unwrap();
    assert_eq!(dive.sources()[head.source.unwrap().index()].id, "sonar_1");
    assert_eq!(head.state, AlertState::Rectified, "the head returned, and the alert is unacknowledged");
    // The missed stretch has a single alert, although a later pass has filled a part of the stretch.
    let missed = raised(ListKind::Missed);
    let runs = dive.view().coverage().sections.runs().all();
    assert!(missed.len() <= runs.len() && !missed.is_empty(), "{missed:?}, {} runs", runs.len());
    for run in runs.iter().filter(|run| run.is_open()) {
        let holds = |alert: &&ListedAlert| {
            let within = alert.stretch.is_some_and(|(from, to)| from <= run.from && run.to <= to);
            alert.kind == ListKind::Missed && alert.state == AlertState::Active && within
        };
        assert_eq!(dive.view().alert_list().iter().filter(holds).count(), 1, "{run:?}");
    }
}

#[test]
fn silence_of_all_sensors_raises_one_alert_in_time() {
    let scene = scenes::scene(SCENE);
    let mut packets = sent(&scene);
    packets.retain(|packet| packet.at < after(20.0));
    let source = scene.vehicle.sensors.len();
    let last = packets.last().unwrap().at;
    for half in 1..12 {
        let at = last + DurNs::from_millis(500 * half);
        packets.push(Packet { source, at, bytes: Command::Time.to_json().into_bytes() });
    }
    let (dive, changes) = dive(&scene, &packets, 20);
    let silent: Vec<_> = changes.iter().filter(|(.., alert)| alert.kind == ListKind::NoData).collect();
    let [(at, AlertChange::Raised, _)] = silent[..] else { panic!("{silent:?}") };
    assert!((2.0..=2.6).contains(&at.since(last).as_secs_f64()), "{:?}", at.since(last));
    let of_one = changes.iter().filter(|(.., alert)| alert.kind == ListKind::SensorSilent).count();
    assert_eq!(of_one, 0, "one situation, not one for each sensor");
    assert_eq!(dive.view().last_received(), Some(last), "operator input counts as a sensor");
}

/// If another thread gives a command, the command gets its timestamp from the dive's clock.
#[test]
fn commands_from_any_thread_reach_the_loop() {
    let scene = scenes::scene(SCENE);
    let mut app = App::new(scene.vehicle.mission());
    for sensor in &scene.vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(scene.vehicle.navigation()).unwrap();
    let (mut input, port) = ConsoleInput::new(&mut dive, None).unwrap();
    assert!(ConsoleInput::new(&mut dive, None).is_none(), "there already is an operator input");
    let by = Who::new("AB").unwrap();
    let threads = [(); 4].map(|()| {
        let port = port.clone();
        std::thread::spawn(move || {
            (0..100).filter(|_| port.send(&Command::Note { text: NoteText::default(), by }).is_ok()).count()
        })
    });
    let taken: usize = threads.into_iter().map(|thread| thread.join().unwrap()).sum();
    assert_eq!(taken, 256, "the number of waiting commands is bounded");
    while dive.view().notes().iter().count() < taken {
        input.take_in(MonoNs(7));
        dive.tick(MonoNs(8));
    }
    assert!(dive.view().notes().iter().all(|note| note.at == MonoNs(7) && note.by == by));
    let recording = Command::Recording { fails: true };
    port.send(&recording).unwrap();
    input.take_in(MonoNs(9));
    dive.tick(MonoNs(9));
    assert_eq!(dive.view().alert_list().counts().unacknowledged, 1);
}

#[test]
fn recorded_acknowledgements_are_equal_in_replay_and_verify() {
    let scene = scenes::scene(SCENE);
    let folder = Folder::new();
    let console = SourceInfo { id: CONSOLE_ID.to_owned(), plugin: String::new(), connect: String::new() };
    let sources = scene.vehicle.sensor_configs.iter().map(|sensor| SourceInfo {
        id: sensor.id.clone(),
        plugin: sensor.plugin.clone(),
        connect: sensor.connect.clone(),
    });
    let header = LogHeader {
        vehicle_toml: scene.vehicle_text.clone(),
        sources: sources.chain([console]).collect(),
        ..LogHeader::default()
    };
    let mut writer = LogWriter::create(&folder.path("dive.mcap"), &header).unwrap();
    for packet in with_commands(&scene) {
        let source = u16::try_from(packet.source).unwrap();
        writer.raw(source, packet.at, packet.at, &packet.bytes).unwrap();
    }
    writer.finish().unwrap();
    folder.write("vehicle.toml", &scene.vehicle_text);
    let live = folder.headrace(&[
        "run",
        "vehicle.toml",
        "--source",
        "dive.mcap",
        "--record",
        "live.mcap",
        "--speed",
        "max",
        "--json",
    ]);
    let live: Value =
        serde_json::from_str(&live.stdout).unwrap_or_else(|error| panic!("{error}: {}", live.stderr));
    let by = |report: &Value| -> Vec<String> {
        let all = report["alert_list"].as_array().unwrap().iter();
        all.filter_map(|alert| Some(alert["acknowledged"]["by"].as_str()?.to_owned())).collect()
    };
    assert!(by(&live).contains(&"AB".to_owned()) && by(&live).contains(&"CD".to_owned()), "{:?}", by(&live));
    for tick in ["1", "20", "5000"] {
        let (_, replayed) = folder.replay("live.mcap", &["--tick-ms", tick]);
        assert_eq!(replayed["digest"], live["digest"]);
        assert_eq!(replayed["alert_list"], live["alert_list"]);
        assert_eq!(replayed["notes"], live["notes"]);
        let verified = folder.headrace(&["verify", "live.mcap", "--tick-ms", tick]);
        assert_eq!(verified.code, Some(0), "{}{}", verified.stdout, verified.stderr);
    }
    let lines = folder.headrace(&["replay", "live.mcap", "--json-lines"]).stdout;
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |kind: &str| lines.iter().filter(|line| line["type"] == kind).cloned().collect::<Vec<_>>();
    // The list has the voice note twice: at its start, and again with its duration.
    assert_eq!(of("note").len(), 4);
    assert!(of("alert_change").iter().any(|line| line["change"] == "acknowledged"));
    let states = of("state");
    let last = states.last().unwrap();
    assert_eq!((&last["left"]["battery_pct"], &last["alerts_hidden"]), (&19.5.into(), &0.into()));
}

/// A dive of 20 s with a velocity log and an inertial unit on a CAN bus. `change` changes the bytes of each packet.
fn withheld_dive(change: fn(&str, &mut Vec<u8>)) -> (Scene, Vec<Packet>) {
    let log = "\n[[sensors]]\nid = \"dvl\"\nplugin = \"a50\"\nconnect = \"tcp:127.0.0.1:9\"\n";
    let load = |name: &str| {
        let mut file = scenes::vehicle_file(name)?;
        file.extend_from_slice(log.as_bytes());
        Ok(file)
    };
    let text =
        "vehicle = \"vita2-4.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 8\nspeed_mps = 0.2\n";
    let scene = scenes::scene_from(text, &load);
    let mut packets = sent(&scene);
    for packet in &mut packets {
        change(&scene.vehicle.sensor_configs[packet.source].id, &mut packet.bytes);
    }
    (scene, packets)
}

/// Adds 15 s to the transmission time of a velocity report.
fn make_late(id: &str, bytes: &mut Vec<u8>) {
    if id == "dvl" {
        let mut report: Value = serde_json::from_slice(bytes).unwrap();
        report["time_of_transmission"] = (report["time_of_validity"].as_i64().unwrap() + 15_000_000).into();
        *bytes = format!("{report}\r\n").into_bytes();
    }
}

/// Changes the id of a CAN frame to an id that no message of the inertial unit has.
#[expect(clippy::ptr_arg, reason = "the type of all changes")]
fn make_foreign(id: &str, bytes: &mut Vec<u8>) {
    if id == "imu" {
        bytes[..4].copy_from_slice(&0x7e_u32.to_le_bytes());
    }
}

/// Text and action of each alert about withheld readings.
fn withheld(dive: &Loop) -> Vec<(String, String)> {
    let around = dive.view().surroundings();
    let alerts = dive.view().alert_list().iter().filter(|alert| alert.kind == ListKind::SensorWithheld);
    alerts.map(|alert| (alert.text(&around), alert.advice(&around))).collect()
}

#[test]
fn velocity_log_that_is_15_s_late_is_alerted_with_reason_and_number() {
    let (scene, packets) = withheld_dive(make_late);
    let (late, changes) = dive(&scene, &packets, 20);
    let sent =
        packets.iter().filter(|packet| scene.vehicle.sensor_configs[packet.source].id == "dvl").count();
    let [(text, action)] = &withheld(&late)[..] else { panic!("{:?}", withheld(&late)) };
    let count: usize =
        text.strip_prefix("dvl: ").and_then(|text| text.split(' ').next()).unwrap().parse().unwrap();
    assert_eq!(
        text.split_once(' ').unwrap().1,
        format!("{count} readings withheld: 15.0 s late, at most 2 s")
    );
    assert!((sent - 3..=sent).contains(&count), "{count} of {sent}");
    assert_eq!(action, "restart it");
    // An alert that a sensor is silent would contradict the alert about withheld readings, so there must be none.
    let of_sensors = changes.iter().filter(|(.., alert)| alert.kind == ListKind::SensorSilent).count();
    assert_eq!(of_sensors, 0);
    let state = late.view().live_state_json();
    let dvl = state.sensors.iter().find(|sensor| sensor.id == "dvl").unwrap();
    // The text after the number is compared. The numbers differ, because the live state also counts reports since the
    // last update of the alerts.
    let after = dvl.withheld.as_ref().unwrap().split_once(' ').unwrap().1;
    assert_eq!((dvl.state.as_str(), after), ("withheld", text.splitn(3, ' ').nth(2).unwrap()));
    let report = Report::of(&late);
    let of = |id: &str| report.sources.iter().find(|source| source.id == id).unwrap().no_reading.clone();
    assert_eq!(of("dvl").unwrap(), format!("{sent} readings withheld: 15.0 s late, at most 2 s"));
    assert_eq!(of("imu"), None);
    for tick_ms in [1, 333, 5000] {
        let (other, other_changes) = dive(&scene, &packets, tick_ms);
        assert_eq!(
            (streams(&other), other_changes),
            (streams(&late), changes.clone()),
            "ticks of {tick_ms} ms"
        );
    }
}

/// The test tries several rates, because the time from the last reading to the first withheld report is one period.
#[test]
fn velocity_log_that_becomes_late_during_the_dive_is_never_called_silent() {
    for keep_one_of in [1, 5, 10] {
        let (scene, mut packets) = withheld_dive(|_, _| ());
        let begun = packets[0].at;
        let is_dvl = |packet: &Packet| scene.vehicle.sensor_configs[packet.source].id == "dvl";
        let mut number = 0;
        packets.retain(|packet| {
            number += usize::from(is_dvl(packet));
            !is_dvl(packet) || number % keep_one_of == 0
        });
        for packet in packets.iter_mut().filter(|packet| is_dvl(packet)) {
            if packet.at.since(begun).as_secs_f64() > 15.0 {
                make_late("dvl", &mut packet.bytes);
            }
        }
        let (late, changes) = dive(&scene, &packets, 20);
        assert_eq!(withheld(&late).len(), 1, "one of {keep_one_of} reports");
        let silent = changes.iter().filter(|(.., alert)| alert.kind == ListKind::SensorSilent).count();
        assert_eq!(silent, 0, "one of {keep_one_of} reports");
    }
}

/// Without any reading, only operator commands, which state the time, make the loop's time advance, so that alerts can
/// be raised.
#[test]
fn can_frames_without_a_known_id_are_alerted_although_no_sensor_has_a_reading() {
    let (scene, mut packets) = withheld_dive(make_foreign);
    packets.retain(|packet| scene.vehicle.sensor_configs[packet.source].id == "imu");
    let (from, to) = (packets[0].at, packets.last().unwrap().at);
    let source = scene.vehicle.sensors.len();
    let halves = to.since(from).0 / 500_000_000;
    packets.extend((1..=halves).map(|half| Packet {
        source,
        at: from + DurNs::from_millis(500 * half),
        bytes: Command::Time.to_json().into_bytes(),
    }));
    packets.sort_by_key(|packet| (packet.at, packet.source));
    let (foreign, changes) = dive(&scene, &packets, 20);
    let [(text, action)] = &withheld(&foreign)[..] else { panic!("{:?}", withheld(&foreign)) };
    assert!(
        text.starts_with("imu: ") && text.ends_with(" packets without a message of this device"),
        "{text}"
    );
    assert_eq!(action, "check its plugin, connection and ids in the vehicle file");
    let (at, ..) = changes.iter().find(|(.., alert)| alert.kind == ListKind::SensorWithheld).unwrap();
    assert!((2.0..4.0).contains(&at.since(from).as_secs_f64()), "{:?}", at.since(from));
    for tick_ms in [1, 333] {
        let (other, other_changes) = dive(&scene, &packets, tick_ms);
        assert_eq!(
            (streams(&other), other_changes),
            (streams(&foreign), changes.clone()),
            "ticks of {tick_ms} ms"
        );
    }
}
