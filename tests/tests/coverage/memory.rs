//! Memory grows with the distance covered, not with time. A stationary vehicle needs no additional memory.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::run::Loop;
use headrace_sensor::device::Direction;
use headrace_simulator::{START, Simulation};
use headrace_tests::scenes;
use headrace_vehicle::Mission;

/// A minute of motion, followed by half an hour in which the vehicle is stationary and its sensors have noise.
const SCENE: &str = "vehicle = \"vita2-4.toml\"\n[trajectory]\nkind = \"waypoints\"\n\
    [[trajectory.waypoints]]\nchainage_m = 5\n\
    [[trajectory.waypoints]]\nchainage_m = 17\nspeed_mps = 0.2\nstay_s = 1800\n\
    [[trajectory.waypoints]]\nchainage_m = 17.1\nspeed_mps = 0.2\n\
    [effects]\nrange_noise = { sd_m = 0.02 }\n";

/// The two quantities that may grow in an armed loop: the bytes of stored samples, and the number of entries in the
/// history of advice.
fn used(dive: &Loop) -> [usize; 2] {
    [dive.view().coverage().store.usage().bytes, dive.advice_log().entries.len()]
}

#[test]
fn memory_does_not_grow_while_the_vehicle_is_stationary() {
    let scene = scenes::scene(SCENE);
    let mut app = App::new(Mission { length_m: 100.0, ..scene.vehicle.mission() });
    for sensor in &scene.vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(scene.vehicle.navigation()).unwrap();
    let count = dive.sources().len();
    let mut ports: Vec<_> = (0..count).map(|source| dive.take_port(source).unwrap()).collect();
    let mut simulation = Simulation::new(&scene).unwrap();
    let mut seen: Vec<(MonoNs, [usize; 2])> = Vec::new();
    let mut until = START;
    while simulation.peek_message().is_some() {
        until = until + DurNs(20_000_000);
        while simulation.peek_message().is_some_and(|message| message.at < until) {
            let message = simulation.next_message().unwrap();
            if message.direction == Direction::Received {
                ports[usize::from(message.source)].send(message.at, message.bytes).unwrap();
            }
        }
        dive.tick(until);
        if (until.0 - START.0).is_multiple_of(300_000_000_000) {
            seen.push((until, used(&dive)));
            println!("{:.0} s: {:?}", until.since(START).as_secs_f64(), used(&dive));
        }
    }
    let [early, late] = [seen[seen.len() / 2].1, seen.last().unwrap().1];
    assert!(late[0] * 100 <= early[0] * 105, "samples: {early:?}, then {late:?} bytes");
    // The history of advice has one entry every ten seconds, plus a few more entries.
    assert!(late[1] < 500, "advice: {late:?} entries");
}
