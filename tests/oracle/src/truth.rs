//! Collects the places where beams truly met the wall, from the simulator's ground truth.
//!
//! A return counts as wall if its beam's axis met something fixed (wall, boulder, side of an opening) within the
//! head's range, and if no effect in [`REPLACING`] replaced or removed it.

use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;
use headrace_sensor::device::Sense;
use headrace_simulator::{Scene, SensorFacts, Simulation, TruthRow};

use super::wall::{Place, Wall};
use crate::error::TruthError;
use crate::outline::Outline;

/// Effects that replace or remove the wall's return, or corrupt its bytes.
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
/// Values whose change by an effect in [`REPLACING`] shows that the effect has changed the return.
const REPLACED: [&str; 2] = ["range_m", "wrong_bytes"];

/// A place where a beam truly met the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrueSample {
    /// Time of the ping.
    pub at: MonoNs,
    /// Number of the source (the profiling head).
    pub source: u16,
    /// Place on the unrolled wall: chainage and arc length, m.
    pub place: Place,
}

/// Simulated ground truth of a dive: true samples and the vehicle's range of chainage.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Places where beams truly met the wall. Within each second of the dive, they are grouped by source.
    pub samples: Vec<TrueSample>,
    /// Smallest and largest chainage of the vehicle, m.
    pub way_m: [f64; 2],
    /// Length of the wall's circumference, m.
    pub perimeter_m: f64,
    /// Number of all returns of profiling heads, including returns that didn't meet the wall.
    pub returns: u64,
    /// Largest difference between the arc length of a sample in this oracle and in the simulator, m.
    pub arc_off_m: f64,
}

impl Truth {
    /// The unrolled wall with all true samples.
    ///
    /// Errors: as for [`Wall::new`].
    pub fn wall(&self) -> Result<Wall, TruthError> {
        Wall::new(self.samples.iter().map(|sample| sample.place), self.perimeter_m)
    }
}

/// Collects a simulation's truth while it runs.
pub struct TruthTaker {
    outline: Outline,
    replacing: Vec<bool>,
    /// Smallest and largest range of each source, m; `None` for sensors other than heads.
    reach_m: Vec<Option<[f64; 2]>>,
    truth: Truth,
}

impl TruthTaker {
    /// Prepares to collect the truth of this scene; Arc lengths are measured on `profile`.
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

    /// Collects the truth that the simulation has added since the previous call.
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

    /// Returns the collected truth.
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
