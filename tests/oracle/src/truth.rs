//! Where beams truly met the wall, from the simulator's ground truth.
//!
//! A return is of the wall where its beam's axis met something that stays (wall, boulder, opening's side), within the head's range,
//! and no effect put another sound or nothing in its place ([`REPLACING`]).

use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::Sense;
use headrace_simulator::{Scene, SensorFacts, Simulation, TruthRow};

use super::wall::{Place, Wall};
use crate::TruthError;
use crate::outline::Outline;

/// Effects that put another sound, or none, in place of the wall's return, or spoil its bytes.
pub const REPLACING: [&str; 10] = [
    "occlusion",
    "near_returns",
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
#[derive(Debug, Clone)]
pub struct Truth {
    /// Where beams met the wall, source by source within a second.
    pub samples: Vec<TrueSample>,
    /// Least and largest chainage of the vehicle, m.
    pub way_m: [f64; 2],
    /// Length of the wall's circumference, m.
    pub perimeter_m: f64,
    /// Returns of profiling heads, of the wall or not.
    pub returns: u64,
    /// Largest difference of a sample's arc length from the one that the simulator's rays give, m.
    pub arc_off_m: f64,
}

impl Truth {
    /// The wall with all true samples.
    ///
    /// Errors: as for [`Wall::new`].
    pub fn wall(&self) -> Result<Wall, TruthError> {
        Wall::new(self.samples.iter().map(|sample| sample.place), self.perimeter_m)
    }
}

/// Takes a simulation's truth as it becomes known.
pub struct TruthTaker {
    outline: Outline,
    replacing: Vec<bool>,
    /// Least and largest range of each source, m; none of sensors that are no heads.
    reach_m: Vec<Option<[f64; 2]>>,
    truth: Truth,
}

impl TruthTaker {
    /// For a simulation of this scene that notes its truth, arc lengths being told on this profile.
    pub fn new(scene: &Scene, simulation: &Simulation, profile: &Profile) -> Self {
        let sound_mps = scene.vehicle.site.sound_speed_mps;
        let reach = |sensor: &SensorFacts| sensor.head.map(|head| head.reach_m(sound_mps));
        let outline = Outline::of(profile);
        let truth = Truth {
            samples: Vec::new(),
            way_m: [f64::INFINITY, f64::NEG_INFINITY],
            perimeter_m: outline.perimeter_m(),
            returns: 0,
            arc_off_m: 0.0,
        };
        Self {
            outline,
            replacing: simulation.added().iter().map(|added| REPLACING.contains(&added.effect)).collect(),
            reach_m: scene.facts().sensors.iter().map(reach).collect(),
            truth,
        }
    }

    /// Takes what has become known.
    pub fn note(&mut self, simulation: &mut Simulation) {
        for row in simulation.take_truth() {
            let [least_m, most_m] = self.truth.way_m;
            self.truth.way_m = [least_m.min(row.chainage_m), most_m.max(row.chainage_m)];
            let is_return = row.sounding.is_some_and(|sounding| sounding.measured.range_m.is_some());
            self.truth.returns += u64::from(row.sense == Sense::Head && is_return);
            if let (Some(sample), Some((_, arc_m))) = (self.sample(&row, simulation), row.wall()) {
                let off_m = math::wrap_signed(sample.place[1] - arc_m, self.truth.perimeter_m);
                self.truth.arc_off_m = self.truth.arc_off_m.max(off_m.abs());
                self.truth.samples.push(sample);
            }
        }
    }

    /// All that has been taken.
    pub fn truth(self) -> Truth {
        self.truth
    }

    fn sample(&self, row: &TruthRow, simulation: &Simulation) -> Option<TrueSample> {
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
        let [x_m, y_m, z_m] = simulation.scenery()?.environment.axis().chart(hit.point);
        Some(TrueSample { at: row.at, source: row.source, place: [x_m, self.outline.arc_m([y_m, z_m])] })
    }
}
