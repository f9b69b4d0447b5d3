//! A loop's state is saved at any tick and restored into another loop, which then reaches the same states, bit for
//! bit.

use headrace_geometry::time::MonoNs;
use headrace_monitor::App;
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_sensor::device::Direction;
use headrace_simulator::{Scene, Simulation};
use headrace_tests::scenes;
use headrace_vehicle::VehicleConfig;

#[derive(Clone)]
pub(crate) struct Packet {
    pub(crate) source: usize,
    pub(crate) at: MonoNs,
    pub(crate) bytes: Vec<u8>,
}

const COMMANDS: [&str; 7] = [
    r#"{"do":"acknowledge","alert":0,"by":"AB"}"#,
    r#"{"do":"silence","by":"AB"}"#,
    r#"{"do":"note","text":"rubble left","by":"AB"}"#,
    r#"{"do":"recording","fails":true}"#,
    r#"{"do":"limits","battery_pct":9.5}"#,
    r#"{"do":"recording","fails":false}"#,
    r#"{"do":"nothing"}"#,
];

/// All packets of a scene's devices. Every third packet of a byte stream is cut in two, so that a snapshot often falls
/// within a frame.
pub(crate) fn packets(scene: &Scene) -> Vec<Packet> {
    let mut simulation = Simulation::new(scene).unwrap();
    let mut all = Vec::new();
    while let Some(message) = simulation.next_message() {
        if message.direction == Direction::Sent {
            continue;
        }
        let (source, at, bytes) = (usize::from(message.source), message.at, message.bytes);
        let connect = &scene.vehicle.sensor_configs[source].connect;
        let streams = connect.starts_with("tcp:") || connect.starts_with("serial:");
        let cut = if streams && all.len() % 3 == 0 { bytes.len() / 2 } else { 0 };
        for bytes in [&bytes[..cut], &bytes[cut..]].into_iter().filter(|bytes| !bytes.is_empty()) {
            all.push(Packet { source, at, bytes: bytes.to_vec() });
        }
        // Adds operator commands between the packets of the devices.
        if all.len() % 97 == 0 {
            let command = COMMANDS[all.len() / 97 % COMMANDS.len()].as_bytes().to_vec();
            all.push(Packet { source: scene.vehicle.sensors.len(), at, bytes: command });
        }
    }
    all
}

pub(crate) fn armed(vehicle: &VehicleConfig) -> (Loop, Vec<Port>) {
    let mut app = App::new(vehicle.mission());
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let mut ports: Vec<Port> =
        (0..vehicle.sensors.len()).map(|source| dive.take_port(source).unwrap()).collect();
    ports.push(dive.take_console().unwrap());
    (dive, ports)
}

/// Feeds packets to a loop, with a tick after every 23 packets.
pub(crate) fn run((dive, ports): &mut (Loop, Vec<Port>), packets: &[Packet]) {
    for some in packets.chunks(23) {
        for packet in some {
            ports[packet.source].send(packet.at, &packet.bytes).unwrap();
        }
        dive.tick(some[some.len() - 1].at);
        assert!(!dive.has_waiting());
    }
}

/// Saves a dive at many moments. From each saved state, another loop runs to the next moment, and must then have the
/// same state as the first loop.
fn goes_on_from_anywhere(scene: &Scene) {
    let packets = packets(scene);
    let (mut whole, mut other) = (armed(&scene.vehicle), armed(&scene.vehicle));
    let mut saved = whole.0.save().unwrap();
    // The number of packets between two saves is no multiple of any period in the dive.
    let stretch = packets.len() / 17 + 1;
    for (number, stretch) in packets.chunks(stretch).enumerate() {
        run(&mut whole, stretch);
        other.0.restore(&saved).unwrap_or_else(|why| panic!("stretch {number}: {why}"));
        assert!(
            other.0.save().unwrap() == saved,
            "stretch {number}: the restored state differs from the saved one"
        );
        run(&mut other, stretch);
        saved = whole.0.save().unwrap();
        assert_eq!(other.0.view().digest(), whole.0.view().digest(), "stretch {number}");
        assert!(other.0.save().unwrap() == saved, "stretch {number}: the states differ");
    }
    println!("{} packets, {} bytes of state at the end", packets.len(), saved.len());
    for (dive, _) in [&mut whole, &mut other] {
        dive.finish(&mut |_, _| {});
    }
    assert_eq!(other.0.view().digest(), whole.0.view().digest());
    let reports = [&whole.0, &other.0].map(headrace_monitor::report::Report::of);
    assert_eq!(serde_json::to_value(&reports[0]).unwrap(), serde_json::to_value(&reports[1]).unwrap());
    assert!(reports[0].dive.samples_valid > 100);
}

/// The dive goes back and forth. Sections fail, fails become final, and later passes clear them.
pub(crate) const LEGS: &str = "[trajectory]\nstart_m = 3\n[[trajectory.legs]]\ndistance_m = 5\nspeed_mps = 0.197\n\
    [[trajectory.legs]]\ndistance_m = 5\nspeed_mps = 0.4\n[[trajectory.legs]]\ndistance_m = 7\nspeed_mps = -0.3\n";

pub(crate) const EFFECTS: &str = "[effects]\nrange_noise = { sd_m = 0.02 }\nmissing_returns = { share = 0.1, mean_run = 5 }\n\
    pilot_drift = { across_m = 0.4, yaw_deg = 4 }\n";

/// Keys of an inertial unit whose frames a DBC file defines, as in the README of its crate.
const DBC: &str = "dbc = \"sbg_ellipse.dbc\"\naxes = \"frd\"\nsignals.rate = [\"GyroX\", \"GyroY\", \"GyroZ\"]\n\
    signals.force = [\"AccX\", \"AccY\", \"AccZ\"]\nsignals.quaternion = [\"QuatW\", \"QuatX\", \"QuatY\", \"QuatZ\"]\n\
    signals.rate_valid = { signal = \"ImuStatus\", mask = 0x2E1 }\nsignals.sample_time = \"ImuTime\"";

/// A dive of the small test vehicle, with its vehicle file modified by `change`.
fn small_vehicle(change: impl Fn(&str) -> String) -> Scene {
    let vehicle = change(headrace_tests::VEHICLE);
    let load = |name: &str| match name {
        "vehicle.toml" => Ok(vehicle.clone().into_bytes()),
        "sbg_ellipse.dbc" => Ok(include_bytes!("../../../plugins/imu_can/dbc/sbg_ellipse.dbc").to_vec()),
        other => Err(format!("no file {other}")),
    };
    scenes::scene_from(&format!("vehicle = \"vehicle.toml\"\n{LEGS}{EFFECTS}"), &load)
}

#[test]
fn snapshot_of_four_heads_with_filter_resumes_identically() {
    goes_on_from_anywhere(&scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{LEGS}{EFFECTS}")));
}

#[test]
fn snapshot_without_a_filter_resumes_identically() {
    goes_on_from_anywhere(&small_vehicle(|vehicle| format!("{vehicle}[navigation]\nway = \"direct\"\n")));
}

#[test]
fn snapshot_with_a_dbc_inertial_unit_resumes_identically() {
    goes_on_from_anywhere(&small_vehicle(|vehicle| vehicle.replace("preset = \"xsens_mti600\"", DBC)));
}

#[test]
fn snapshot_with_autopilot_and_velocity_log_resumes_identically() {
    goes_on_from_anywhere(&small_vehicle(|_| headrace_tests::other_vehicle()));
}

/// A loop must refuse to restore the saved state of another vehicle.
#[test]
fn snapshot_of_another_vehicle_is_refused() {
    let two = small_vehicle(str::to_owned);
    let four = scenes::scene(&format!("vehicle = \"vita2-4.toml\"\n{LEGS}"));
    let (mut two, four) = (armed(&two.vehicle).0, armed(&four.vehicle).0);
    let saved = four.save().unwrap();
    let words = two.restore(&saved).unwrap_err().to_string();
    assert!(words.starts_with("restoring ") && words.contains("another vehicle"), "{words}");
    let saved = two.save();
    for cut in [0, 1, 7, saved.as_ref().unwrap().len() - 1] {
        assert!(two.restore(&saved.as_ref().unwrap()[..cut]).is_err(), "{cut}");
    }
}
