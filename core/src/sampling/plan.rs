//! The day before: what heads, modes, layout and speed give in a tunnel, before there is anything to measure.

mod answer;
mod briefing;
mod wall;

use super::error::{SamplingError, not_negative, positive};
use super::head::{HeadMode, HeadSet, HeadSpec};
use super::layout::{self, HeadLayout};
use super::occlusion::{self, AngleRange, Obstacle};
use super::passes::Passes;
use super::ring::{Ring, Standing};
use super::schedule::Schedule;
use super::strips::{Arc, Strips, View};
use crate::frames::{Point3, Pose, Rot};
use crate::tunnel::{Profile, Yz};

pub use answer::{Answer, Question, Spacing};
pub use briefing::{Briefing, Heard, Hidden, HullAdvice, Start, ThinStrip};
pub use wall::{PatternSample, WallPlace};

/// Soundings of a ring: 0.1 degrees apart, so that a step is looked at from many starts.
const RING: u32 = 3600;

/// A tunnel, a vehicle and what to allow for.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// Design profile.
    pub profile: Profile,
    /// Length to inspect, m.
    pub length_m: f64,
    /// Where in the cross-section the vehicle is to go.
    pub place: Yz,
    /// Its heads with the modes of each; all heads are set to the same one.
    pub heads: Vec<(HeadSpec, Vec<HeadMode>)>,
    /// Parts of the vehicle that may stand in a head's way.
    pub hull: Vec<Obstacle>,
    /// How the heads share the work.
    pub layout: HeadLayout,
    /// How far the pilot may drift, up, down and sideways, m.
    pub drift_m: f64,
    /// How far the vehicle may turn from the tunnel's axis, radians.
    pub yaw_rad: f64,
}

/// A vehicle at one of the places and headings that are allowed for.
#[derive(Debug, Clone)]
struct Stance {
    strips: Strips,
    /// The largest step of any head by mode, m.
    t_y_m: Vec<f64>,
    farthest_m: f64,
}

/// One way in which all heads can be set.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedMode {
    /// The mode, of the first head: step and name are those of all.
    pub mode: HeadMode,
    /// Smallest, mean and largest distance between neighbours of one turn, the vehicle where it should be and at rest;
    /// straight through the water, of any head, m. Source: the general case of Eq. 5, 6 and 10.
    pub chords_m: [f64; 3],
    /// The largest distance between neighbours of one turn on the unrolled wall, anywhere the vehicle may be, m.
    pub t_y2_m: f64,
    passes: Passes,
    ping_period_s: f64,
}

/// Answers questions about an inspection.
#[derive(Debug, Clone)]
pub struct Planner {
    inspection: Inspection,
    hidden: Vec<Vec<AngleRange>>,
    stances: Vec<Stance>,
    modes: Vec<PlannedMode>,
}

impl Planner {
    /// Looks at the wall from everywhere that the vehicle may be.
    ///
    /// Errors: a layout that so many heads can't have; a length, drift or yaw out of range; a head that would be
    /// outside the profile somewhere, or a beam along the tunnel; heads that have no mode in common.
    pub fn new(inspection: Inspection) -> Result<Self, SamplingError> {
        inspection.layout.check(inspection.heads.len())?;
        positive("the length in metres", inspection.length_m)?;
        not_negative("the drift in metres", inspection.drift_m)?;
        not_negative("the yaw in radians", inspection.yaw_rad)?;
        let specs: Vec<HeadSpec> = inspection.heads.iter().map(|(spec, _)| *spec).collect();
        let hidden = occlusion::hidden_by_vehicle(&specs, &inspection.hull);
        let common = common_modes(&inspection.heads);
        if common.is_empty() {
            return Err(SamplingError::NoCommonMode);
        }
        let poses = poses(&inspection);
        let mut stances = Vec::with_capacity(poses.len());
        let mut chords = vec![[0.0; 3]; common.len()];
        for (number, pose) in poses.iter().enumerate() {
            let rings = rings(&inspection, pose)?;
            if number == 0 {
                chords = common.iter().map(|modes| chords_m(&rings, modes)).collect();
            }
            let t_y_m = common.iter().map(|modes| largest_step_m(&rings, modes)).collect();
            let farthest_m = rings.iter().map(Ring::longest_range_m).fold(0.0, f64::max);
            stances.push(Stance { strips: strips(&inspection, &hidden, pose)?, t_y_m, farthest_m });
        }
        let mut modes = Vec::with_capacity(common.len());
        for (number, (of_heads, chords_m)) in common.iter().zip(chords).enumerate() {
            let t_y2_m = stances.iter().filter_map(|stance| stance.t_y_m.get(number)).copied();
            modes.push(planned_mode(&inspection, of_heads, chords_m, t_y2_m.fold(0.0, f64::max))?);
        }
        Ok(Self { inspection, hidden, stances, modes })
    }

    /// What is planned.
    pub fn inspection(&self) -> &Inspection {
        &self.inspection
    }

    /// The modes that all heads have, in the order of the first head's.
    pub fn modes(&self) -> &[PlannedMode] {
        &self.modes
    }

    /// T_max at a speed with the heads phased for it, m: the largest anywhere that the vehicle may be, the strips that
    /// it hides from some of its heads included; infinite where a strip is seen by none.
    ///
    /// Errors: a speed that isn't above zero.
    /// Source: Jorge et al. 2021, Eq. 16.
    pub fn t_max_m(&self, mode: usize, speed_mps: f64) -> Result<f64, SamplingError> {
        positive("the speed in m/s", speed_mps)?;
        let t_m = |planned: &PlannedMode, stance: &Stance, t_y_m: f64| {
            stance.strips.t_max_m(&planned.passes, speed_mps, planned.ping_period_s, t_y_m)
        };
        Ok(self.over_stances(mode, t_m).fold(0.0, f64::max))
    }

    /// The largest speed at which T_max is the target, with the heads phased for it, m/s: the inverse of
    /// [`Planner::t_max_m`].
    ///
    /// Errors: a target that isn't above zero, or that no speed meets.
    pub fn v_max_mps(&self, mode: usize, target_m: f64) -> Result<f64, SamplingError> {
        positive("the target in metres", target_m)?;
        let speed = |planned: &PlannedMode, stance: &Stance, t_y_m: f64| {
            stance.strips.speed_for_target_mps(&planned.passes, target_m, planned.ping_period_s, t_y_m)
        };
        let mut slowest = f64::INFINITY;
        let mut refused = None;
        for speed in self.over_stances(mode, speed) {
            match speed {
                Ok(speed) => slowest = slowest.min(speed),
                Err(why) => refused = worse(refused, why),
            }
        }
        match refused {
            Some(why) => Err(why),
            None => positive("the largest speed in m/s", slowest),
        }
    }

    fn over_stances<T>(
        &self,
        mode: usize,
        of: impl Fn(&PlannedMode, &Stance, f64) -> T,
    ) -> impl Iterator<Item = T> {
        let planned = self.modes.get(mode);
        self.stances.iter().filter_map(move |stance| Some(of(planned?, stance, *stance.t_y_m.get(mode)?)))
    }

    /// Time between passes over a place that all heads see, and the longest over any that some head sees, seconds, the
    /// vehicle where it should be.
    pub fn gaps_s(&self, mode: usize) -> Option<(f64, f64)> {
        let planned = self.modes.get(mode)?;
        let gap_s = |seen_by| planned.passes.gap_s(seen_by);
        let strips = self.nominal_strips()?.as_slice();
        let longest = strips.iter().filter_map(|strip| gap_s(strip.seen_by)).fold(0.0, f64::max);
        Some((gap_s(planned.passes.heads())?, longest))
    }

    /// The strips of the wall with the vehicle where it should be.
    pub fn nominal_strips(&self) -> Option<&Strips> {
        self.stances.first().map(|stance| &stance.strips)
    }

    /// The longest range from any head to the wall: where the vehicle should be, and anywhere it may be, m.
    pub fn farthest_m(&self) -> (f64, f64) {
        let far = || self.stances.iter().map(|stance| stance.farthest_m);
        (far().next().unwrap_or(0.0), far().fold(0.0, f64::max))
    }

    /// For each head the angles hidden from it, in its own frame.
    pub fn hidden(&self) -> &[Vec<AngleRange>] {
        &self.hidden
    }

    /// The vehicle where it should be, at chainage 0.
    pub fn nominal_pose(&self) -> Pose {
        pose(&self.inspection, [0.0, 0.0], 0.0)
    }

    /// The heads as they are in a mode.
    pub fn specs(&self, mode: usize) -> Vec<HeadSpec> {
        let name = self.modes.get(mode).map(|planned| planned.mode.name);
        let of_head = |(spec, modes): &(HeadSpec, Vec<HeadMode>)| {
            let turn = modes.iter().find(|mode| Some(mode.name) == name)?.turn;
            Some(HeadSpec { step_rad: turn.step_rad(), ping_period_s: turn.ping_period_s(), ..*spec })
        };
        self.inspection.heads.iter().filter_map(of_head).collect()
    }

    /// What the heads are told to do in a mode at a speed.
    ///
    /// Errors: as for [`Schedule::new`].
    pub fn schedule(&self, mode: usize, speed_mps: f64) -> Result<Schedule, SamplingError> {
        Schedule::new(&self.specs(mode), self.inspection.layout, positive("the speed in m/s", speed_mps)?)
    }
}

impl PlannedMode {
    /// T_s: time between two pings, the longest of any head, seconds.
    pub fn ping_period_s(&self) -> f64 {
        self.ping_period_s
    }

    /// When the heads pass.
    pub fn passes(&self) -> &Passes {
        &self.passes
    }
}

/// Of two reasons, the one with the larger step.
fn worse(known: Option<SamplingError>, other: SamplingError) -> Option<SamplingError> {
    match (known, other) {
        (
            Some(SamplingError::AngularStep { t_y_m: known_m, .. }),
            SamplingError::AngularStep { t_y_m, .. },
        ) if known_m >= t_y_m => known,
        _ => Some(other),
    }
}

/// For each mode that all heads have, the mode of each.
fn common_modes(heads: &[(HeadSpec, Vec<HeadMode>)]) -> Vec<Vec<HeadMode>> {
    let Some((_, first)) = heads.first() else { return Vec::new() };
    let of_all = |name: &str| -> Option<Vec<HeadMode>> {
        heads.iter().map(|(_, modes)| modes.iter().find(|mode| mode.name == name).copied()).collect()
    };
    first.iter().filter_map(|mode| of_all(mode.name)).collect()
}

/// The place where the vehicle should be, then those where it may be.
fn poses(inspection: &Inspection) -> Vec<Pose> {
    let sides = |most: f64| if most > 0.0 { vec![0.0, -most, most] } else { vec![0.0] };
    let mut poses = Vec::new();
    for y in sides(inspection.drift_m) {
        for z in sides(inspection.drift_m) {
            poses.extend(sides(inspection.yaw_rad).into_iter().map(|yaw| pose(inspection, [y, z], yaw)));
        }
    }
    poses
}

fn pose(inspection: &Inspection, aside: Yz, yaw_rad: f64) -> Pose {
    let [y, z] = inspection.place;
    Pose {
        position: Point3::new(0.0, y + aside[0], z + aside[1]),
        attitude: Rot::from_roll_pitch_yaw(0.0, 0.0, yaw_rad),
    }
}

fn rings(inspection: &Inspection, pose: &Pose) -> Result<Vec<Ring>, SamplingError> {
    let ring = |(spec, _): &(HeadSpec, Vec<HeadMode>)| {
        Ring::cast(&Standing::new(&inspection.profile, pose, &spec.mount)?, 0.0, RING)
    };
    inspection.heads.iter().map(ring).collect()
}

fn stride(mode: &HeadMode) -> usize {
    stride_of(mode.turn.step_rad())
}

fn stride_of(step_rad: f64) -> usize {
    Ring::stride(step_rad, RING)
}

fn largest_step_m(rings: &[Ring], modes: &[HeadMode]) -> f64 {
    rings.iter().zip(modes).map(|(ring, mode)| ring.largest_step_m(stride(mode))).fold(0.0, f64::max)
}

fn chords_m(rings: &[Ring], modes: &[HeadMode]) -> [f64; 3] {
    let mut all = [f64::INFINITY, 0.0, 0.0];
    for (ring, mode) in rings.iter().zip(modes) {
        let [least, mean, most] = ring.chords_m(stride(mode));
        all = [all[0].min(least), all[1] + mean / rings.len() as f64, all[2].max(most)];
    }
    all
}

fn strips(inspection: &Inspection, hidden: &[Vec<AngleRange>], pose: &Pose) -> Result<Strips, SamplingError> {
    let specs: Vec<HeadSpec> = inspection.heads.iter().map(|(spec, _)| *spec).collect();
    let programs = layout::programs(&specs, inspection.layout, 0.0)?;
    let mut views = Vec::with_capacity(specs.len());
    for ((spec, program), hidden) in specs.iter().zip(&programs).zip(hidden) {
        let standing = Standing::new(&inspection.profile, pose, &spec.mount)?;
        let arc = |angles: &AngleRange| Arc::of(&standing, angles);
        let sector = program.sector.map(|(from_rad, size_rad)| AngleRange { from_rad, size_rad });
        views.push(View {
            sector: sector.as_ref().map(arc).transpose()?,
            hidden: hidden.iter().map(arc).collect::<Result<_, _>>()?,
        });
    }
    let mut strips = Strips::default();
    strips.rebuild(inspection.profile.perimeter_m(), &views);
    Ok(strips)
}

fn planned_mode(
    inspection: &Inspection,
    of_heads: &[HeadMode],
    chords_m: [f64; 3],
    t_y2_m: f64,
) -> Result<PlannedMode, SamplingError> {
    let mode = of_heads.first().copied().ok_or(SamplingError::NoCommonMode)?;
    let longest = |of: fn(&HeadMode) -> f64| of_heads.iter().map(of).fold(0.0, f64::max);
    let (turn_s, ping_period_s) =
        (longest(|mode| mode.turn.period_s()), longest(|mode| mode.turn.ping_period_s()));
    let heads = HeadSet::first(of_heads.len());
    let passes = match inspection.layout {
        HeadLayout::PhaseShift => Passes::evenly_phased(heads, turn_s)?,
        HeadLayout::SectorOffset => {
            let specs: Vec<HeadSpec> = inspection
                .heads
                .iter()
                .zip(of_heads)
                .map(|((spec, _), mode)| HeadSpec {
                    step_rad: mode.turn.step_rad(),
                    ping_period_s: mode.turn.ping_period_s(),
                    ..*spec
                })
                .collect();
            let sweep_s = Schedule::new(&specs, inspection.layout, 0.0)?.sweep_s();
            Passes::in_sectors(heads, turn_s, sweep_s.unwrap_or(2.0 * turn_s / of_heads.len() as f64))?
        }
    };
    Ok(PlannedMode { mode, chords_m, t_y2_m, passes, ping_period_s })
}

#[cfg(test)]
mod tests;
