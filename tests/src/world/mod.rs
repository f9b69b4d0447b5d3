//! A simulated world for faults: the true drivers, line services, loop and recorder on devices, cables, a disk and a clock that
//! fail as one seed says. No thread, no port, no time but the world's: a seed that fails does so again.

pub mod cable;
pub mod device;
// pub mod disk;
pub mod plan;

use std::fmt::Write as _;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use headrace::devices::KINDS;
use headrace_config::Document;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::merge::Inbox;
use headrace_monitor::run::Loop;
use headrace_ports::{Attached, Board, Common, LineHistory, LineService};
use headrace_sensor::connect::Connect;
use headrace_sensor::device::EmulatorSetup;
use headrace_sensor::driver::DriverSetup;
use headrace_vehicle::VehicleConfig;

use crate::random::Random;
use cable::{Cable, Clock, Machine};
use device::Device;
use plan::{BEGIN, Ending, MachineFault, Plan};

/// Longest step of the world.
const LONGEST_STEP_NS: usize = 12_000_000;
/// How long a finished dive waits for what is under way.
const PATIENCE: DurNs = DurNs::from_millis(4_000);

const TUNNEL: &str = r#"name = "a world of faults"
target_m = 1.2

[tunnel]
profile = "circle"
radius_m = 3
length_m = 40

[water]
surface_above_floor_m = 8

[heads]
planned_speed_mps = 0.2
"#;

/// The sensors, by the tables of the vehicle file.
const SENSORS: [&str; 6] = [
    "plugin = \"imagenex881\"\nconnect = \"tcp:10.0.0.1:4040\"\nmode = \"fastest\"\nrange_m = 5\n",
    "plugin = \"imagenex881\"\nconnect = \"serial:/dev/ttyS1\"\nmode = \"fastest\"\nrange_m = 5\n",
    "plugin = \"ping1d\"\nconnect = \"serial:/dev/ttyS2\"\nangles_deg = [0, 0, 90]\n",
    "plugin = \"bar100\"\nconnect = \"udp:10.0.0.2:9000\"\n",
    "plugin = \"imu_can\"\nconnect = \"udp:10.0.0.2:9001\"\npreset = \"xsens_mti600\"\n",
    "plugin = \"tether_hid\"\nconnect = \"udp:10.0.0.2:9002\"\ncounts_per_metre = 2000\n",
];

/// The vehicle file of all worlds.
pub fn vehicle_text() -> String {
    let mut text = TUNNEL.to_owned();
    for (number, sensor) in SENSORS.iter().enumerate() {
        write!(text, "\n[[sensors]]\nid = \"s{number}\"\n{sensor}").unwrap();
    }
    text
}

/// A packet as the loop took it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consumed {
    /// Its source.
    pub source: u16,
    /// Receive time.
    pub received: MonoNs,
    /// Content.
    pub bytes: Vec<u8>,
}

/// A dive in a world.
pub struct World {
    random: Random,
    clock: Arc<Clock>,
    plan: Plan,
    devices: Vec<Device>,
    services: Vec<LineService>,
    board: Board,
    dive: Loop,
    consumed: Vec<Consumed>,
}

/// What a dive has come to.
pub struct Lived {
    /// What went wrong.
    pub plan: Plan,
    /// All that the loop took, in its order.
    pub consumed: Vec<Consumed>,
    /// Digest of the results.
    pub digest: u64,
    /// By device.
    pub lines: Vec<Line>,
}

/// What came of a device's line.
#[derive(Debug)]
pub struct Line {
    /// Nothing happened to it.
    pub untouched: bool,
    /// Its cable only cut and delayed.
    pub lossless: bool,
    /// Frames that it sent whole.
    pub whole: u64,
    /// Good frames that the loop found.
    pub good: u64,
    /// Its line's history.
    pub history: LineHistory,
}

impl World {
    /// The world of a seed, before the dive.
    pub fn new(seed: u64) -> Self {
        let mut random = Random(seed);
        let text = vehicle_text();
        let document = Document::new("vehicle.toml", &text);
        let vehicle = VehicleConfig::parse(document, &KINDS, &|_| unreachable!("no file is named")).unwrap();
        let clock = Arc::new(Clock::default());
        clock.set(BEGIN);
        let connect = |source: usize| Connect::parse(&vehicle.sensor_configs[source].connect).unwrap();
        let cables: Vec<Arc<Cable>> =
            (0..SENSORS.len()).map(|source| Arc::new(Cable::new(connect(source)))).collect();
        let streams: Vec<bool> =
            cables.iter().map(|cable| !matches!(cable.connect, Connect::Udp { .. })).collect();
        let plan = Plan::draw(&mut random, &streams);
        let mut app = App::new(vehicle.mission());
        for sensor in &vehicle.sensors {
            app.add_device(sensor.as_ref()).unwrap();
        }
        let mut dive = app.arm(vehicle.navigation()).unwrap();
        let board = Board::new(1 << 16);
        let waker = crossbeam::sync::Parker::new().unparker().clone();
        let common = Common {
            host: Arc::new(Machine { clock: Arc::clone(&clock), cables: cables.clone() }),
            stopping: Arc::new(AtomicBool::new(false)),
            board: board.clone(),
            waker,
            sent: None,
        };
        let mut programs = vehicle.programs().unwrap().into_iter();
        let (mut devices, mut services) = (Vec::new(), Vec::new());
        for (source, (sensor, cable)) in vehicle.sensors.iter().zip(cables).enumerate() {
            let head = sensor.head().and_then(|_| programs.next());
            let setup = EmulatorSetup { start: BEGIN, head, site: vehicle.site, polled: false };
            let driver = sensor.driver(&DriverSetup { begun: BEGIN, head });
            let attached = Attached { source, port: dive.take_port(source).unwrap(), driver };
            services.push(LineService::new(Ok(cable.connect.clone()), vec![attached], common.clone()));
            let faults = plan.cables[source].clone();
            devices.push(Device::new(sensor.emulator(&setup), cable, faults, Random(random.bits())));
        }
        Self { random, clock, plan, devices, services, board, dive, consumed: Vec::new() }
    }

    /// Lets the dive happen.
    pub fn live(mut self) -> Lived {
        while self.clock.now() < self.plan.end {
            self.step(false);
        }
        if self.plan.ending == Ending::Finished {
            let patience = self.clock.now() + PATIENCE;
            while self.clock.now() < patience {
                self.step(true);
            }
        }
        let Self { services, mut dive, devices, plan, mut consumed, .. } = self;
        let histories: Vec<LineHistory> =
            services.into_iter().flat_map(|service| service.end()).map(|(_, history)| history).collect();
        if plan.ending == Ending::Finished {
            let now = self.clock.now();
            while dive.has_waiting() {
                dive.tick(now);
                note(&dive, &mut consumed);
            }
            dive.finish(&mut |_, _| ());
        }
        let good: Vec<u64> = dive.decoder_counts().iter().map(|counts| counts.good_frames).collect();
        let lines = devices.iter().zip(good).zip(histories).map(|((device, good), history)| Line {
            untouched: device.is_untouched(),
            lossless: device.is_lossless(),
            whole: device.whole(),
            good,
            history,
        });
        Lived { lines: lines.collect(), digest: dive.digest(), plan, consumed }
    }

    fn step(&mut self, quiet: bool) {
        let now = self.clock.now() + DurNs(1 + self.random.below(LONGEST_STEP_NS) as i64);
        self.clock.set(now);
        for device in &mut self.devices {
            device.step(now, quiet);
        }
        if !self.plan.has(MachineFault::PortsStall, now) {
            for (service, device) in self.services.iter_mut().zip(&self.devices) {
                serve(service, device.cable(), now);
            }
        }
        if !self.plan.has(MachineFault::LoopStalls, now) {
            self.dive.tick(now);
            note(&self.dive, &mut self.consumed);
        }
        while self.board.next().is_some() {}
    }
}

/// What a service's thread would do until it waits.
fn serve(service: &mut LineService, cable: &Cable, now: MonoNs) {
    // A step reads once; a driver that is due at once for ever would hold the thread, too.
    for _ in 0..10_000 {
        let due = match service.closed_until() {
            Some(until) => until <= now,
            None => {
                !cable.to_host.is_empty() || !cable.is_open() || service.due().is_some_and(|due| due <= now)
            }
        };
        if !due {
            return;
        }
        service.step();
    }
    panic!("a line is due without end");
}

fn note(dive: &Loop, consumed: &mut Vec<Consumed>) {
    let inbox = dive.resource::<Inbox>().unwrap();
    consumed.extend(inbox.iter().map(|(source, packet)| Consumed {
        source: source.0,
        received: packet.received,
        bytes: packet.bytes.to_vec(),
    }));
}
