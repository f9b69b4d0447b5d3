//! Dives whose verdicts can be judged: what the loop reports, and D_true of each section.
//!
//! D_true is D of the places where the beams of those returns that are of the wall truly met it. Places come from the
//! simulator's ground truth, arc lengths from [`Outline`], circles from [`Wall`]: nothing of the program's coverage.
//!
//! A return is of the wall where its beam's axis met something that stays (wall, boulder, opening's side), within the
//! head's range, and no effect put another sound or nothing in its place ([`REPLACING`]).
//!
//! The loop's chainage may be off as a whole (slack, the wheel's scale): sections are those of its chainage, which is also
//! where a vehicle would be sent back to. Each is compared with the stretch of wall that it was: its bounds are moved by the
//! median of the difference (true less estimated chainage of the vehicle) over the pings whose samples landed in or near it.

use bevy_ecs::prelude::{Res, ResMut, Resource};
use headrace_geometry::time::MonoNs;
use headrace_monitor::messages::{Outcome, Placed, PlacedList};
use headrace_monitor::report::{Report, SectionReport};
use headrace_monitor::ring::{Port, RingError};
use headrace_monitor::run::Loop;
use headrace_monitor::stage::Stage;
use headrace_monitor::{App, Plugin, PluginError};
use headrace_replay::SimulationFeed;
use headrace_replay::drive::{Coming, Pace, PacketSource, drive};
use headrace_replay::log::LogError;
use headrace_sensor::device::Sense;
use headrace_simulator::{Scene, SensorFacts, Simulation, TruthRow};
use headrace_vehicle::VehicleConfig;

use crate::outline::Outline;
use crate::wall::{Place, Wall};

/// Effects that put another sound, or none, in place of the wall's return, or spoil its bytes.
pub const REPLACING: [&str; 9] = [
    "occlusion",
    "multipath",
    "side_lobes",
    "interference",
    "missing_returns",
    "outliers",
    "byte_errors",
    "device_faults",
    "stuck_range",
];
/// What those effects change of a return that is no longer the wall's.
const REPLACED: [&str; 2] = ["range_m", "wrong_bytes"];
/// How far from a section samples still say how far off its chainage is, m.
const NEAR_M: f64 = 1.0;

/// A place where a beam truly met the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueSample {
    /// Time of the ping.
    pub at: MonoNs,
    /// Number of the source.
    pub source: u16,
    /// Chainage and arc length, m.
    pub place: Place,
}

/// What was truly so.
pub struct Truth {
    /// Where beams met the wall, source by source within a second.
    pub samples: Vec<TrueSample>,
    /// Least and largest chainage of the vehicle, m.
    pub way_m: [f64; 2],
    /// Length of the wall's circumference, m.
    pub perimeter_m: f64,
}

/// A section as it was judged, and as it truly was.
#[derive(Debug, Clone)]
pub struct JudgedSection {
    /// What was reported.
    pub report: SectionReport,
    /// D_true, m; infinite without a single sample.
    pub true_hole_m: f64,
    /// True less estimated chainage, m.
    pub shift_m: f64,
}

/// A dive, reported and true.
pub struct JudgedDive {
    /// Report of the loop.
    pub report: Report,
    /// The truth.
    pub truth: Truth,
    /// All sections, in order.
    pub sections: Vec<JudgedSection>,
}

/// Dives a scene; the loop is told the scene's vehicle file.
pub fn dive(scene: &Scene) -> JudgedDive {
    dive_believing(scene, &scene.vehicle)
}

/// Dives a scene, the loop being told another vehicle file, whose sensors must send the same bytes.
pub fn dive_believing(scene: &Scene, believed: &VehicleConfig) -> JudgedDive {
    dive_noting(scene, believed, &mut |_| {})
}

/// The same; `note` sees the loop after each tick.
pub fn dive_noting(scene: &Scene, believed: &VehicleConfig, note: &mut dyn FnMut(&Loop)) -> JudgedDive {
    let mut app = App::new(believed.mission());
    for sensor in &believed.sensors {
        app.add_device(sensor.as_ref()).unwrap();
    }
    app.add_plugin(&Watch).unwrap();
    let mut dive = app.arm(believed.navigation()).unwrap();
    let mut feed = TruthFeed::new(scene, believed);
    drive(&mut dive, &mut feed, Pace::default(), &mut |dive: &Loop| note(dive)).unwrap();
    dive.finish(&mut |_, _| {});
    let report = Report::of(&dive);
    let shifts = dive.resource::<Seen>().unwrap().shifts(&feed.feed.simulation);
    let truth = feed.truth();
    let sections = judge(&report, &truth, &shifts);
    JudgedDive { report, truth, sections }
}

fn judge(report: &Report, truth: &Truth, shifts: &Shifts) -> Vec<JudgedSection> {
    let wall = truth.wall();
    let judge = |section: &SectionReport| {
        let shift_m = shifts.about(section.start_m, section.end_m);
        let largest = wall.largest(section.start_m + shift_m, section.end_m + shift_m);
        let true_hole_m = largest.map_or(f64::INFINITY, |circle| 2.0 * circle.radius_m);
        JudgedSection { report: section.clone(), true_hole_m, shift_m }
    };
    report.sections.iter().map(judge).collect()
}

impl Truth {
    /// The wall with all true samples.
    pub fn wall(&self) -> Wall {
        Wall::new(self.samples.iter().map(|sample| sample.place), self.perimeter_m)
    }
}

/// A simulated dive as a source of packets, whose truth is kept.
struct TruthFeed {
    feed: SimulationFeed,
    outline: Outline,
    replacing: Vec<bool>,
    /// Least and largest range of each source, m; none of sensors that are no heads.
    reach_m: Vec<Option<[f64; 2]>>,
    samples: Vec<TrueSample>,
    way_m: [f64; 2],
}

impl TruthFeed {
    fn new(scene: &Scene, believed: &VehicleConfig) -> Self {
        let simulation = headrace_replay::simulation_believing(scene, believed, true)
            .unwrap_or_else(|why| panic!("{why}"));
        let sound_mps = scene.vehicle.site.sound_speed_mps;
        let replacing = simulation.added().iter().map(|added| REPLACING.contains(&added.effect)).collect();
        let reach = |sensor: &SensorFacts| sensor.head.map(|head| head.reach_m(sound_mps));
        Self {
            feed: SimulationFeed::new(simulation),
            outline: Outline::of(&believed.tunnel.profile),
            replacing,
            reach_m: scene.facts().sensors.iter().map(reach).collect(),
            samples: Vec::new(),
            way_m: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    /// Takes what has become known.
    fn note(&mut self) {
        for row in self.feed.simulation.take_truth() {
            self.way_m = [self.way_m[0].min(row.chainage_m), self.way_m[1].max(row.chainage_m)];
            self.samples.extend(self.sample(&row));
        }
    }

    fn sample(&self, row: &TruthRow) -> Option<TrueSample> {
        let sounding = row.sounding.filter(|_| row.sense == Sense::Head)?;
        let (hit, _) = sounding.wall?;
        let range_m = sounding.measured.range_m?;
        let [near_m, far_m] = (*self.reach_m.get(usize::from(row.source))?)?;
        let replaced = row.causes.iter().any(|cause| {
            REPLACED.contains(&cause.what) && self.replacing.get(usize::from(cause.effect)) == Some(&true)
        });
        if replaced || !(near_m..=far_m).contains(&range_m) {
            return None;
        }
        let [x_m, y_m, z_m] = self.feed.simulation.scenery()?.environment.axis().chart(hit.point);
        Some(TrueSample { at: row.at, source: row.source, place: [x_m, self.outline.arc_m([y_m, z_m])] })
    }

    fn truth(mut self) -> Truth {
        self.note();
        Truth { samples: self.samples, way_m: self.way_m, perimeter_m: self.outline.perimeter_m() }
    }
}

impl PacketSource for TruthFeed {
    fn coming(&mut self) -> Result<Option<Coming>, LogError> {
        let coming = self.feed.coming();
        self.note();
        coming
    }

    fn send(&mut self, port: &mut Port) -> Result<(), RingError> {
        self.feed.send(port)
    }
}

/// Of each placed sample: when, its chainage, the vehicle's; as estimated.
#[derive(Resource, Default)]
struct Seen(Vec<(MonoNs, f64, f64)>);

/// Copies how samples were placed, and touches nothing.
struct Watch;

impl Plugin for Watch {
    fn build(&self, app: &mut App) -> Result<(), PluginError> {
        app.insert_resource(Seen::default());
        app.add_systems(Stage::Judge, watch);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "systems take their parameters by value")]
fn watch(placed: Res<'_, PlacedList>, mut seen: ResMut<'_, Seen>) {
    for item in &placed.0 {
        if let Placed::Ping(ping) = item
            && let (Outcome::Sample { point, .. }, Some(fix)) = (ping.outcome, ping.fix)
        {
            seen.0.push((ping.valid_at, point.x(), fix.pose.position.x()));
        }
    }
}

impl Seen {
    fn shifts(&self, simulation: &Simulation) -> Shifts {
        let shift = |(at, sample_x_m, x_m): &(MonoNs, f64, f64)| {
            let scenery = simulation.scenery()?;
            Some((*sample_x_m, scenery.chainage_m(*at) - x_m))
        };
        let mut shifts: Vec<(f64, f64)> = self.0.iter().filter_map(shift).collect();
        shifts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        Shifts(shifts)
    }
}

/// Estimated chainage of samples, and by how much more the vehicle's true chainage was, m; by chainage.
struct Shifts(Vec<(f64, f64)>);

impl Shifts {
    /// The median about a section; of the nearest sample where there are none about it; 0 without any.
    fn about(&self, from_m: f64, to_m: f64) -> f64 {
        let before = |x_m: f64| self.0.partition_point(|(sample_x_m, _)| *sample_x_m < x_m);
        let mut near: Vec<f64> =
            self.0[before(from_m - NEAR_M)..before(to_m + NEAR_M)].iter().map(|(_, by_m)| *by_m).collect();
        if near.is_empty() {
            let after = before(from_m).min(self.0.len().saturating_sub(1));
            return self.0.get(after).map_or(0.0, |(_, by_m)| *by_m);
        }
        let middle = near.len() / 2;
        *near.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}
