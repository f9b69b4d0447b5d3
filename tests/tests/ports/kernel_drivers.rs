//! The CAN and HID drivers on a real kernel, with emulated devices.
//!
//! All sent data is decoded. If the CAN interface or the counter disappears, the other sensor goes on. A sensor that
//! returns is used again. Like `kernel_can_hid.rs`, these tests need the kernel of a virtual machine: `tests/vm/run
//! --with target/debug/headrace_under_test -- PROGRAM kernel_drivers:: --ignored --test-threads=1`.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread;
use std::time::Duration;

use crossbeam::queue::SegQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::run::Loop;
use headrace_ports::{Connection, EmulatedPort, LineHistory, Phase, Status, Supervisor, now};
use headrace_sensor::connect::{Connect, UsbIdentity};
use headrace_sensor::driver::{DeviceHealth, Driver, DriverSetup, Wire};
use headrace_simulator::Simulation;
use headrace_tests::scenes;
use headrace_tests::{Folder, VEHICLE};
use headrace_tether_hid::report::REFERENCE_DESCRIPTOR;
use hidapi::HidApi;
use serde_json::Value;

const IMU: usize = 0;
const TETHER: usize = 1;

/// Longest time that a test waits for expected data.
const LONG: DurNs = DurNs::from_millis(20_000);
/// Duration of silence after which a test expects no more data on a line.
const SETTLED: DurNs = DurNs::from_millis(200);
/// Number of messages sent at once. The kernel buffers more reports than this for a counter.
const BURST: usize = 20;

const COUNTER: &str = "hid:1209:0001:HR-0001";

const TWO_SENSORS: &str = r#"name = "inertial unit and tether"
target_m = 5

[tunnel]
profile = "circle"
radius_m = 3
length_m = 100

[water]
sound_speed_mps = 1447

[[sensors]]
id = "imu"
plugin = "imu_can"
preset = "xsens_mti600"

[[sensors]]
id = "tether"
plugin = "tether_hid"
counts_per_metre = 2000
"#;

const WAY: &str =
    "vehicle = \"vehicle.toml\"\n[trajectory]\n[[trajectory.legs]]\ndistance_m = 20\nspeed_mps = 0.2\n";

/// Runs `ip link` with the arguments in `words`, separated by spaces.
fn ip_link(words: &str) {
    let status = Command::new("ip").arg("link").args(words.split(' ')).status().unwrap();
    assert!(status.success(), "ip link {words}: {status}");
}

/// A virtual CAN interface for this test. The interface is removed when this value is dropped.
struct Interface(&'static str);

impl Interface {
    fn up(name: &'static str) -> Self {
        ip_link(&format!("add dev {name} type vcan"));
        ip_link(&format!("set {name} up"));
        Self(name)
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        ip_link(&format!("delete {}", self.0));
    }
}

fn counter(serial: &str) -> EmulatedPort {
    let identity = UsbIdentity { vendor: 0x1209, product: 0x0001, serial: Some(serial.to_owned()) };
    EmulatedPort::hid(&identity, &REFERENCE_DESCRIPTOR).unwrap()
}

/// Path that the kernel gives to the counter with a serial number.
fn path(serial: &str) -> String {
    for _ in 0..1000 {
        let api = HidApi::new().unwrap();
        let found = api.device_list().find(|device| device.serial_number() == Some(serial));
        if let Some(found) = found {
            return found.path().to_string_lossy().into_owned();
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("{serial} was plugged in but isn't listed");
}

/// An inertial unit and a counter on their lines, their supervisor, and a loop that decodes their data.
struct Rehearsal {
    supervisor: Supervisor,
    dive: Loop,
    said: Vec<Status>,
    simulation: Simulation,
    messages: [VecDeque<Vec<u8>>; 2],
}

impl Rehearsal {
    /// Starts supervisor and loop. `connects` are the addresses of the two sensors. `change` may wrap the driver of
    /// each sensor.
    fn new(connects: [&str; 2], change: &dyn Fn(usize, Box<dyn Driver>) -> Box<dyn Driver>) -> Self {
        let scene = scenes::scene_from(WAY, &|_| Ok(TWO_SENSORS.as_bytes().to_vec()));
        let vehicle = &scene.vehicle;
        let mut app = App::new(vehicle.mission());
        for sensor in &vehicle.sensors {
            app.add_device(sensor.as_ref()).unwrap();
        }
        let mut dive = app.arm(vehicle.navigation()).unwrap();
        let mut connections = Vec::new();
        for (source, connect) in connects.into_iter().enumerate() {
            let driver = vehicle.sensors[source].driver(&DriverSetup { begun: now(), head: None });
            let port = dive.take_port(source).unwrap();
            let connect = Connect::parse(connect);
            connections.push(Connection { source, connect, port, driver: change(source, driver) });
        }
        let supervisor = Supervisor::start(connections, None).unwrap();
        let simulation = Simulation::new(&scene).unwrap();
        Self { supervisor, dive, said: Vec::new(), simulation, messages: [VecDeque::new(), VecDeque::new()] }
    }

    /// Next message that the simulated sensor sends.
    fn next_message(&mut self, source: usize) -> Vec<u8> {
        loop {
            if let Some(message) = self.messages[source].pop_front() {
                return message;
            }
            let Some(message) = self.simulation.next_message() else {
                panic!("the simulated path has ended")
            };
            self.messages[usize::from(message.source)].push_back(message.bytes.to_vec());
        }
    }

    /// Runs the loop until `ended` returns true or the time limit is reached. Returns the last result of `ended`.
    fn run(&mut self, time: DurNs, ended: &dyn Fn(&Loop, &[Status]) -> bool) -> bool {
        let until = now() + time;
        let has_ended = Cell::new(false);
        let said = RefCell::new(std::mem::take(&mut self.said));
        self.supervisor.run(&mut self.dive, &|| has_ended.get() || now() >= until, &mut |dive| {
            while let Some(status) = self.supervisor.next_status() {
                println!("sensor {}: {status}", status.source);
                said.borrow_mut().push(status);
            }
            has_ended.set(ended(dive, &said.borrow()));
        });
        self.said = said.into_inner();
        has_ended.get()
    }

    #[track_caller]
    fn wait(&mut self, what: &str, ended: &dyn Fn(&Loop, &[Status]) -> bool) {
        assert!(
            self.run(LONG, ended),
            "{what}: not reached within {} s; {:?}",
            LONG.as_secs_f64(),
            self.said
        );
    }

    /// Waits until a sensor has this status.
    #[track_caller]
    fn wait_for(&mut self, source: usize, phase: Phase, words: &str) {
        self.wait(words, &|_, said| {
            let last = said.iter().rfind(|status| status.source == source);
            last.is_some_and(|last| last.phase == phase && last.words.contains(words))
        });
    }

    fn good(&self, source: usize) -> u64 {
        self.dive.decoder_counts()[source].good_frames
    }

    /// Runs the loop until no more data of a sensor arrives; returns the number of decoded frames.
    fn settle(&mut self, source: usize) -> u64 {
        loop {
            let good = self.good(source);
            if !self.run(SETTLED, &|dive, _| dive.decoder_counts()[source].good_frames != good) {
                return good;
            }
        }
    }

    fn send(&mut self, source: usize, stand: &mut EmulatedPort, count: usize) {
        for _ in 0..count {
            let message = self.next_message(source);
            stand.write(&message).unwrap();
        }
    }

    /// Sends messages to a sensor's driver until the loop gets one, because messages that are sent before the line is
    /// open are lost.
    #[track_caller]
    fn call(&mut self, source: usize, stand: &mut EmulatedPort) {
        let before = self.settle(source);
        let until = now() + LONG;
        while self.good(source) == before {
            assert!(now() < until, "no message of sensor {source} arrives: {:?}", self.said);
            self.send(source, stand, 1);
            self.run(DurNs::from_millis(50), &|_, _| false);
        }
    }

    /// Sends `count` messages and checks that the program decodes all of them and nothing else.
    #[track_caller]
    fn exactly(&mut self, source: usize, stand: &mut EmulatedPort, count: usize) {
        let before = self.settle(source);
        self.exactly_after(before, source, stand, count);
    }

    /// As [`Self::exactly`], but sends without waiting for the line to be silent. `before` messages have already been
    /// decoded.
    #[track_caller]
    fn exactly_after(&mut self, before: u64, source: usize, stand: &mut EmulatedPort, count: usize) {
        for burst in (0..count).step_by(BURST) {
            let size = BURST.min(count - burst);
            self.send(source, stand, size);
            let wanted = before + (burst + size) as u64;
            self.wait("a burst is decoded", &|dive, _| dive.decoder_counts()[source].good_frames >= wanted);
        }
        assert_eq!(self.settle(source) - before, count as u64, "sensor {source}");
    }

    /// Whether the sensor's line has never been interrupted.
    fn is_undisturbed(&self, source: usize) -> bool {
        let mut said = self.said.iter().filter(|status| status.source == source);
        said.all(|status| matches!(status.phase, Phase::Running | Phase::Silent))
    }

    /// Ends the rehearsal and checks that no bad frame was received.
    fn end(mut self) -> Vec<LineHistory> {
        let histories = self.supervisor.stop(&mut self.dive, &mut |_| ());
        for (counts, history) in self.dive.decoder_counts().iter().zip(&histories) {
            println!("{counts:?} {history:?}");
            assert_eq!((counts.bad_frames, counts.skipped_bytes, history.dropped), (0, 0, 0));
        }
        histories
    }
}

fn unchanged(_: usize, driver: Box<dyn Driver>) -> Box<dyn Driver> {
    driver
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn every_can_frame_and_every_hid_report_is_decoded() {
    let _vcan = Interface::up("vcan1");
    let (mut imu, mut tether) = (EmulatedPort::can("vcan1").unwrap(), counter("HR-0001"));
    let mut rehearsal = Rehearsal::new(["can:vcan1", COUNTER], &unchanged);
    rehearsal.call(IMU, &mut imu);
    rehearsal.call(TETHER, &mut tether);
    rehearsal.exactly(IMU, &mut imu, 1000);
    rehearsal.exactly(TETHER, &mut tether, 500);
    rehearsal.wait_for(IMU, Phase::Running, "");
    rehearsal.wait_for(TETHER, Phase::Running, "");
    let histories = rehearsal.end();
    assert!(histories.iter().all(|history| history.lost == 0), "{histories:?}");
}

/// A slow driver. It records the timestamp of each message and the time at which it read the message.
struct Dawdler {
    driver: Box<dyn Driver>,
    noted: Arc<SegQueue<(MonoNs, MonoNs)>>,
}

const DAWDLING: Duration = Duration::from_millis(5);

impl Driver for Dawdler {
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.driver.opened(now, wire);
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        self.noted.push((received, now()));
        thread::sleep(DAWDLING);
        self.driver.heard(received, bytes, wire);
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.driver.accepts(bytes)
    }

    fn due(&self) -> Option<MonoNs> {
        self.driver.due()
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.driver.wake(now, wire);
    }

    fn health(&self) -> DeviceHealth {
        self.driver.health()
    }
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn late_read_does_not_change_a_frame_timestamp() {
    let _vcan = Interface::up("vcan2");
    let mut imu = EmulatedPort::can("vcan2").unwrap();
    let noted = Arc::new(SegQueue::new());
    let dawdle = |source, driver| -> Box<dyn Driver> {
        if source == IMU { Box::new(Dawdler { driver, noted: Arc::clone(&noted) }) } else { driver }
    };
    let mut rehearsal = Rehearsal::new(["can:vcan2", COUNTER], &dawdle);
    rehearsal.call(IMU, &mut imu);
    rehearsal.settle(IMU);
    while noted.pop().is_some() {}

    let begun = now();
    rehearsal.send(IMU, &mut imu, BURST);
    let sent = now();
    rehearsal.settle(IMU);
    let all: Vec<(MonoNs, MonoNs)> = std::iter::from_fn(|| noted.pop()).collect();
    let late: Vec<f64> = all.iter().map(|(stamp, read)| read.since(*stamp).as_secs_f64() * 1e3).collect();
    println!(
        "CAN: sent in {} ms; read ms after its stamp: {late:.1?}",
        sent.since(begun).as_secs_f64() * 1e3
    );
    assert_eq!(all.len(), BURST);
    // The tolerance is needed because the timestamps come from another clock, and two clocks can't be read at the same
    // moment.
    let slack = DurNs::from_millis(2);
    for (number, (stamp, read)) in all.iter().enumerate() {
        assert!(
            stamp.since(begun) > DurNs(-slack.0) && stamp.since(sent) < slack,
            "frame {number}: {stamp:?}"
        );
        let least = DurNs::from_millis(5 * number as i64) - sent.since(begun) - slack;
        assert!(read.since(*stamp) > least, "frame {number} has the time of its reading");
    }
    rehearsal.end();
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn every_frame_is_read_after_a_can_interface_was_down() {
    let vcan = Interface::up("vcan3");
    let (mut imu, mut tether) = (EmulatedPort::can(vcan.0).unwrap(), counter("HR-0001"));
    let mut rehearsal = Rehearsal::new(["can:vcan3", COUNTER], &unchanged);
    rehearsal.call(IMU, &mut imu);
    rehearsal.call(TETHER, &mut tether);
    for round in 0..2 {
        println!("round {round}");
        rehearsal.exactly(IMU, &mut imu, 100);
        rehearsal.wait_for(IMU, Phase::Running, "");
        ip_link("set vcan3 down");
        rehearsal.wait_for(
            IMU,
            Phase::Closed,
            "opening vcan3: the interface is down; sudo ip link set vcan3 up",
        );
        // Messages that the inertial unit sends during the outage are lost. The second outage is longer than the
        // silence timeout.
        rehearsal.send(IMU, &mut imu, 3);
        rehearsal.exactly(TETHER, &mut tether, 60);
        if round == 1 {
            for _ in 0..6 {
                rehearsal.exactly(TETHER, &mut tether, 5);
                rehearsal.run(DurNs::from_millis(800), &|_, _| false);
            }
        }
        let before = rehearsal.settle(IMU);
        ip_link("set vcan3 up");
        rehearsal.exactly_after(before, IMU, &mut imu, 100);
        rehearsal.wait_for(IMU, Phase::Running, "");
    }
    assert!(rehearsal.is_undisturbed(TETHER), "{:?}", rehearsal.said);
    let histories = rehearsal.end();
    assert_eq!(histories.iter().map(|history| history.opened).collect::<Vec<_>>(), [1, 1]);
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn inertial_unit_on_a_down_interface_is_read_once_the_interface_is_up() {
    let vcan = Interface::up("vcan4");
    ip_link("set vcan4 down");
    let mut rehearsal = Rehearsal::new(["can:vcan4", COUNTER], &unchanged);
    rehearsal.wait_for(IMU, Phase::Closed, "opening vcan4: the interface is down; sudo ip link set vcan4 up");
    rehearsal.wait_for(TETHER, Phase::Closed, "hid:1209:0001:HR-0001: no such device is plugged in");
    ip_link("set vcan4 up");
    let mut imu = EmulatedPort::can(vcan.0).unwrap();
    rehearsal.exactly(IMU, &mut imu, 40);
    rehearsal.wait_for(IMU, Phase::Running, "");
    rehearsal.end();
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn replugged_can_adapter_is_used_again() {
    let vcan = Interface::up("vcan6");
    let (mut imu, mut tether) = (EmulatedPort::can(vcan.0).unwrap(), counter("HR-0001"));
    let mut rehearsal = Rehearsal::new(["can:vcan6", COUNTER], &unchanged);
    rehearsal.call(IMU, &mut imu);
    rehearsal.call(TETHER, &mut tether);
    rehearsal.exactly(IMU, &mut imu, 100);
    rehearsal.wait_for(IMU, Phase::Running, "");
    drop(vcan);
    rehearsal.wait_for(IMU, Phase::Closed, "opening vcan6: there is no such CAN interface");
    let lost = |status: &Status| status.source == IMU && status.words.starts_with("lost can:vcan6: ");
    assert!(rehearsal.said.iter().any(lost), "{:?}", rehearsal.said);
    rehearsal.send(IMU, &mut imu, 3);
    rehearsal.exactly(TETHER, &mut tether, 60);
    let vcan = Interface::up("vcan6");
    // The emulated inertial unit opened its end of the line before the interface was made again. This end still works.
    rehearsal.call(IMU, &mut imu);
    rehearsal.exactly(IMU, &mut imu, 100);
    rehearsal.wait_for(IMU, Phase::Running, "");
    assert!(rehearsal.is_undisturbed(TETHER), "{:?}", rehearsal.said);
    let histories = rehearsal.end();
    let been: Vec<_> = histories.iter().map(|history| (history.opened, history.lost)).collect();
    assert_eq!(been, [(2, 1), (1, 0)]);
    drop(vcan);
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn replugged_counter_is_used_again_under_another_device_number() {
    let _vcan = Interface::up("vcan7");
    let (mut imu, mut tether) = (EmulatedPort::can("vcan7").unwrap(), counter("HR-0001"));
    let first = path("HR-0001");
    let mut rehearsal = Rehearsal::new(["can:vcan7", COUNTER], &unchanged);
    rehearsal.call(IMU, &mut imu);
    rehearsal.call(TETHER, &mut tether);
    rehearsal.exactly(TETHER, &mut tether, 100);
    rehearsal.wait_for(TETHER, Phase::Running, "");
    drop(tether);
    rehearsal.wait_for(TETHER, Phase::Closed, "no such device is plugged in");
    let lost =
        |status: &Status| status.source == TETHER && status.words.starts_with("lost hid:1209:0001:HR-0001: ");
    assert!(rehearsal.said.iter().any(lost), "{:?}", rehearsal.said);
    rehearsal.exactly(IMU, &mut imu, 100);

    // Another counter takes the device number of the first one. The first counter gets a new number, and is still the
    // only one that is read.
    let mut other = counter("HR-0002");
    assert_eq!(path("HR-0002"), first);
    let mut tether = counter("HR-0001");
    assert_ne!(path("HR-0001"), first);
    rehearsal.call(TETHER, &mut tether);
    rehearsal.send(TETHER, &mut other, 5);
    rehearsal.exactly(TETHER, &mut tether, 100);
    rehearsal.wait_for(TETHER, Phase::Running, "");
    assert!(rehearsal.is_undisturbed(IMU), "{:?}", rehearsal.said);
    let histories = rehearsal.end();
    let been: Vec<_> = histories.iter().map(|history| (history.opened, history.lost)).collect();
    assert_eq!(been, [(1, 0), (2, 1)]);
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn two_equal_counters_are_distinguished_by_serial_number() {
    let (first, mut second) = (counter("HR-0001"), counter("HR-0002"));
    let paths = [path("HR-0001"), path("HR-0002")];
    let mut rehearsal = Rehearsal::new(["can:vcan0", "hid:1209:0001"], &unchanged);
    rehearsal.wait_for(TETHER, Phase::Closed, "there are several");
    let words = &rehearsal.said.iter().rfind(|status| status.source == TETHER).unwrap().words;
    assert!(paths.iter().all(|path| words.contains(path.as_str())), "{paths:?}: {words}");
    assert!(words.ends_with("add the serial number to connect"), "{words}");
    drop(first);
    rehearsal.call(TETHER, &mut second);
    rehearsal.exactly(TETHER, &mut second, 20);
    rehearsal.end();
}

/// A child process that ends with its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        if let Err(error) = self.0.kill() {
            println!("ending a process: {error}");
        }
        self.0.wait().unwrap();
    }
}

#[test]
#[ignore = "needs a kernel with vcan and uhid: tests/vm/run"]
fn rehearsal_and_dive_connect_by_kernel_can_and_hid() {
    let folder = Folder::new();
    let connected = VEHICLE
        .replace("plugin = \"ping1d\"", "plugin = \"ping1d\"\nconnect = \"udp:192.168.2.2:9090\"")
        .replace("plugin = \"bar100\"", "plugin = \"bar100\"\nconnect = \"i2c:/dev/i2c-1:0x40\"")
        .replace("plugin = \"imu_can\"", "plugin = \"imu_can\"\nconnect = \"can:vcan0\"")
        .replace("plugin = \"tether_hid\"", "plugin = \"tether_hid\"\nconnect = \"hid:1209:0001\"");
    folder.write("vehicle.toml", connected);
    folder.write("scene.toml", headrace_tests::SCENE.replace("distance_m = 4", "distance_m = 0.6"));
    let emulate = headrace_tests::program()
        .args(["emulate", "scene.toml", "--out", "rehearsal", "--stand", "1", "--linger", "60"])
        .current_dir(folder.path(""))
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut emulate = Process(emulate);
    let mut lines = BufReader::new(emulate.0.stdout.take().unwrap()).lines();
    let mut connects = Vec::new();
    let file = loop {
        let line = lines.next().expect("the rehearsal has ended").unwrap();
        println!("emulate: {line}");
        match line.strip_prefix("vehicle ") {
            Some(file) => break file.to_owned(),
            None => connects.push(line.split_whitespace().map(str::to_owned).collect::<Vec<_>>()),
        }
    };
    for wanted in [["imu", "can:vcan0"], ["tether", "hid:1209:0001"]] {
        assert!(connects.iter().any(|connect| connect[..] == wanted), "{wanted:?}: {connects:?}");
    }
    let text = String::from_utf8(folder.read(&file)).unwrap();
    assert!(text.contains("\"can:vcan0\"") && text.contains("\"hid:1209:0001\""), "{text}");

    let answer =
        folder.headrace(&["run", &file, "--require", "imu,tether", "--for", "8", "--no-record", "--json"]);
    println!("run: {:?}\n{}", answer.code, answer.stderr);
    let report: Value = serde_json::from_str(&answer.stdout).unwrap();
    for id in ["imu", "tether"] {
        let sources = report["sources"].as_array().unwrap();
        let source = sources.iter().find(|source| source["id"] == id).unwrap();
        println!("{source}");
        assert_eq!(source["bad_frames"], 0);
        assert_eq!(source["skipped_bytes"], 0);
        assert!(source["frames"].as_u64().unwrap() > 50, "{source}");
        assert_eq!(source["line"]["status"], "running");
        assert_eq!((&source["line"]["opened"], &source["line"]["lost"]), (&Value::from(1), &Value::from(0)));
    }
}
