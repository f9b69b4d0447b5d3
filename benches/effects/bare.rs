//! A scene without effects, compared with the shortest equivalent hand-written program.

use std::hint::black_box;

use headrace_sensor::device::{Emulated, Emulator, EmulatorSetup};
use headrace_sensor::measurement::Sounding;

use headrace_geometry::frames::{Body, Mount, Point3, Rot, Tunnel, head_direction};
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_oracle::timed;
use headrace_simulator::{START, Scene, Simulation};
use headrace_tests::scenes;

use crate::workload::{SPEED_MPS, best, text};

/// Number of timed rounds. It is large, because the result is a small difference of two times.
const ROUNDS: usize = 40;
const LENGTH_M: f64 = 80.0;
const SECOND: DurNs = DurNs(1_000_000_000);

/// Digest of a dive: the number of messages, and a sum that depends on their order, times and bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Said {
    messages: u32,
    sum: u64,
}

impl Said {
    fn hear(&mut self, at: MonoNs, source: usize, bytes: &[u8]) {
        self.messages += 1;
        let last = bytes.last().copied().unwrap_or_default();
        let heard = at.0 ^ u64::from(last) << 8 ^ bytes.len() as u64 ^ source as u64;
        self.sum = self.sum.rotate_left(5) ^ heard;
        black_box(bytes);
    }
}

/// Prints the overhead of the simulator's schedule in a scene whose only sensors are heads.
pub(crate) fn bare() {
    let text = text(LENGTH_M, "phase_shift", "");
    let scene = scenes::scene_from(&text, &|name| scenes::vehicle_file(name).map(heads_alone));
    let [mut by_hand, mut simulated] = [Said::default(); 2];
    let [hand_s, whole_s] = best(
        ROUNDS,
        [
            &mut || {
                let mut hand = ByHand::new(&scene);
                let (said, seconds) = timed(|| hand.dive());
                by_hand = said;
                seconds
            },
            &mut || {
                let simulation = Simulation::new(&scene).unwrap_or_else(|why| panic!("{why}"));
                let (said, seconds) = timed(|| dive(simulation));
                simulated = said;
                seconds
            },
        ],
    );
    assert_eq!(by_hand, simulated, "both programs give the same messages");
    let ns = |seconds: f64| seconds * 1e9 / f64::from(by_hand.messages / 2);
    println!("\n| a scene without effects | ns a head's return |\n|---|---|");
    println!("| by hand: all heads' rays and bytes, in order of time | {:.0} |", ns(hand_s));
    println!("| the simulation: the same | {:.0} |", ns(whole_s));
    println!("| over the hand-written program, percent | {:+.1} |", 100.0 * (whole_s / hand_s - 1.0));
}

/// The part of a vehicle file up to the last head. The heads come before all other sensors in the file.
fn heads_alone(mut vehicle: Vec<u8>) -> Vec<u8> {
    let next = b"[[sensors]]\nid = \"ping_left\"";
    let heads = vehicle.windows(next.len()).position(|window| window == next);
    vehicle.truncate(heads.unwrap());
    vehicle
}

/// Simulates the dive and consumes its messages.
fn dive(mut simulation: Simulation) -> Said {
    let mut said = Said::default();
    while let Some(message) = simulation.next_message() {
        said.hear(message.at, usize::from(message.source), message.bytes);
    }
    said
}

type Head = Box<dyn Emulator<Sounding>>;

/// The hand-written program: heads in a straight tunnel, second by second, without systems or extension points for
/// effects.
struct ByHand<'a> {
    profile: &'a Profile,
    heads: Vec<(Head, Mount)>,
    end: MonoNs,
    due: Vec<Sounding>,
    /// Messages that haven't been sent yet: time, source, and the start and end of the message in `bytes`.
    waiting: Vec<(MonoNs, usize, usize, usize)>,
    bytes: Vec<u8>,
}

impl<'a> ByHand<'a> {
    fn new(scene: &'a Scene) -> Self {
        let sensors = scene.vehicle.sensors.iter().zip(&scene.vehicle.sensor_configs).zip(&scene.programs);
        let heads = sensors.map(|((sensor, config), program)| {
            let setup =
                EmulatorSetup { start: START, head: Some(*program), site: scene.vehicle.site, polled: true };
            let Emulated::Head(head) = sensor.emulator(&setup) else { panic!("heads come first") };
            (head, config.mount)
        });
        Self {
            profile: &scene.vehicle.tunnel.profile,
            heads: heads.collect(),
            end: START + DurNs::from_secs_f64(LENGTH_M / SPEED_MPS) + DurNs(1),
            due: Vec::new(),
            waiting: Vec::new(),
            bytes: Vec::new(),
        }
    }

    /// Casts every ray and sends the message of its return.
    fn dive(&mut self) -> Said {
        let mut said = Said::default();
        let mut until = START;
        while until < self.end {
            until = (until + SECOND).min(self.end);
            for (source, (head, mount)) in self.heads.iter_mut().enumerate() {
                measure(head, mount, self.profile, until, &mut self.due);
                for sounding in &self.due {
                    head.tell(sounding, &mut |_, at, sent| {
                        let from = self.bytes.len();
                        self.bytes.extend_from_slice(sent);
                        self.waiting.push((at, source, from, self.bytes.len()));
                    });
                }
            }
            self.send(until, &mut said);
        }
        self.send(MonoNs(u64::MAX), &mut said);
        said
    }

    /// Sends the messages before `until`, in order.
    fn send(&mut self, until: MonoNs, said: &mut Said) {
        self.waiting.sort();
        let sent = self.waiting.partition_point(|(at, ..)| *at < until);
        for (at, source, from, to) in self.waiting.drain(..sent) {
            said.hear(at, source, &self.bytes[from..to]);
        }
        let mut kept = Vec::new();
        for (_, _, from, to) in &mut self.waiting {
            let at = kept.len();
            kept.extend_from_slice(&self.bytes[*from..*to]);
            (*from, *to) = (at, kept.len());
        }
        self.bytes.clear();
        self.bytes.append(&mut kept);
    }
}

/// Measures all soundings of a head up to `until`.
fn measure(head: &mut Head, mount: &Mount, profile: &Profile, until: MonoNs, due: &mut Vec<Sounding>) {
    let [y_m, z_m] = profile.reference();
    let level = Rot::<Tunnel, Body>::identity();
    due.clear();
    head.begin(until, due);
    for sounding in due {
        let x_m = 5.0 + sounding.at.since(START).as_secs_f64() * SPEED_MPS;
        let origin = Point3::new(x_m, y_m, z_m) + level * mount.position;
        let direction = level * (mount.rotation * head_direction(sounding.angle_rad));
        let hit = profile.cast([origin.y(), origin.z()], [direction.y(), direction.z()]);
        sounding.range_m = hit.map(|hit| hit.range_m);
    }
}
