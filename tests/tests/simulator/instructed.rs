//! A simulated pilot who follows only the most prominent instructions, in dives with faulty devices. At the end, little
//! wall may be missed.
//!
//! 50 dives: `cargo test -p headrace_tests --test simulator instructed -- --ignored --nocapture`

#![expect(
    clippy::disallowed_types,
    reason = "the test reads the metres after the simulation, without a loop"
)]

use std::sync::{Arc, Mutex};

use headrace_coverage::Metres;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::App;
use headrace_monitor::feed::work_off;
use headrace_monitor::live_text::status_line;
use headrace_monitor::ring::Port;
use headrace_monitor::run::Loop;
use headrace_sensor::device::Direction;
use headrace_simulator::{Adviser, Message, PilotAdvice, Scene, Simulation};
use headrace_tests::random::Random;
use headrace_tests::scenes;

const TICK: DurNs = DurNs(20_000_000);

/// A pilot's screen. The pilot reads the action that the condition states, and the action of the first alert.
struct Screen {
    dive: Loop,
    ports: Vec<Option<Port>>,
    until: MonoNs,
    read: Vec<PilotAdvice>,
    /// Present length of the wall with each verdict, m.
    metres: Arc<Mutex<Metres>>,
}

/// The speed at the end of an instruction such as "at most 0.090 m/s", m/s.
fn speed_mps(instruction: &str) -> Option<f64> {
    instruction.strip_suffix(" m/s")?.rsplit(' ').next()?.parse().ok()
}

/// Advice as understood by a pilot who reads only the most prominent instructions; `None` before the first advice
/// update of a tick.
fn read(dive: &Loop) -> Option<PilotAdvice> {
    let view = dive.view();
    let at = view.advised().entries.last()?.at;
    let name = |source: usize| view.sources()[source].id.clone();
    let line = status_line(view.live_state(), &view.mission().profile, view.head_descriptions(), &name);
    // If all is well, the condition itself states the speed.
    let instruction = if line.action.is_empty() { &line.what[0] } else { &line.action };
    let alerts = view.live_state_json().alert_list;
    let back = alerts.first().filter(|alert| alert.advice.contains("inspect again from "));
    let missed_m = back.and_then(|alert| Some([alert.from_m?, alert.to_m?])).into_iter().collect();
    let stand = ["stop", "hold still", "stand still"].iter().any(|words| instruction.starts_with(words));
    Some(PilotAdvice { at, v_max_mps: speed_mps(instruction), stand, missed_m })
}

impl Screen {
    fn new(scene: &Scene, metres: Arc<Mutex<Metres>>) -> Self {
        let mut app = App::new(scene.vehicle.mission());
        for sensor in &scene.vehicle.sensors {
            app.add_device(sensor.as_ref()).unwrap();
        }
        let mut dive = app.arm(scene.vehicle.navigation()).unwrap();
        let ports = (0..dive.sources().len()).map(|source| dive.take_port(source)).collect();
        Self { dive, ports, until: MonoNs(0), read: Vec::new(), metres }
    }
}

impl Adviser for Screen {
    fn hear(&mut self, message: &Message<'_>) {
        if message.direction != Direction::Received {
            return;
        }
        if message.at >= self.until {
            let Self { dive, until, read: all, metres, .. } = self;
            work_off(dive, *until, &mut |dive| all.extend(read(dive)), &mut || {});
            *metres.lock().unwrap() = dive.view().live_state().metres;
            self.until = message.at + TICK;
        }
        if let Some(port) = &mut self.ports[usize::from(message.source)] {
            port.send(message.at, message.bytes).unwrap();
        }
    }

    fn advice(&mut self) -> Vec<PilotAdvice> {
        std::mem::take(&mut self.read)
    }
}

/// Devices that may fail, and their faults.
const FAULTS: [(&str, &str); 6] = [
    ("sonar_0", "die"),
    ("sonar_1", "stick"),
    ("sonar_2", "die"),
    ("tether", "die"),
    ("sonar_3", "die"),
    ("imu", "die"),
];

/// One to three faults of different devices, each for 5 to 40 s, drawn from a seed.
fn faults(seed: u64) -> String {
    let mut random = Random(seed);
    let first = random.below(FAULTS.len());
    let fault = |number: usize| {
        let (sensor, kind) = FAULTS[(first + 2 * number) % FAULTS.len()];
        let (from_s, for_s) = (40 + random.below(120), 5 + random.below(36));
        format!(
            "[[effects.device_faults]]\nkind = \"{kind}\"\nsensors = [\"{sensor}\"]\nfrom_s = {from_s}\nfor_s = {for_s}\n"
        )
    };
    (0..=usize::try_from(seed % 3).unwrap()).map(fault).collect()
}

/// Length of the wall with each verdict at the end of a dive with the faults `faults`, m.
fn metres(faults: &str) -> Metres {
    let scene = scenes::scene(&format!(
        "vehicle = \"vita2-4.toml\"\n[vehicle_changes]\nheads.planned_speed_mps = 0.09\n[trajectory]\nkind = \"advised\"\n\
         start_m = 5\nto_m = 16\nspeed_mps = 0.12\nstands = true\n\
         [effects]\nmotion_within_turn = {{}}\nrange_noise = {{ sd_m = 0.01 }}\n{faults}"
    ));
    let metres = Arc::new(Mutex::new(Metres::default()));
    let screen = Screen::new(&scene, Arc::clone(&metres));
    let mut simulation = Simulation::new(&scene).unwrap().advised_by(Box::new(screen));
    while simulation.next_message().is_some() {}
    *metres.lock().unwrap()
}

/// Runs dives with these seeds. In all dives together, at most `most_m` metres may be missed.
#[track_caller]
fn check(seeds: core::ops::Range<u64>, most_m: f64) {
    let mut missed_m = 0.0;
    for seed in seeds {
        let faults = faults(seed);
        let metres = metres(&faults);
        println!("seed {seed}: {metres:?}\n{faults}");
        assert!(metres.pass_m > 5.0, "seed {seed}: {metres:?}");
        missed_m += metres.fail_m;
    }
    println!("{missed_m} m missed");
    assert!(missed_m <= most_m, "{missed_m} m missed");
}

#[test]
fn pilot_following_the_main_instructions_misses_no_wall_despite_faults() {
    check(0..5, 0.0);
}

/// Each of the 50 dives is 11 m long.
#[test]
#[ignore = "long: 50 dives"]
fn pilot_following_the_main_instructions_misses_at_most_2_m_in_50_dives_with_faults() {
    check(0..50, 2.0);
}
