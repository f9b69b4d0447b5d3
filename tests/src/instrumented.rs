//! Dives whose georeferenced pings are copied out of the loop. They are the input of tests that recompute the coverage.

use headrace_geometry::frames::{Mount, Pose};
use headrace_geometry::math::TAU;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;
use headrace_monitor::App;
use headrace_monitor::messages::Outcome;
use headrace_monitor::report::Report;
use headrace_monitor::result_stream::{RecordKind, first_record};
use headrace_monitor::run::Loop;
use headrace_replay::SimulationFeed;
use headrace_replay::drive::{Pace, drive};
use headrace_sensor::reading::SourceId;
use headrace_simulator::{Scene, Simulation};
use headrace_vehicle::Mission;
use headrace_vehicle::VehicleConfig;

use crate::scenes;

/// A sonar return with its place on the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Place of the return on the unrolled wall: chainage and arc length, m.
    pub place: [f64; 2],
    /// Place of the return in the tunnel's frame, m.
    pub point: [f64; 3],
}

/// A ping of a profiling head.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ping {
    /// Number of the head.
    pub head: usize,
    /// Receive time of the ping.
    pub received: MonoNs,
    /// Whether the head has started a new turn since the previous ping.
    pub new_sweep: bool,
    /// Whether the head has moved by exactly one step since the previous ping.
    pub single_step: bool,
    /// Estimated pose of the vehicle at the ping, if known.
    pub pose: Option<Pose>,
    /// The ping's return, if the loop accepted it as wall and placed it.
    pub sample: Option<Sample>,
    /// The ping's return, if the loop did not accept it as wall.
    pub doubtful: Option<Sample>,
}

/// Pings, report and configuration of a dive.
pub struct Dive {
    /// Pings in the order in which the loop placed them.
    pub pings: Vec<Ping>,
    /// Report of the dive.
    pub report: Report,
    /// Cross-section of the tunnel in the loop's configuration.
    pub profile: Profile,
    /// Mount of each head. The index is the head's number.
    pub mounts: Vec<Mount>,
    /// Range of each head at the site's speed of sound, m.
    pub ranges_m: Vec<f64>,
    /// Turn time of the slowest head, seconds.
    pub turn_s: f64,
}

impl Dive {
    /// All samples of the dive, in order.
    pub fn samples(&self) -> impl Iterator<Item = &Sample> {
        self.pings.iter().filter_map(|ping| ping.sample.as_ref())
    }

    /// Samples of the selected heads: chainage and arc length, m.
    pub fn samples_of(&self, is_one: impl Fn(usize) -> bool) -> impl Iterator<Item = [f64; 2]> {
        self.pings.iter().filter(move |ping| is_one(ping.head)).filter_map(|ping| Some(ping.sample?.place))
    }
}

#[derive(Default)]
struct Seen {
    pings: Vec<Ping>,
    /// Place of every return. The loop may decide only later whether a return comes from the wall or is doubtful.
    placed: Vec<Option<[f64; 3]>>,
    /// Source (number of the sensor) of each ping.
    sources: Vec<SourceId>,
}

impl Seen {
    /// Copies the pings of the loop's last tick, and the returns that were classified in this tick.
    fn note(&mut self, dive: &Loop) {
        for ping in dive.view().placed().pings() {
            self.placed.push(match ping.outcome {
                Outcome::Sample { point, .. } => Some([point.x(), point.y(), point.z()]),
                Outcome::Lost(..) | Outcome::Unplaced(_) => None,
            });
            self.sources.push(ping.source);
            self.pings.push(Ping {
                head: ping.head,
                received: ping.received,
                new_sweep: ping.new_sweep,
                single_step: ping.single_step,
                pose: ping.fix.map(|fix| fix.pose),
                sample: None,
                doubtful: None,
            });
        }
        let mut words = dive.view().surveyor().digests().pings.words();
        while let Some((record, rest)) = first_record(words) {
            words = rest;
            let is_wall = record.kind == Some(RecordKind::Sample);
            if is_wall || record.kind == Some(RecordKind::Doubtful) {
                self.note_return(record.words, is_wall);
            }
        }
    }

    /// Stores a return that the loop has classified with its ping. `words` is the digest's record of the return.
    fn note_return(&mut self, words: &[u64], is_wall: bool) {
        let [received, source, _, place @ ..] = words else { panic!("a ping's words") };
        let [x_m, y_m, z_m, arc_m] = [0, 1, 2, 3].map(|k| f64::from_bits(place[k]));
        let point = [x_m, y_m, z_m];
        let source = SourceId(u16::try_from(*source).unwrap());
        let is_it = |k: &usize| {
            let (ping, placed) = (&self.pings[*k], self.placed[*k]);
            self.sources[*k] == source && ping.received.0 == *received && placed == Some(point)
        };
        let ping = (0..self.pings.len()).rev().find(is_it).unwrap();
        let ping = &mut self.pings[ping];
        *(if is_wall { &mut ping.sample } else { &mut ping.doubtful }) =
            Some(Sample { place: [x_m, arc_m], point });
    }
}

/// Simulates the scene in the files `vehicle` and `scene`, and replays it in ticks of 20 ms.
pub fn dive(vehicle: &str, scene: &str) -> Dive {
    dive_in_ticks(vehicle, scene, Pace::default().tick)
}

/// As [`dive`], but in ticks of length `tick`.
pub fn dive_in_ticks(vehicle: &str, scene: &str, tick: DurNs) -> Dive {
    let scene = parse(vehicle, "", scene);
    watched(&scene, &scene.vehicle, scene.vehicle.mission(), Pace { tick, ..Pace::default() })
}

/// As [`dive`], but the loop uses the profile `profile`.
pub fn dive_with_profile(vehicle: &str, scene: &str, profile: Profile) -> Dive {
    let scene = parse(vehicle, "", scene);
    watched(&scene, &scene.vehicle, Mission { profile, ..scene.vehicle.mission() }, Pace::default())
}

/// Simulates a scene with the first vehicle file and the first polygon of the pairs. The loop uses the second vehicle
/// file and the second polygon.
///
/// A polygon has one corner `y_m,z_m` per line.
pub fn dive_believing(vehicle: [&str; 2], polygon: [&str; 2], scene: &str) -> Dive {
    let [true_scene, believed] = [0, 1].map(|k| parse(vehicle[k], polygon[k], scene));
    watched(&true_scene, &believed.vehicle, believed.vehicle.mission(), Pace::default())
}

fn parse(vehicle: &str, polygon: &str, scene: &str) -> Scene {
    let file = |name: &str| if name.contains("vehicle") { vehicle } else { polygon };
    scenes::scene_from(scene, &|name| Ok(file(name).as_bytes().to_vec()))
}

fn watched(scene: &Scene, vehicle: &VehicleConfig, mission: Mission, pace: Pace) -> Dive {
    let mut app = App::new(mission);
    for sensor in &vehicle.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.keep_results();
    let mut dive = app.arm(vehicle.navigation()).unwrap();
    let simulation = Simulation::new(scene).unwrap_or_else(|why| panic!("{why}"));
    let mut seen = Seen::default();
    drive(&mut dive, &mut SimulationFeed::new(simulation), pace, &mut |dive| seen.note(dive)).unwrap();
    dive.finish(&mut |_, _| {});
    let heads = vehicle.heads();
    Dive {
        pings: seen.pings,
        report: Report::of(&dive),
        profile: dive.mission().profile.clone(),
        ranges_m: heads.iter().map(|head| head.reach_m(vehicle.site.sound_speed_mps)[1]).collect(),
        mounts: heads.iter().map(|head| head.mount).collect(),
        turn_s: heads.iter().map(|head| TAU / head.step_rad * head.ping_period_s).fold(0.0, f64::max),
    }
}
