//! A bench for effects: a vehicle with one or two devices of each kind, on short trajectories.

use headrace_config::Document;
use headrace_devices::KINDS;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::device::Direction;
use headrace_sensor::measurement::Measurement;

use crate::{Scene, SceneError, Simulation};

const VEHICLE: &str = r#"
target_m = 0.7

[tunnel]
profile = "ceran"
length_m = 200

[heads]
layout = "LAYOUT"
planned_speed_mps = 0.12

[[sensors]]
id = "head_a"
plugin = "imagenex881"
connect = "tcp:192.168.0.4:4040"
position_m = [0.551, 0, 0]
mode = "fast"
range_m = 10

[[sensors]]
id = "head_b"
plugin = "imagenex881"
connect = "tcp:192.168.0.5:4040"
position_m = [-0.551, 0.15, 0]
angles_deg = [0, 0, 180]
mode = "fast"
range_m = 10

[[sensors]]
id = "ping"
plugin = "ping1d"
connect = "udp:192.168.2.2:9090"

[[sensors]]
id = "depth"
plugin = "bar100"
connect = "i2c:/dev/i2c-1:0x40"

[[sensors]]
id = "imu"
plugin = "imu_can"
connect = "can:can0"
preset = "xsens_mti600"

[[sensors]]
id = "tether"
plugin = "tether_hid"
connect = "hid:1209:0001"
counts_per_metre = 2000
"#;

/// A trajectory of 35 s that leads forwards and then a little backwards.
pub(crate) const LEGS: &str = "start_m = 2.0\n[[trajectory.legs]]\ndistance_m = 6\nspeed_mps = 0.2\n\
                               [[trajectory.legs]]\ndistance_m = 1\nspeed_mps = -0.2\n";
/// A trajectory of a single leg that lasts 640 s.
pub(crate) const LONG: &str = "start_m = 2.0\n[[trajectory.legs]]\ndistance_m = 64\nspeed_mps = 0.1\n";
/// A trajectory of a pilot who goes to chainage 40 m.
pub(crate) const PILOT: &str = "kind = \"pilot\"\nto_m = 40\nspeed_mps = 0.4\nstops_per_hour = 60\n\
                                backs_per_hour = 60\nback_m = [0.5, 2]\nstop_s = [5, 10]\n";
/// A trajectory through waypoints, given over ground.
pub(crate) const WAYPOINTS: &str = "kind = \"waypoints\"\n[[trajectory.waypoints]]\nchainage_m = 2\n\
                                    [[trajectory.waypoints]]\nchainage_m = 6\nspeed_mps = 0.2\n";

/// A message on a line: time, direction, and bytes.
pub(crate) type OnLine = (MonoNs, Direction, Vec<u8>);

/// A test bench: the scene that this file describes, with the given effects.
pub(crate) struct Bench {
    layout: &'static str,
    scene: String,
    /// Name of the vehicle's inertial unit.
    unit: &'static str,
}

impl Bench {
    /// A test bench with heads that turn continuously, on a trajectory of 35 s.
    pub(crate) fn turning(effects: &str) -> Self {
        Self::on(LEGS, effects)
    }

    /// A test bench with heads that sweep to and fro in sectors, on a trajectory of 35 s.
    pub(crate) fn sectors(effects: &str) -> Self {
        Self { layout: "sector_offset", ..Self::on(LEGS, effects) }
    }

    /// A test bench with heads that turn continuously, on a trajectory of 640 s.
    pub(crate) fn long(effects: &str) -> Self {
        Self::on(LONG, effects)
    }

    /// A test bench with heads that turn continuously, on the given trajectory.
    pub(crate) fn on(trajectory: &str, effects: &str) -> Self {
        let scene = format!("vehicle = \"vehicle.toml\"\nseed = 11\n[trajectory]\n{trajectory}\n{effects}\n");
        Self { layout: "phase_shift", scene, unit: "imu" }
    }

    /// This test bench with another seed.
    pub(crate) fn seeded(self, seed: u64) -> Self {
        Self { scene: self.scene.replace("seed = 11", &format!("seed = {seed}")), ..self }
    }

    /// This test bench with another name for the inertial unit. The name changes the unit's random numbers.
    pub(crate) fn with_unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    fn parse(&self) -> Result<Scene, SceneError> {
        let vehicle = VEHICLE
            .replace("LAYOUT", self.layout)
            .replace("id = \"imu\"", &format!("id = \"{}\"", self.unit));
        Scene::parse(Document::new("scene", &self.scene), &KINDS, &|_| Ok(vehicle.clone().into_bytes()), None)
    }

    pub(crate) fn scene(&self) -> Scene {
        self.parse().unwrap()
    }

    pub(crate) fn simulation(&self) -> Simulation {
        self.parse().and_then(|scene| Simulation::new(&scene)).unwrap()
    }

    /// Text of the error if the dive is refused; empty if it is accepted.
    pub(crate) fn refusal(&self) -> String {
        let simulated = self.parse().and_then(|scene| Simulation::new(&scene));
        simulated.err().map(|why| why.to_string()).unwrap_or_default()
    }

    /// Number of the sensor with this id.
    pub(crate) fn source(&self, sensor: &str) -> usize {
        self.parse().unwrap().facts.sensors.iter().position(|s| s.id == sensor).unwrap()
    }

    pub(crate) fn sensors(&self) -> u16 {
        u16::try_from(self.parse().unwrap().facts.sensors.len()).unwrap()
    }

    /// All measurements of a sensor. No other sensor is simulated.
    pub(crate) fn run<M: Measurement>(&self, sensor: &str) -> Vec<M> {
        let scene = self.parse().unwrap();
        Simulation::new(&scene).unwrap().measurements_of(self.source(sensor))
    }

    /// All messages on the lines of a dive.
    pub(crate) fn messages(&self) -> Vec<(MonoNs, u16, Direction, Vec<u8>)> {
        self.messages_in(DurNs(1_000_000_000))
    }

    fn messages_in(&self, slice: DurNs) -> Vec<(MonoNs, u16, Direction, Vec<u8>)> {
        let mut sim = self.simulation().in_slices(slice);
        let mut all = Vec::new();
        while let Some(message) = sim.next_message() {
            all.push((message.at, message.source, message.direction, message.bytes.to_vec()));
        }
        all
    }

    /// Messages on the line of one sensor.
    pub(crate) fn line(&self, source: u16) -> Vec<OnLine> {
        let all = self.messages().into_iter().filter(|message| message.1 == source);
        all.map(|(at, _, direction, bytes)| (at, direction, bytes)).collect()
    }
}

/// Text of the error if the dive of 35 s with these effects is refused.
pub(crate) fn refusal(effects: &str) -> String {
    Bench::turning(effects).refusal()
}

/// Asserts that the lines' bytes are identical for any length of the simulation's time slices.
pub(crate) fn same_in_any_slices(bench: &Bench) {
    let usual = bench.messages();
    assert!(usual.len() > 1000 && usual.windows(2).all(|w| w[0].0 <= w[1].0));
    for nanos in [13_000_007, 333_333_333, 20_000_000_000] {
        let other = bench.messages_in(DurNs(nanos));
        let differs = usual.iter().zip(&other).position(|(a, b)| a != b);
        assert!(usual.len() == other.len() && differs.is_none(), "{nanos} ns: message {differs:?}");
    }
}
