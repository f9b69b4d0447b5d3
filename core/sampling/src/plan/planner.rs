//! The planner: largest speed and spacing of samples in each mode, valid at all tolerated poses of the vehicle.

use crate::error::{SamplingError, not_negative, positive};
use crate::head::{HeadMode, HeadSet, HeadSpec};
use crate::layout::{self, HeadLayout};
use crate::margin::{self, APART_SHARE, ExpectedErrors, Margins};
use crate::occlusion::{self, AngleRange, Obstacle};
use crate::passes::{self, Passes};
use crate::ring::{Ring, Standing};
use crate::schedule::Schedule;
use crate::strips::{Arc, Going, Sector, Strips, View};
use crate::target::Target;
use headrace_geometry::frames::{Point3, Pose, Rot};
use headrace_geometry::math::TAU;
use headrace_geometry::tunnel::{Profile, Yz};

/// Heads should be started for this share of the largest planned speed.
///
/// A pilot keeps a speed within 5 %, and heads that are apart along the hull are in phase only near the planned speed.
/// See docs/why/field.md.
pub const HELD_SHARE: f64 = 0.95;
/// Number of rays that are cast per turn. Rays 0.1 degrees apart cover many start angles of each head step.
pub(super) const RING: u32 = 3600;

/// Maximum number of iterations until the speed converges.
///
/// Few iterations suffice, because each change of the speed is a fraction of the previous change.
const FALLS: u32 = 12;

/// The inspection to plan: a tunnel, a vehicle and tolerances of its pose.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// Design profile of the tunnel.
    pub profile: Profile,
    /// Length of tunnel to inspect, m.
    pub length_m: f64,
    /// Nominal position of the vehicle in the cross-section.
    pub place: Yz,
    /// Heads of the vehicle, with the modes of each head; all heads use the same mode.
    pub heads: Vec<(HeadSpec, Vec<HeadMode>)>,
    /// Parts of the vehicle that may occlude a head.
    pub hull: Vec<Obstacle>,
    /// Layout of the heads.
    pub layout: HeadLayout,
    /// Tolerated drift of the vehicle from its nominal position, up, down and sideways, m.
    pub drift_m: f64,
    /// Tolerated heading off the tunnel's axis, to either side, radians.
    pub yaw_rad: f64,
    /// Tolerated yaw rate, rad/s, by which beams swing along the wall between two passes.
    pub yaw_rate_radps: f64,
    /// Speed of sound in the tunnel's water, m/s.
    pub sound_speed_mps: f64,
}

/// A vehicle at one of the tolerated positions and headings.
#[derive(Debug, Clone)]
pub(super) struct Stance {
    strips: Strips,
    farthest_m: f64,
    parallax_rad: f64,
    /// The vehicle's heading shifts each head along the tunnel. This is the largest difference between two heads'
    /// shifts, m.
    shift_m: f64,
    /// Distance along the tunnel between the planes in which the heads meet the wall, m.
    apart_m: f64,
}

/// A mode to which all heads can be set.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedMode {
    /// Mode of the first head; the modes of all heads have the same name and step.
    pub mode: HeadMode,
    /// Smallest, mean and largest straight-line distance between neighbouring samples of one turn, m.
    ///
    /// The figures cover all heads, with the vehicle at its nominal pose and at rest. They generalise Eq. 5, 6 and 10
    /// of Jorge et al. 2021.
    pub chords_m: [f64; 3],
    /// The largest distance between neighbouring samples of one turn on the unrolled wall, at any tolerated pose, m.
    pub t_y2_m: f64,
    passes: Passes,
    ping_period_s: f64,
}

/// Answers planning questions about an inspection.
#[derive(Debug, Clone)]
pub struct Planner {
    pub(super) inspection: Inspection,
    hidden: Vec<Vec<AngleRange>>,
    stances: Vec<Stance>,
    pub(super) modes: Vec<PlannedMode>,
    pub(super) errors: Option<ExpectedErrors>,
}

impl Planner {
    /// Creates the planner by evaluating the wall from all tolerated poses.
    ///
    /// Errors: a layout that this number of heads can't have; a length, drift or yaw out of range; a head outside the
    /// profile at some pose, or a beam along the tunnel; heads without a common mode.
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
        not_negative("the rate of yaw in rad/s", inspection.yaw_rate_radps)?;
        positive("the speed of sound in m/s", inspection.sound_speed_mps)?;
        let mut stances = Vec::new();
        let mut chords = Vec::new();
        for pose in poses(&inspection) {
            let rings = rings(&inspection, &pose)?;
            if stances.is_empty() {
                chords = common.iter().map(|modes| chords_m(&rings, modes)).collect();
            }
            stances.push(stance(&inspection, &hidden, &common, &pose, &rings)?);
        }
        let mut modes = Vec::with_capacity(common.len());
        for (number, (of_heads, chords_m)) in common.iter().zip(chords).enumerate() {
            let t_y2_m =
                stances.iter().map(|stance| stance.strips.largest_step_m(number)).fold(0.0, f64::max);
            modes.push(planned_mode(&inspection, of_heads, chords_m, t_y2_m)?);
        }
        Ok(Self { inspection, hidden, stances, modes, errors: None })
    }

    /// Returns the planner with a margin for position errors.
    #[must_use]
    pub fn with_errors(self, errors: Option<ExpectedErrors>) -> Self {
        Self { errors, ..self }
    }

    /// Returns the planned inspection.
    pub fn inspection(&self) -> &Inspection {
        &self.inspection
    }

    /// Returns the modes that all heads have, in the order of the first head's list.
    pub fn modes(&self) -> &[PlannedMode] {
        &self.modes
    }

    /// Returns the largest T_max over all tolerated poses, with the heads evenly phased for the speed, m.
    ///
    /// The result includes strips that the vehicle hides from some of its heads. It is infinite if no head sees some
    /// strip.
    ///
    /// Errors: a speed that isn't above zero.
    /// Source: Jorge et al. 2021, Eq. 16.
    pub fn t_max_m(&self, mode: usize, speed_mps: f64) -> Result<f64, SamplingError> {
        positive("the speed in m/s", speed_mps)?;
        let t_m = |stance: &Stance, passes: &Passes, going: &Going| {
            stance.strips.t_max_m(mode, passes, speed_mps, going)
        };
        Ok(self.over_stances(mode, t_m).fold(0.0, f64::max))
    }

    /// Returns the largest speed at which sections will get the verdict pass, with the heads evenly phased for that
    /// speed, m/s.
    ///
    /// T_max plus the margin for position errors then equals the target.
    ///
    /// Errors: a target that isn't above zero, or that no speed meets.
    pub fn v_max_mps(&self, mode: usize, target_m: f64) -> Result<f64, SamplingError> {
        let known_mps = self.known_v_max_mps(mode, target_m)?;
        let Some(planned) = self.modes.get(mode) else {
            debug_assert!(false, "mode {mode}, which has a speed, is one of {}", self.modes.len());
            return Ok(known_mps);
        };
        // At a lower speed, heads that are apart along the hull pass a place at longer intervals, so the margin is
        // larger. The iteration starts at a speed above the solution. Each iteration lowers the speed, until it
        // converges.
        let mut speed_mps = known_mps;
        for _ in 0..FALLS {
            let margin_m = self.margin_m(planned, target_m, speed_mps);
            let less_m = target_m - margin_m;
            let known_mps = self.known_v_max_mps(mode, less_m).map_err(|why| why.of_target(target_m))?;
            speed_mps = known_mps.min(speed_mps);
        }
        Ok(speed_mps)
    }

    /// Returns the margin for position errors in a mode at a speed, m.
    pub(super) fn margin_m(&self, planned: &PlannedMode, target_m: f64, speed_mps: f64) -> f64 {
        let target = self.target(target_m);
        margin::position_margin_m(target, self.pass_error_m(planned, speed_mps), planned.t_y2_m)
    }

    /// Target with the confidence that belongs to the expected errors; the confidence is zero if no errors are known.
    pub(super) fn target(&self, max_hole_m: f64) -> Target {
        let confidence_sd = self.errors.as_ref().map_or(0.0, |errors| errors.confidence_sd);
        Target { max_hole_m, confidence_sd }
    }

    /// Standard deviation of the size of a hole between two passes, in a mode at a speed, m; zero if unknown.
    pub(super) fn pass_error_m(&self, planned: &PlannedMode, speed_mps: f64) -> f64 {
        let Some(errors) = &self.errors else { return 0.0 };
        let passes_per_s = self.inspection.heads.len() as f64 / planned.mode.turn.period_s();
        let apart_m = self.stances.first().map_or(0.0, |stance| stance.apart_m);
        errors.pass_error_m(margin::error_time_s(passes_per_s, apart_m, speed_mps, APART_SHARE))
    }

    /// Returns a mode's largest speed for a target without margins, with one margin, with two margins, and so on.
    ///
    /// Errors: as for [`Planner::v_max_mps`].
    pub fn margins(&self, mode: usize, target_m: f64) -> Result<Margins, SamplingError> {
        let planned = self.modes.get(mode).ok_or(SamplingError::NoCommonMode)?;
        let steady = Going { ping_period_s: planned.ping_period_s, ..Going::default() };
        let even = &planned.passes;
        let mut slowest = [f64::INFINITY; 3];
        for stance in &self.stances {
            let phased = even.beside(stance.parallax_rad);
            let shifted = Going { shift_m: stance.shift_m, ..steady };
            let geometry = stance.strips.bound_if_all_seen_mps(mode, even, target_m, &steady);
            let hidden = stance.strips.bound_for_target(mode, even, target_m, &steady)?.speed_mps;
            let phase = stance.strips.bound_for_target(mode, &phased, target_m, &shifted)?.speed_mps;
            for (slot, speed_mps) in slowest.iter_mut().zip([geometry.unwrap_or(0.0), hidden, phase]) {
                *slot = slot.min(speed_mps);
            }
        }
        let [geometry, hidden, phase] = slowest;
        let (swing, position) = (self.known_v_max_mps(mode, target_m)?, self.v_max_mps(mode, target_m)?);
        Ok(Margins::of(
            [geometry, hidden, phase, swing, position, position],
            self.pass_error_m(planned, position),
        ))
    }

    /// Returns the speed at which T_max equals the target, with the heads evenly phased for that speed, m/s.
    ///
    /// The function is the inverse of [`Planner::t_max_m`], without position errors.
    ///
    /// Errors: a target that isn't above zero, or that no speed meets.
    pub fn known_v_max_mps(&self, mode: usize, target_m: f64) -> Result<f64, SamplingError> {
        positive("the target in metres", target_m)?;
        let speed = |stance: &Stance, passes: &Passes, going: &Going| {
            stance.strips.bound_for_target(mode, passes, target_m, going).map(|bound| bound.speed_mps)
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
        of: impl Fn(&Stance, &Passes, &Going) -> T,
    ) -> impl Iterator<Item = T> {
        let planned = self.modes.get(mode);
        self.stances.iter().filter_map(move |stance| {
            let planned = planned?;
            let Inspection { yaw_rad, yaw_rate_radps, .. } = self.inspection;
            let swing_mps = yaw_rate_radps * stance.farthest_m;
            let going = Going {
                ping_period_s: planned.ping_period_s,
                swing_mps,
                shift_m: stance.shift_m,
                apart_m: stance.apart_m,
                apart_swing_mps: swing_mps,
                // The vehicle swings at most from the tolerated yaw on one side to the tolerated yaw on the other side.
                // Without a yaw tolerance, a yaw rate may last indefinitely, so no bound is known.
                swing_most_m: (yaw_rad > 0.0).then_some(2.0 * yaw_rad * stance.farthest_m),
            };
            Some(of(stance, &planned.passes.beside(stance.parallax_rad), &going))
        })
    }

    /// Returns the longest times between passes at the nominal pose, s.
    ///
    /// The first time is for places that all heads see, the second for places that at least one head sees.
    pub fn gaps_s(&self, mode: usize) -> Option<(f64, f64)> {
        let planned = self.modes.get(mode)?;
        let gap_s = |seen_by| planned.passes.gap_s(seen_by);
        let strips = self.nominal_strips()?.as_slice();
        let longest = strips.iter().filter_map(|strip| gap_s(strip.seen_by)).fold(0.0, f64::max);
        Some((gap_s(planned.passes.heads())?, longest))
    }

    /// The strips of the wall at the nominal pose. The same heads see all places of a strip.
    pub fn nominal_strips(&self) -> Option<&Strips> {
        self.stances.first().map(|stance| &stance.strips)
    }

    /// The longest ranges from any head to the wall, m: at the nominal pose, and over all tolerated poses.
    pub fn farthest_m(&self) -> (f64, f64) {
        let far = || self.stances.iter().map(|stance| stance.farthest_m);
        (far().next().unwrap_or(0.0), far().fold(0.0, f64::max))
    }

    /// Shortest and longest footprint of the first head's beam on the wall during a turn, m.
    ///
    /// Footprints are measured in the scan plane, at the nominal pose.
    ///
    /// Errors: as for [`Standing::footprint`].
    /// Source: Jorge et al. 2021, Fig. 15.
    pub fn footprints_m(&self) -> Result<[f64; 2], SamplingError> {
        const LOOKED_AT: u32 = 720;
        let (spec, _) = self.inspection.heads.first().ok_or(SamplingError::HeadCount { heads: 0 })?;
        let standing = Standing::new(&self.inspection.profile, &self.nominal_pose(), &spec.mount)?;
        let mut found = [f64::INFINITY, 0.0];
        for k in 0..LOOKED_AT {
            let angle_rad = TAU * f64::from(k) / f64::from(LOOKED_AT);
            let length_m = standing.footprint(angle_rad, spec.beam_rad)?.in_plane_m;
            found = [found[0].min(length_m), found[1].max(length_m)];
        }
        Ok(found)
    }

    /// The largest range to a wall that every head can detect, m.
    pub fn reach_m(&self) -> f64 {
        let reach = |(spec, _): &(HeadSpec, Vec<HeadMode>)| spec.reach_m(self.inspection.sound_speed_mps)[1];
        self.inspection.heads.iter().map(reach).fold(f64::INFINITY, f64::min)
    }

    /// Angles hidden from each head, in that head's sensor frame.
    pub fn hidden(&self) -> &[Vec<AngleRange>] {
        &self.hidden
    }

    /// The vehicle's nominal pose, at chainage 0.
    pub fn nominal_pose(&self) -> Pose {
        pose(&self.inspection, [0.0, 0.0], 0.0)
    }

    /// Returns the heads as set in a mode.
    pub fn specs(&self, mode: usize) -> Vec<HeadSpec> {
        let name = self.modes.get(mode).map(|planned| planned.mode.name);
        let of_head = |(spec, modes): &(HeadSpec, Vec<HeadMode>)| {
            let turn = modes.iter().find(|mode| Some(mode.name) == name)?.turn;
            Some(HeadSpec { step_rad: turn.step_rad(), ping_period_s: turn.ping_period_s(), ..*spec })
        };
        let specs: Vec<HeadSpec> = self.inspection.heads.iter().filter_map(of_head).collect();
        let heads = if name.is_some() { self.inspection.heads.len() } else { 0 };
        debug_assert!(specs.len() == heads, "all of {heads} heads have mode {name:?}: {}", specs.len());
        specs
    }

    /// Schedule of the heads in a mode at a speed.
    ///
    /// Errors: as for [`Schedule::new`].
    pub fn schedule(&self, mode: usize, speed_mps: f64) -> Result<Schedule, SamplingError> {
        Schedule::new(&self.specs(mode), self.inspection.layout, positive("the speed in m/s", speed_mps)?)
    }
}

impl PlannedMode {
    /// T_s: longest time between two pings of any head, seconds.
    pub fn ping_period_s(&self) -> f64 {
        self.ping_period_s
    }

    /// Passes of the heads over a place in this mode.
    pub fn passes(&self) -> &Passes {
        &self.passes
    }
}

/// Returns the more severe of two errors.
///
/// The order from least to most severe is: samples of a turn too far apart, a strip that no head sees, any other error.
/// Of two errors of the same kind, the error with the larger value is more severe.
fn worse(known: Option<SamplingError>, other: SamplingError) -> Option<SamplingError> {
    let weight = |why: &SamplingError| match why {
        SamplingError::UnseenStrip { width_m, .. } => (1, *width_m),
        SamplingError::AngularStep { t_y_m, .. } => (0, *t_y_m),
        _ => (2, 0.0),
    };
    known.filter(|known| weight(known) >= weight(&other)).or(Some(other))
}

/// Returns the modes that all heads have, each as a list with one entry per head.
fn common_modes(heads: &[(HeadSpec, Vec<HeadMode>)]) -> Vec<Vec<HeadMode>> {
    let Some((_, first)) = heads.first() else { return Vec::new() };
    let of_all = |name: &str| -> Option<Vec<HeadMode>> {
        heads.iter().map(|(_, modes)| modes.iter().find(|mode| mode.name == name).copied()).collect()
    };
    first.iter().filter_map(|mode| of_all(mode.name)).collect()
}

/// Returns the nominal pose, followed by the other tolerated poses.
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

pub(super) fn stride_of(step_rad: f64) -> usize {
    Ring::stride(step_rad, RING)
}

fn chords_m(rings: &[Ring], modes: &[HeadMode]) -> [f64; 3] {
    let mut all = [f64::INFINITY, 0.0, 0.0];
    for (ring, mode) in rings.iter().zip(modes) {
        let [least, mean, most] = ring.chords_m(stride(mode));
        all = [all[0].min(least), all[1] + mean / rings.len() as f64, all[2].max(most)];
    }
    all
}

fn stance(
    inspection: &Inspection,
    hidden: &[Vec<AngleRange>],
    common: &[Vec<HeadMode>],
    pose: &Pose,
    rings: &[Ring],
) -> Result<Stance, SamplingError> {
    let specs: Vec<HeadSpec> = inspection.heads.iter().map(|(spec, _)| *spec).collect();
    let perimeter_m = inspection.profile.perimeter_m();
    let mut strips = Strips::default();
    strips.rebuild(perimeter_m, &views(inspection, &specs, hidden, pose, rings)?);
    strips.measure(common.len(), rings.iter(), |setting, head| Some(stride(common.get(setting)?.get(head)?)));
    let place = |spec: &HeadSpec| {
        let place = pose.place(spec.mount.position);
        [place.y(), place.z()]
    };
    let places: Vec<Yz> = specs.iter().map(place).collect();
    let ahead_m =
        |spec: &HeadSpec| passes::ahead_m(&pose.attitude, &spec.mount).ok_or(SamplingError::HeadAskew);
    let ahead_m = specs.iter().map(ahead_m).collect::<Result<Vec<f64>, _>>()?;
    let off_m = ahead_m.iter().zip(&specs).map(|(ahead_m, spec)| ahead_m - spec.mount.position.x());
    Ok(Stance {
        strips,
        farthest_m: rings.iter().map(Ring::longest_range_m).fold(0.0, f64::max),
        parallax_rad: passes::parallax_rad(&inspection.profile, &places),
        shift_m: spread(off_m),
        apart_m: spread(ahead_m.iter().copied()),
    })
}

/// Returns the difference between the largest and the smallest value.
fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    (values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)).max(0.0)
}

/// Returns the parts of the wall that each head sees.
fn views(
    inspection: &Inspection,
    specs: &[HeadSpec],
    hidden: &[Vec<AngleRange>],
    pose: &Pose,
    rings: &[Ring],
) -> Result<Vec<View>, SamplingError> {
    /// Capacity for stretches of wall outside the range limits: half the number of rays.
    const OUT_OF_REACH: usize = RING as usize / 2;
    let programs = layout::programs(specs, inspection.layout, 0.0)?;
    let mut views = Vec::with_capacity(specs.len());
    for (((spec, program), hidden), ring) in specs.iter().zip(&programs).zip(hidden).zip(rings) {
        let standing = Standing::new(&inspection.profile, pose, &spec.mount)?;
        let arc = |angles: &AngleRange| Arc::of(&standing, angles);
        let sector = program.sector.map(|(from_rad, size_rad)| AngleRange { from_rad, size_rad });
        let sector = sector.map(|angles| Sector::of(&standing, &angles)).transpose()?;
        let mut view = View { sector, hidden: Vec::new() };
        view.hidden = hidden.iter().map(arc).collect::<Result<_, _>>()?;
        view.hidden.reserve(OUT_OF_REACH);
        view.hide_out_of_reach(ring, spec.reach_m(inspection.sound_speed_mps));
        views.push(view);
    }
    Ok(views)
}

fn planned_mode(
    inspection: &Inspection,
    of_heads: &[HeadMode],
    chords_m: [f64; 3],
    t_y2_m: f64,
) -> Result<PlannedMode, SamplingError> {
    let mode = of_heads.first().copied().ok_or(SamplingError::NoCommonMode)?;
    let ping_period_s = of_heads.iter().map(|mode| mode.turn.ping_period_s()).fold(0.0, f64::max);
    let heads = HeadSet::first(of_heads.len());
    let turn_s = |head: usize| of_heads.get(head).map_or(0.0, |mode| mode.turn.period_s());
    let passes = match inspection.layout {
        HeadLayout::PhaseShift => Passes::evenly_phased(heads, turn_s)?,
        HeadLayout::SectorOffset => {
            let set = |((spec, _), mode): (&(HeadSpec, Vec<HeadMode>), &HeadMode)| HeadSpec {
                step_rad: mode.turn.step_rad(),
                ping_period_s: mode.turn.ping_period_s(),
                ..*spec
            };
            let specs: Vec<HeadSpec> = inspection.heads.iter().zip(of_heads).map(set).collect();
            let sweep_s = Schedule::new(&specs, inspection.layout, 0.0)?.sweep_s();
            Passes::in_sectors(heads, sweep_s.ok_or(SamplingError::NoCommonMode)?)?
        }
    };
    Ok(PlannedMode { mode, chords_m, t_y2_m, passes, ping_period_s })
}

#[cfg(test)]
mod tests;
