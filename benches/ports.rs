//! Delay of bytes on their way from a device to the loop's ring, and the CPU time of serving ports. Prints Markdown.
//!
//! Each figure is compared with that of a bare read loop, which runs at the same time on another port of the same kind.
//! `cargo bench -p headrace_tests --bench ports` takes about two minutes; `-- 20` makes each part last twenty seconds.
//! The parts are `-- latency`, `-- flag` and `-- cpu`. `flag` measures the time from the last byte of a return to the
//! display of its flag at the end of the tick. It does so on idle and on busy cores. A thread of this process emulates
//! the devices at their own rates. CAN (vcan0, up) and HID (`/dev/uhid`) are measured only where available, for
//! instance in `tests/vm`. Absolute times drift on shared machines, mostly the longest ones.

#![expect(clippy::unwrap_used, reason = "a failed step ends the benchmark")]
#![expect(clippy::panic, reason = "the same")]

use std::collections::VecDeque;
use std::io::Read as _;
use std::net::{IpAddr, Ipv4Addr, TcpStream, UdpSocket};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use crossbeam::queue::SegQueue;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_ports::{Connection, EmulatedPort, Supervisor, now, wait_for_any};
use headrace_sensor::connect::{Connect, SerialPort, UsbIdentity};
use headrace_sensor::device::Direction;
use headrace_sensor::driver::{Carrier, DeviceHealth, Driver, DriverSetup, Wire};
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::scenes;

const LOCAL: IpAddr = IpAddr::V4(Ipv4Addr::LOCALHOST);
/// Time for all lines to open and for the heads to reach their start angles.
const WARMING: DurNs = DurNs::from_millis(10_000);
/// Default duration of each part, s.
const MEASURED_S: u64 = 60;
/// Longest time for which an emulated device waits for bytes from the host, ns.
const WAIT_NS: u32 = 1_000_000;

const WAY: &str = "[trajectory]\n[[trajectory.legs]]\ndistance_m = 60\nspeed_mps = 0.1\n";

const TUNNEL: &str = "name = \"ports\"\ntarget_m = 1\n[tunnel]\nprofile = \"circle\"\nradius_m = 3\nlength_m = 100\n\
    [water]\nsound_speed_mps = 1447\n[heads]\nplanned_speed_mps = 0.1\n";

/// Measured ports, each with name, carrier and keys in a vehicle file.
const LINES: [(&str, Carrier, &str); 10] = [
    ("881, returns of 13 bytes", Carrier::Serial, "plugin = \"imagenex881\"\nmode = \"fast\"\nrange_m = 10"),
    (
        "881, returns of 265 bytes",
        Carrier::Serial,
        "plugin = \"imagenex881\"\nmode = \"fast\"\nrange_m = 10\nreturns = \"imx\"",
    ),
    ("881, returns of 13 bytes", Carrier::Tcp, "plugin = \"imagenex881\"\nmode = \"fast\"\nrange_m = 10"),
    (
        "881, returns of 265 bytes",
        Carrier::Tcp,
        "plugin = \"imagenex881\"\nmode = \"fast\"\nrange_m = 10\nreturns = \"imx\"",
    ),
    ("Ping frames", Carrier::Udp, "plugin = \"ping1d\"\nangles_deg = [0, 0, 90]"),
    ("Ping frames", Carrier::Serial, "plugin = \"ping1d\"\nangles_deg = [0, 0, -90]"),
    ("CAN frames of an Xsens", Carrier::Udp, "plugin = \"imu_can\"\npreset = \"xsens_mti600\""),
    ("reports of a cable counter", Carrier::Udp, "plugin = \"tether_hid\"\ncounts_per_metre = 2000"),
    ("CAN frames of an Xsens", Carrier::Can, "plugin = \"imu_can\"\npreset = \"xsens_mti600\""),
    ("reports of a cable counter", Carrier::Hid, "plugin = \"tether_hid\"\ncounts_per_metre = 2000"),
];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let seconds = words.iter().find_map(|word| word.parse().ok()).unwrap_or(MEASURED_S);
    let names: Vec<&String> = words.iter().filter(|word| word.parse::<u64>().is_err()).collect();
    let wanted = |name: &str| names.is_empty() || names.iter().any(|word| *word == name);
    let (arch, os) = (std::env::consts::ARCH, std::env::consts::OS);
    let cores = thread::available_parallelism().map_or(0, std::num::NonZero::get);
    println!(
        "{}, {cores} cores, {arch} {os}, {}, commit {}, {seconds} s a part\n",
        cpu(),
        answer("rustc", &["--version"]),
        commit()
    );
    if wanted("latency") {
        latency(Duration::from_secs(seconds));
    }
    if wanted("flag") {
        flags(Duration::from_secs(seconds));
    }
    if wanted("cpu") {
        four_heads(Duration::from_secs(seconds));
    }
}

fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model =
        info.lines().find_map(|line| line.strip_prefix("model name")).unwrap_or(": unknown processor");
    model.trim_start_matches(['\t', ' ', ':']).to_owned()
}

fn commit() -> String {
    answer("git", &["-C", env!("CARGO_MANIFEST_DIR"), "describe", "--always", "--dirty"])
}

/// Output of a program, or a note if the program is missing.
fn answer(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).output();
    let said = output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned());
    said.ok().filter(|said| !said.is_empty()).unwrap_or_else(|| format!("unknown ({program} doesn't say)"))
}

/// Messages that are on their way from a device to the loop, with their send times. Also the delays that have been
/// measured so far.
#[derive(Clone, Default)]
struct Course {
    sent: Arc<SegQueue<(MonoNs, Vec<u8>)>>,
    delays: Arc<SegQueue<DurNs>>,
    /// Send times of messages that the loop hasn't consumed yet. `ends` has the delay of each consumed message up to
    /// the end of its tick.
    to_consume: Arc<SegQueue<MonoNs>>,
    ends: Arc<SegQueue<DurNs>>,
}

/// Receiving end of a [`Course`].
struct Finish {
    course: Course,
    waiting: VecDeque<(MonoNs, Vec<u8>)>,
}

impl Finish {
    fn new(course: &Course) -> Self {
        Self { course: course.clone(), waiting: VecDeque::new() }
    }

    /// Returns the send time of a received message. Messages that were sent earlier, but haven't been received yet,
    /// count as lost.
    fn sent(&mut self, bytes: &[u8]) -> Option<MonoNs> {
        self.look();
        let position = self.waiting.iter().position(|(_, message)| message == bytes)?;
        self.waiting.drain(..position);
        self.waiting.pop_front().map(|(sent, _)| sent)
    }

    fn look(&mut self) {
        self.waiting.extend(std::iter::from_fn(|| self.course.sent.pop()));
    }

    /// Length of the next message that hasn't been received yet, bytes.
    fn next_len(&mut self) -> Option<usize> {
        self.look();
        self.waiting.front().map(|(_, message)| message.len())
    }
}

/// A driver whose deliveries are timestamped.
struct Timed {
    driver: Box<dyn Driver>,
    finish: Finish,
}

struct TimedWire<'a> {
    wire: &'a mut dyn Wire,
    finish: &'a mut Finish,
}

impl Wire for TimedWire<'_> {
    fn send(&mut self, bytes: &[u8]) {
        self.wire.send(bytes);
    }

    fn exchange(&mut self, write: &[u8], settle: DurNs, read_bytes: usize) {
        self.wire.exchange(write, settle, read_bytes);
    }

    fn deliver(&mut self, received: MonoNs, bytes: &[u8]) {
        let sent = self.finish.sent(bytes);
        // The send time is recorded before the loop can see the message. Data that was never sent gets its delivery
        // time instead, but lines without faults carry no such data.
        self.finish.course.to_consume.push(sent.unwrap_or_else(now));
        self.wire.deliver(received, bytes);
        if let Some(sent) = sent {
            self.finish.course.delays.push(now().since(sent));
        }
    }
}

impl Timed {
    fn with(&mut self, wire: &mut dyn Wire, call: impl FnOnce(&mut dyn Driver, &mut dyn Wire)) {
        call(self.driver.as_mut(), &mut TimedWire { wire, finish: &mut self.finish });
    }
}

impl Driver for Timed {
    fn opened(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.with(wire, |driver, wire| driver.opened(now, wire));
    }

    fn heard(&mut self, received: MonoNs, bytes: &[u8], wire: &mut dyn Wire) {
        self.with(wire, |driver, wire| driver.heard(received, bytes, wire));
    }

    fn accepts(&self, bytes: &[u8]) -> bool {
        self.driver.accepts(bytes)
    }

    fn due(&self) -> Option<MonoNs> {
        self.driver.due()
    }

    fn wake(&mut self, now: MonoNs, wire: &mut dyn Wire) {
        self.with(wire, |driver, wire| driver.wake(now, wire));
    }

    fn awaits(&self) -> bool {
        self.driver.awaits()
    }

    fn silence_timeout(&self) -> DurNs {
        self.driver.silence_timeout()
    }

    fn health(&self) -> DeviceHealth {
        self.driver.health()
    }
}

/// The bare read loop, which is the reference. It reads data as it arrives and records the delays.
fn bare(connect: &Connect, finish: Finish) {
    match connect {
        Connect::Serial { port: SerialPort::Path(path), .. } => {
            let mut file = std::fs::File::open(path).unwrap();
            bare_reads(finish, |buffer| file.read(buffer).unwrap_or(0));
        }
        Connect::Tcp { address } => {
            let mut stream = TcpStream::connect(address).unwrap();
            bare_reads(finish, |buffer| stream.read(buffer).unwrap_or(0));
        }
        Connect::Udp { address } => {
            let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
            socket.connect(address).unwrap();
            socket.send(&[]).unwrap();
            bare_reads(finish, |buffer| socket.recv(buffer).unwrap_or(0));
        }
        #[cfg(target_os = "linux")]
        Connect::Can { interface } => {
            let mut socket = <socketcan::CanSocket as socketcan::Socket>::open(interface).unwrap();
            bare_reads(finish, |buffer| socket.read(buffer).unwrap_or(0));
        }
        #[cfg(target_os = "linux")]
        Connect::Hid(identity) => {
            let device = (0..1000).find_map(|_| {
                thread::sleep(Duration::from_millis(10));
                let api = hidapi::HidApi::new().unwrap();
                api.open_serial(identity.vendor, identity.product, identity.serial.as_deref()?).ok()
            });
            let device = device.unwrap();
            bare_reads(finish, |buffer| device.read(buffer).unwrap_or(0));
        }
        other => panic!("no yardstick on {other}"),
    }
}

fn bare_reads(mut finish: Finish, mut read: impl FnMut(&mut [u8]) -> usize) {
    let (mut buffer, mut held) = ([0; 2048], Vec::new());
    let empty_loop = empty_loop(&finish.course);
    loop {
        let count = read(&mut buffer);
        let at = now();
        // A count of zero means end of file, because the device's end of the line is closed after the measurement.
        if count == 0 {
            return;
        }
        held.extend_from_slice(&buffer[..count]);
        while let Some(len) = finish.next_len().filter(|len| held.len() >= *len) {
            if let Some(sent) = finish.sent(&held[..len]) {
                finish.course.to_consume.push(sent);
                finish.course.delays.push(at.since(sent));
            }
            held.drain(..len);
        }
        empty_loop.unpark();
    }
}

/// Starts a thread that is woken like the program's loop. It only records the delays of messages.
fn empty_loop(course: &Course) -> thread::Thread {
    let course = course.clone();
    let empty = named("empty", move || {
        loop {
            thread::park();
            while let Some(sent) = course.to_consume.pop() {
                course.ends.push(now().since(sent));
            }
        }
    });
    empty.thread().clone()
}

/// The device's ends of the two ports of a sensor. One port belongs to the driver, the other one to the reference. On a
/// bus, driver and reference receive from the same port.
struct Ends {
    ours: EmulatedPort,
    twin: Option<EmulatedPort>,
    courses: [Course; 2],
}

impl Ends {
    fn new(carrier: Carrier, number: usize, descriptor: Option<&[u8]>) -> std::io::Result<Self> {
        let hid = |name: &str| {
            let serial = Some(format!("{name}-{number}"));
            EmulatedPort::hid(
                &UsbIdentity { vendor: 0x1209, product: 1, serial },
                descriptor.unwrap_or_default(),
            )
        };
        let (ours, twin) = match carrier {
            Carrier::Hid => (hid("ours")?, Some(hid("twin")?)),
            Carrier::Can => (EmulatedPort::new(carrier, LOCAL)?, None),
            _ => (EmulatedPort::new(carrier, LOCAL)?, Some(EmulatedPort::new(carrier, LOCAL)?)),
        };
        Ok(Self { ours, twin, courses: Default::default() })
    }

    fn twin_connect(&self) -> Connect {
        self.twin.as_ref().map_or_else(|| self.ours.connect().clone(), |twin| twin.connect().clone())
    }

    /// Writes a message to both ports. `ours_first` tells whether the driver's port is first.
    fn write(&mut self, bytes: &[u8], ours_first: bool) {
        let [ours, twin] = &self.courses;
        let write = |stand: &mut EmulatedPort, courses: &[&Course]| {
            if stand.is_called() {
                let copies: Vec<Vec<u8>> = courses.iter().map(|_| bytes.to_vec()).collect();
                let at = now();
                for (course, copy) in courses.iter().zip(copies) {
                    course.sent.push((at, copy));
                }
                stand.write(bytes).unwrap();
            }
        };
        match &mut self.twin {
            None => write(&mut self.ours, &[ours, twin]),
            Some(stand) if ours_first => {
                write(&mut self.ours, &[ours]);
                write(stand, &[twin]);
            }
            Some(stand) => {
                write(stand, &[twin]);
                write(&mut self.ours, &[ours]);
            }
        }
    }
}

/// Results of one part of the bench.
struct Measured {
    /// Delays of messages through the driver and through the bare read loop, for each sensor.
    delays: Vec<[Vec<DurNs>; 2]>,
    /// Delays of messages until the end of the tick for the driver, and until the end of a pass of the empty loop for
    /// the reference, for each sensor.
    ends: Vec<[Vec<DurNs>; 2]>,
    /// CPU time of the threads that serve ports, s. `loop_s` is the CPU time of the loop, and `bare_s` that of the bare
    /// read loops.
    ports_s: f64,
    loop_s: f64,
    bare_s: f64,
    packets: u64,
    took_s: f64,
}

/// Serves the sensors of a scene on the ports `ends`, and measures for the duration `measured`.
fn rehearse(scene: &Scene, ends: Vec<Ends>, measured: Duration) -> Measured {
    let vehicle = &scene.vehicle;
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let mut programs = vehicle.programs().unwrap().into_iter();
    let begun = now();
    let mut connections = Vec::new();
    for (source, ends) in ends.iter().enumerate() {
        let device = &vehicle.sensors[source];
        let head = device.head().and_then(|_| programs.next());
        let driver = device.driver(&DriverSetup { begun, head });
        let driver = Box::new(Timed { driver, finish: Finish::new(&ends.courses[0]) });
        let port = dive.take_port(source).unwrap();
        connections.push(Connection { source, connect: Ok(ends.ours.connect().clone()), port, driver });
        let (connect, finish) = (ends.twin_connect(), Finish::new(&ends.courses[1]));
        named(&format!("bare {source}"), move || bare(&connect, finish));
    }
    let courses: Vec<[Course; 2]> = ends.iter().map(|ends| ends.courses.clone()).collect();
    let ending = Arc::new(AtomicBool::new(false));
    let simulation = Simulation::for_hosts(scene).unwrap();
    let flag = Arc::clone(&ending);
    let devices = named("devices", move || emulate(simulation, ends, &flag));
    let flag = Arc::clone(&ending);
    let of_loop: Vec<Course> = courses.iter().map(|pair| pair[0].clone()).collect();
    let serving = named("loop", move || {
        let supervisor = Supervisor::start(connections, None).unwrap();
        let mut consumed = vec![0; of_loop.len()];
        supervisor.run(&mut dive, &|| flag.load(Ordering::Relaxed), &mut |dive| {
            let at = now();
            for ((course, consumed), counts) in of_loop.iter().zip(&mut consumed).zip(dive.decoder_counts()) {
                while *consumed < counts.good_frames {
                    *consumed += 1;
                    course.to_consume.pop().into_iter().for_each(|sent| course.ends.push(at.since(sent)));
                }
            }
        });
        supervisor.stop(&mut dive, &mut |_| ());
    });
    thread::sleep(Duration::from_secs_f64(WARMING.as_secs_f64()));
    for course in courses.iter().flatten() {
        while course.delays.pop().is_some() || course.ends.pop().is_some() {}
    }
    let (from, before) = (now(), ["line ", "loop", "bare "].map(run_s));
    thread::sleep(measured);
    let (took_s, after) = (now().since(from).as_secs_f64(), ["line ", "loop", "bare "].map(run_s));
    let taken = |queue: &SegQueue<DurNs>| {
        let mut delays: Vec<DurNs> = std::iter::from_fn(|| queue.pop()).collect();
        delays.sort_unstable();
        delays
    };
    let of_pairs = |of: fn(&Course) -> &SegQueue<DurNs>| -> Vec<[Vec<DurNs>; 2]> {
        courses.iter().map(|pair| [taken(of(&pair[0])), taken(of(&pair[1]))]).collect()
    };
    let (delays, ends) = (of_pairs(|course| &course.delays), of_pairs(|course| &course.ends));
    ending.store(true, Ordering::Relaxed);
    serving.join().unwrap();
    devices.join().unwrap();
    let packets = delays.iter().map(|pair| pair[0].len() as u64).sum();
    let [ports_s, loop_s, bare_s] = [0, 1, 2].map(|part| after[part] - before[part]);
    Measured { delays, ends, ports_s, loop_s, bare_s, packets, took_s }
}

fn named<T: Send + 'static>(name: &str, work: impl FnOnce() -> T + Send + 'static) -> thread::JoinHandle<T> {
    thread::Builder::new().name(name.to_owned()).spawn(work).unwrap()
}

/// CPU time of those threads of this process whose name begins with `beginning`, s. Source: Linux,
/// /proc/PID/task/TID/schedstat.
fn run_s(beginning: &str) -> f64 {
    let Ok(tasks) = std::fs::read_dir("/proc/self/task") else { return f64::NAN };
    let of = |task: std::fs::DirEntry| {
        let text = |name: &str| std::fs::read_to_string(task.path().join(name)).unwrap_or_default();
        let ns = text("schedstat").split(' ').next().and_then(|word| word.parse::<f64>().ok());
        if text("comm").starts_with(beginning) { ns.unwrap_or(f64::NAN) / 1e9 } else { 0.0 }
    };
    tasks.flatten().map(of).sum()
}

/// Emulates the devices. Passes hosts' requests to the simulation, and its messages to both ports of each device.
fn emulate(mut simulation: Simulation, mut ends: Vec<Ends>, ending: &AtomicBool) {
    let origin = now();
    let mut is_ours_first = false;
    simulation.set_out(START + WARMING);
    while !ending.load(Ordering::Relaxed) {
        wait_for_any(ends.iter().map(|ends| &ends.ours), WAIT_NS);
        let at = START + now().since(origin);
        for (number, ends) in ends.iter_mut().enumerate() {
            while let Some(bytes) = ends.ours.read().unwrap() {
                simulation.hear(number, at, &bytes);
            }
            if let Some(twin) = &mut ends.twin {
                while twin.read().unwrap().is_some() {}
            }
        }
        simulation.go_on(at + DurNs(1));
        while let Some(message) = simulation.waiting_message() {
            if message.direction == Direction::Received {
                is_ours_first = !is_ours_first;
                ends[usize::from(message.source)].write(message.bytes, is_ours_first);
            }
        }
    }
}

fn at(delays: &[DurNs], thousandths: usize) -> f64 {
    delays
        .get((delays.len().max(1) - 1) * thousandths / 1000)
        .map_or(f64::NAN, |delay| delay.as_secs_f64() * 1e6)
}

fn quantiles(delays: &[DurNs]) -> String {
    let [half, most, nearly, all] = [500, 990, 999, 1000].map(|thousandths| at(delays, thousandths));
    format!("{half:.0}, {most:.0}, {nearly:.0}, {all:.0}")
}

fn latency(measured: Duration) {
    println!(
        "First byte written at the device's end to packet in the loop's ring, us: p50, p99, p99.9, max\n"
    );
    println!("| what | on | messages | ours | bare read | ratio of p50, of p99 |\n|---|---|---|---|---|---|");
    let descriptor = headrace_tether_hid::report::REFERENCE_DESCRIPTOR;
    let (mut vehicle, mut ends, mut rows) = (TUNNEL.to_owned(), Vec::new(), Vec::new());
    for (number, (what, carrier, keys)) in LINES.iter().enumerate() {
        match Ends::new(*carrier, number, Some(&descriptor)) {
            Ok(open) => {
                ends.push(open);
                rows.push((*what, carrier.as_str()));
                vehicle.extend(["[[sensors]]\nid = \"", &format!("sensor_{number}"), "\"\n", keys, "\n"]);
            }
            Err(error) => println!("| {what} | {} | skipped: {error} | | | |", carrier.as_str()),
        }
    }
    let scene = scenes::scene_from(&format!("vehicle = \"vehicle.toml\"\n{WAY}"), &|_| {
        Ok(vehicle.clone().into_bytes())
    });
    let measured = rehearse(&scene, ends, measured);
    for ((what, on), [ours, bare]) in rows.iter().zip(&measured.delays) {
        let ratio = |thousandths| at(ours, thousandths) / at(bare, thousandths);
        println!(
            "| {what} | {on} | {} | {} | {} | {:.2}, {:.2} |",
            ours.len(),
            quantiles(ours),
            quantiles(bare),
            ratio(500),
            ratio(990)
        );
    }
    println!();
}

/// Measures the time from the last byte of a return until the flag that it causes is displayed at the end of the tick.
fn flags(measured: Duration) {
    println!("Last byte of a head's return written to the end of its tick, us: p50, p99, p99.9, max\n");
    println!("| cores | returns | ours | an empty loop | ours above it |\n|---|---|---|---|---|");
    let cores = thread::available_parallelism().map_or(1, std::num::NonZero::get);
    for busy in [0, cores] {
        let ending = Arc::new(AtomicBool::new(false));
        let spin = |_| {
            let ending = Arc::clone(&ending);
            named("busy", move || while !ending.load(Ordering::Relaxed) {})
        };
        let spinning: Vec<_> = (0..busy).map(spin).collect();
        let scene = scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{WAY}"));
        let ends = (0..scene.vehicle.sensors.len()).map(|number| {
            let config = &scene.vehicle.sensor_configs[number];
            let carrier = Connect::parse(&config.connect).map_or(Carrier::Udp, |connect| connect.carrier());
            let network = matches!(carrier, Carrier::Tcp | Carrier::Serial);
            Ends::new(if network { carrier } else { Carrier::Udp }, number, None).unwrap()
        });
        let results = rehearse(&scene, ends.collect(), measured);
        ending.store(true, Ordering::Relaxed);
        for thread in spinning {
            thread.join().unwrap();
        }
        let of_heads = |which: usize| {
            let sensors = scene.vehicle.sensors.iter().zip(&results.ends);
            let heads = sensors.filter(|(device, _)| device.head().is_some());
            let mut all: Vec<DurNs> = heads.flat_map(|(_, pair)| pair[which].iter().copied()).collect();
            all.sort_unstable();
            all
        };
        let (ours, empty) = (of_heads(0), of_heads(1));
        let above = |thousandths| at(&ours, thousandths) - at(&empty, thousandths);
        println!(
            "| {} | {} | {} | {} | {:.0}, {:.0}, {:.0} |",
            if busy == 0 { "idle".to_owned() } else { format!("{busy} busy loops beside") },
            ours.len(),
            quantiles(&ours),
            quantiles(&empty),
            above(500),
            above(990),
            above(999)
        );
    }
    println!();
}

fn four_heads(measured: Duration) {
    println!(
        "Share of one core, the vehicle with four heads (vita2-4.toml, 11 sensors: TCP, UDP; CAN and HID where they are)\n"
    );
    let scene = scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{WAY}"));
    let mut ends = Vec::new();
    for (number, (config, device)) in
        scene.vehicle.sensor_configs.iter().zip(&scene.vehicle.sensors).enumerate()
    {
        let carrier = Connect::parse(&config.connect).map_or(Carrier::Udp, |connect| connect.carrier());
        let descriptor = device.report_descriptor();
        let open = Ends::new(carrier, number, descriptor.as_deref());
        ends.push(open.or_else(|_| Ends::new(Carrier::Udp, number, None)).unwrap());
    }
    let measured = rehearse(&scene, ends, measured);
    let share = |seconds: f64| 100.0 * seconds / measured.took_s;
    println!(
        "| what | packets a second | share | bare reads of the same messages | ratio |\n|---|---|---|---|---|"
    );
    println!(
        "| threads of the ports | {:.0} | {:.2} % | {:.2} % | {:.2} |",
        measured.packets as f64 / measured.took_s,
        share(measured.ports_s),
        share(measured.bare_s),
        measured.ports_s / measured.bare_s
    );
    println!("| thread of the loop, whole | | {:.2} % | | |", share(measured.loop_s));
}
