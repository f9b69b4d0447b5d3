//! A dive on real ports in one process: the loop with its supervisor, and emulated devices on lines that can fail.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use headrace::InRecordings;
use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::DurNs;
use headrace_monitor::App;
use headrace_monitor::report::Report;
use headrace_monitor::run::Loop;
use headrace_ports::{Connection, LineHistory, LineRecord, Phase, Supervisor};
use headrace_replay::drive::{Pace, drive};
use headrace_replay::log::{LogHeader, Recorder, RecorderHandle, Rotation, SourceInfo};
use headrace_replay::player::Player;
use headrace_replay::record::{QUEUE_BYTES, RecorderOutlet, result_channels};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::{Emulated, EmulatorSetup};
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::VehicleConfig;

use crate::drops;
use crate::faulty::{Control, End, Fault, Faulty};
use crate::patient::Patient;

/// Longest wait for a condition. Even on a busy machine, only a test that hangs waits longer.
const LONG: DurNs = DurNs::from_millis(300_000);

/// Vehicle file without the sensors' tables.
pub const HEADING: &str = r#"name = "faults"
target_m = 1.2

[tunnel]
profile = "circle"
radius_m = 3
length_m = 20
"#;

/// A head whose turns take some seconds.
pub const HEAD: &str = "plugin = \"imagenex881\"\nmode = \"fastest\"\nrange_m = 5\n";
/// An echosounder that is polled twenty times a second.
pub const PING: &str = "plugin = \"ping1d\"\ninterval_ms = 50\n";
/// A cable counter that reports by UDP.
pub const COUNTER: &str = "plugin = \"tether_hid\"\ncounts_per_metre = 2000\nrate_hz = 50\n";
/// A depth sensor (Bar100).
pub const DEPTH: &str = "plugin = \"bar100\"\n";

/// A sensor for a [`Rig`]: its table in the vehicle file, the device's end of the line, and the line's fault.
pub struct Sensor {
    /// Table of the sensor, without the keys `id` and `connect`.
    pub text: &'static str,
    /// Device's end of the line.
    pub end: End,
    /// Fault of the sensor's line.
    pub fault: Box<dyn Fault>,
}

/// State of a dive on real ports at a moment.
#[derive(Debug, Clone, Default)]
pub struct View {
    /// Number of good frames found by each sensor's decoder.
    pub good: Vec<u64>,
    /// Number of frames that each device sent whole.
    pub whole: Vec<u64>,
    /// Last status of each sensor.
    pub phases: Vec<Option<Phase>>,
    /// Status texts of each sensor, in order and without repetitions.
    pub said: Vec<Vec<String>>,
}

/// A dive on real ports and its emulated devices.
pub struct Rig {
    dive: Loop,
    supervisor: Supervisor,
    devices: Vec<Faulty>,
    /// For each sensor, the index of its line in `devices`.
    on: Vec<usize>,
    view: View,
    places: Vec<String>,
    recorded: Option<(PathBuf, RecorderHandle, String)>,
}

/// Result of a dive on real ports.
pub struct Ended {
    /// State of the dive at its end.
    pub view: View,
    /// For each line, its last status and the numbers of openings, losses and dropped packets.
    pub lines: Vec<LineHistory>,
    /// Report of the dive.
    pub report: Report,
}

impl Rig {
    /// Starts the dive and the devices. All devices are plugged in at first, except those whose end is absent
    /// ([`End::absent`]).
    pub fn new(sensors: Vec<Sensor>) -> Self {
        Self::recorded(sensors, None)
    }

    /// As [`Rig::new`], and records the dive to the new file `log`, if given.
    pub fn recorded(sensors: Vec<Sensor>, log: Option<&Path>) -> Self {
        let places: Vec<String> = sensors.iter().map(|sensor| sensor.end.connect().to_string()).collect();
        let mut text = HEADING.to_owned();
        for (number, (sensor, place)) in sensors.iter().zip(&places).enumerate() {
            let own = sensor.text;
            write!(text, "\n[[sensors]]\nid = \"s{number}\"\nconnect = \"{place}\"\n{own}").unwrap();
        }
        let document = Document::new("vehicle.toml", &text);
        let vehicle = VehicleConfig::parse(document, &KINDS, &|_| unreachable!("no file is named")).unwrap();
        let begun = headrace_ports::now();
        let (mut dive, handle) = assemble(&vehicle, &text, log);
        let mut programs = vehicle.programs().unwrap().into_iter();
        let (mut connections, mut lines) = (Vec::new(), Vec::<(Vec<Emulated>, _, _)>::new());
        let mut on = Vec::new();
        for (source, (sensor, device)) in sensors.into_iter().zip(&vehicle.sensors).enumerate() {
            let head = device.head().and_then(|_| programs.next());
            let setup = EmulatorSetup { start: begun, head, site: vehicle.site, polled: false };
            let connect = Connect::parse(&vehicle.sensor_configs[source].connect);
            let connect = connect.and_then(|connect| connect.among(device.carriers()));
            let driver = device.driver(&DriverSetup { begun, head });
            let driver = if sensor.end.is_pseudoterminal() { Box::new(Patient(driver)) } else { driver };
            connections.push(Connection { source, connect, port: dive.take_port(source).unwrap(), driver });
            match lines.last_mut().filter(|_| sensor.end.is_beside()) {
                Some((devices, ..)) => devices.push(device.emulator(&setup)),
                None => lines.push((vec![device.emulator(&setup)], sensor.end, sensor.fault)),
            }
            on.push(lines.len() - 1);
        }
        let start = |(devices, end, fault)| Faulty::start(devices, end, fault);
        let devices: Vec<Faulty> = lines.into_iter().map(start).collect();
        let record = handle
            .as_ref()
            .map(|handle| Arc::new(InRecordings(vec![handle.line_port()])) as Arc<dyn LineRecord>);
        let supervisor = Supervisor::start(connections, record).unwrap();
        let count = on.len();
        let view = View {
            good: vec![0; count],
            whole: vec![0; count],
            phases: vec![None; count],
            said: vec![Vec::new(); count],
        };
        let recorded = log.zip(handle).map(|(log, handle)| (log.to_owned(), handle, text));
        Self { dive, supervisor, devices, on, view, places, recorded }
    }

    /// Controls of a device, with which a test can for instance unplug it.
    pub fn control(&self, number: usize) -> &Control {
        self.devices[self.on[number]].control()
    }

    /// State of the dive at the latest update.
    pub fn view(&self) -> &View {
        &self.view
    }

    /// Runs the dive until `condition` is true; returns the state of the dive.
    #[track_caller]
    pub fn until(&mut self, what: &str, condition: impl Fn(&View) -> bool) -> View {
        let Self { dive, supervisor, devices, on, view, places, .. } = self;
        let deadline = headrace_ports::now() + LONG;
        let (met, view) = (Cell::new(false), RefCell::new(view));
        supervisor.run(dive, &|| met.get() || headrace_ports::now() > deadline, &mut |dive| {
            let mut view = view.borrow_mut();
            view.look(dive, supervisor, (devices, on), places);
            met.set(condition(&view));
        });
        let view = view.into_inner();
        assert!(met.get(), "{what}: not reached within {LONG:?}: {view:#?}");
        view.clone()
    }

    /// Runs the dive until a sensor has received `more` further good frames.
    #[track_caller]
    pub fn more(&mut self, number: usize, more: u64) -> View {
        let from = self.view.good[number];
        self.until(&format!("{more} more of {number}"), |view| view.good[number] >= from + more)
    }

    /// Runs the dive until a new status text of a sensor contains `words`.
    #[track_caller]
    pub fn says(&mut self, number: usize, words: &str) -> View {
        self.until(&format!("{number} says {words:?}"), |view| {
            view.said[number].last().is_some_and(|said| said.contains(words))
        })
    }

    /// Silences all devices, waits for the arrival of every frame that was sent whole, and ends the dive.
    #[track_caller]
    pub fn end(self) -> Ended {
        self.end_but(None)
    }

    /// As [`Rig::end`], but doesn't wait for the frames of the sensor `overrun`, because a full ring may have dropped
    /// some of them.
    #[track_caller]
    pub fn end_but(mut self, overrun: Option<usize>) -> Ended {
        for device in &self.devices {
            device.control().fall_silent();
        }
        self.until("all frames that were sent whole", |view| {
            let mut sensors = view.good.iter().zip(&view.whole).enumerate();
            sensors.all(|(number, (good, whole))| good >= whole || Some(number) == overrun)
        });
        let Self { mut dive, supervisor, devices, on, mut view, places, recorded } = self;
        view.look(&dive, &supervisor, (&devices, &on), &places);
        let lines = supervisor.stop(&mut dive, &mut |_| ());
        view.good = dive.decoder_counts().iter().map(|counts| counts.good_frames).collect();
        drop(devices);
        dive.finish(&mut |_, _| ());
        let (report, digest) = (Report::of(&dive), dive.view().digest());
        drop(dive);
        if let Some((log, handle, text)) = recorded {
            handle.finish().unwrap();
            let dropped = lines.iter().map(|line| line.dropped).sum();
            assert_eq!(replayed(&log, &text, dropped), digest, "the digest of the replay");
        }
        Ended { view, lines, report }
    }
}

impl Ended {
    /// Checks that every sensor used exactly the frames that its device sent whole.
    #[track_caller]
    pub fn all_used(&self) {
        let Self { view, lines, .. } = self;
        assert_eq!(view.good, view.whole, "good frames, and those sent whole: {view:#?} {lines:#?}");
        assert!(lines.iter().all(|line| line.dropped == 0), "{lines:#?}");
    }

    /// Checks that this sensor reported no fault and lost no data.
    #[track_caller]
    pub fn untroubled(&self, number: usize) {
        let (line, said) = (&self.lines[number], &self.view.said[number]);
        assert_eq!((line.opened, line.lost, line.dropped), (1, 0, 0), "{line:?} {said:?}");
        assert_eq!(self.view.good[number], self.view.whole[number]);
        assert_eq!(self.report.sources[number].frames, self.view.whole[number]);
        // On a busy machine, a status may be reported before the first frame arrives.
        let after_opening =
            said.strip_prefix(&["silent: the line is open, but no frame has arrived yet".to_owned()]);
        assert_eq!(after_opening.unwrap_or(said), ["running"], "the healthy sensor");
    }
}

impl View {
    fn look(
        &mut self,
        dive: &Loop,
        supervisor: &Supervisor,
        devices: (&[Faulty], &[usize]),
        places: &[String],
    ) {
        let (devices, on) = devices;
        // Sent frames are counted before received ones. A frame that arrives between the two counts is therefore never
        // counted as sent but not received.
        self.whole = on.iter().map(|line| devices[*line].control().whole()).collect();
        self.good = dive.decoder_counts().iter().map(|counts| counts.good_frames).collect();
        while let Some(status) = supervisor.next_status() {
            self.phases[status.source] = Some(status.phase);
            self.said[status.source].push(neutral(&status.to_string(), places));
        }
    }
}

/// Replaces the addresses in a status text with fixed words, because the system chooses the addresses.
fn neutral(words: &str, places: &[String]) -> String {
    let mut words = words.to_owned();
    for place in places {
        words = words.replace(place, "<line>");
        let bare = place.split_once(':').map_or("", |(_, rest)| rest);
        words = words.replace(bare.split('?').next().unwrap(), "<place>");
    }
    words
}

fn assemble(vehicle: &VehicleConfig, text: &str, log: Option<&Path>) -> (Loop, Option<RecorderHandle>) {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut handle = None;
    if let Some(log) = log {
        let sources = vehicle.sensor_configs.iter().map(|sensor| SourceInfo {
            id: sensor.id.clone(),
            plugin: sensor.plugin.clone(),
            connect: sensor.connect.clone(),
        });
        let header = LogHeader {
            vehicle_toml: text.to_owned(),
            attachments: Vec::new(),
            metadata: BTreeMap::new(),
            sources: sources.collect(),
            ticks: true,
            results: result_channels(),
            ..LogHeader::default()
        };
        let (port, recorder) =
            Recorder::create(log, &header, &Rotation::default(), QUEUE_BYTES, None).unwrap();
        app.add_plugin(&RecorderOutlet::new([port])).unwrap();
        handle = Some(recorder);
    }
    (app.arm(vehicle.navigation()).unwrap(), handle)
}

/// Creates the emulated device of a sensor, for a dive in another process.
pub fn emulated(text: &str) -> Emulated {
    let text = format!("{HEADING}\n[[sensors]]\nid = \"s0\"\n{text}");
    let document = Document::new("vehicle.toml", &text);
    let vehicle = VehicleConfig::parse(document, &KINDS, &|_| unreachable!("no file is named")).unwrap();
    let head = vehicle.programs().unwrap().first().copied();
    let start = headrace_ports::now();
    vehicle.sensors[0].emulator(&EmulatorSetup { start, head, site: vehicle.site, polled: false })
}

/// Replays the log `log` and returns the digest. The replay must report `dropped` dropped packets and no other loss.
fn replayed(log: &Path, text: &str, dropped: u64) -> u64 {
    let document = Document::new("vehicle.toml", text);
    let vehicle = VehicleConfig::parse(document, &KINDS, &|_| unreachable!("no file is named")).unwrap();
    let (mut dive, _) = assemble(&vehicle, text, None);
    let mut player = Player::open(&[log.to_owned()]).unwrap();
    player.connect(dive.sources());
    drive(&mut dive, &mut player, Pace::default(), &mut |_| ()).unwrap();
    assert_eq!(drops::apart(&player.losses()), (dropped, Vec::new()));
    dive.finish(&mut |_, _| ());
    dive.view().digest()
}
