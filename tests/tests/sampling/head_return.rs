//! The advised speed while a head is silent and after its return, in simulated dives of the shipped vehicles.
//!
//! `core/sampling/src/advice/tests/silence.rs` tests more faults, but without a loop.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::feed::work_off;
use headrace_monitor::live_state::Condition;
use headrace_monitor::pilot_text::limit_text;
use headrace_sensor::device::Direction;
use headrace_simulator::Simulation;
use headrace_tests::scenes;

const TICK: DurNs = DurNs(20_000_000);

/// State of the screen at an advice update, at a time since the first packet, s.
struct Seen {
    at_s: f64,
    limit_mps: f64,
    condition: Condition,
}

/// States of the screen in a dive at a constant speed. The head `sonar_K` is silent in the given span, s.
fn seen(vehicle: &str, speed_mps: f64, (head, from_s, for_s): (usize, f64, f64)) -> Vec<Seen> {
    let scene = scenes::scene(&format!(
        "vehicle = \"{vehicle}.toml\"\n[trajectory]\nstart_m = 5\n[[trajectory.legs]]\ndistance_m = {}\n\
         speed_mps = {speed_mps}\n[effects]\nmotion_within_turn = {{}}\n[[effects.device_faults]]\nkind = \"die\"\n\
         sensors = [\"sonar_{head}\"]\nfrom_s = {from_s}\nfor_s = {for_s}\n",
        (from_s + for_s + 30.0) * speed_mps
    ));
    let mut app = App::new(scene.vehicle.mission());
    for sensor in &scene.vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    let mut dive = app.arm(scene.vehicle.navigation()).unwrap();
    let mut ports: Vec<_> = (0..dive.sources().len()).map(|source| dive.take_port(source)).collect();
    let mut simulation = Simulation::new(&scene).unwrap();
    let (mut until, mut seen) = (MonoNs(0), Vec::new());
    while let Some(message) = simulation.next_message() {
        if message.direction != Direction::Received {
            continue;
        }
        if message.at >= until {
            let note = &mut |dive: &headrace_monitor::run::Loop| {
                let view = dive.view();
                let state = view.live_state();
                let Some(entry) = view.advised().entries.last() else { return };
                let (at_s, limit_mps) = (view.clock().seconds(entry.at), state.v_max_mps());
                let condition = state.condition();
                seen.extend(limit_mps.map(|limit_mps| Seen { at_s, limit_mps, condition }));
            };
            work_off(&mut dive, until, note, &mut || {});
            until = message.at + TICK;
        }
        if let Some(port) = &mut ports[usize::from(message.source)] {
            port.send(message.at, message.bytes).unwrap();
        }
    }
    seen
}

#[test]
fn displayed_limit_falls_once_while_a_head_is_silent_and_rises_once_after_its_return() {
    for (vehicle, speed_mps, fault) in [
        ("vita2-2", 0.18, (1, 40.0, 20.0)),
        ("vita2-3", 0.1, (0, 43.0, 7.0)),
        ("vita2-4", 0.09, (2, 45.0, 31.0)),
        ("autopilot", 0.09, (1, 42.0, 12.0)),
    ] {
        let (_, from_s, for_s) = fault;
        let all = seen(vehicle, speed_mps, fault);
        // The loop notices silence after 2 s, and the head's return after a second. Both limits have a margin of half a
        // second.
        let (noticed_s, back_s) = (from_s + 2.5, from_s + for_s + 1.5);
        let spans_s = [(from_s - 5.0, from_s + 1.9), (noticed_s, from_s + for_s), (back_s, f64::INFINITY)];
        let [before, silent, after] = spans_s.map(|(from_s, to_s)| {
            let within: Vec<&Seen> = all.iter().filter(|seen| (from_s..to_s).contains(&seen.at_s)).collect();
            let mut limits: Vec<String> = within.iter().map(|seen| limit_text(seen.limit_mps)).collect();
            limits.dedup();
            assert_eq!(limits.len(), 1, "{vehicle} from {from_s} s: {limits:?}");
            within
        });
        let [before_mps, silent_mps, after_mps] = [&before, &silent, &after].map(|seen| seen[0].limit_mps);
        let what = format!("{vehicle}: {before_mps}, {silent_mps} and {after_mps} m/s");
        println!("{what}");
        assert!(silent_mps < 0.8 * before_mps && (after_mps / before_mps - 1.0).abs() < 0.05, "{what}");
        let is_too_fast = |seen: &[&Seen]| seen.iter().any(|seen| seen.condition == Condition::TooFast);
        assert_eq!([&before, &silent, &after].map(|seen| is_too_fast(seen)), [false, true, false], "{what}");
    }
}
