//! How fast one may go, from what is measured now, and what else one could do.

use super::error::SamplingError;
use super::head::{HeadMode, HeadMotion, HeadSet, HeadSpec, MAX_HEADS};
use super::occlusion::{self, AngleRange, Obstacle};
use super::passes::Passes;
use super::ring::{Ring, Standing};
use super::spacing;
use super::strips::{Arc, Strips, View};
use crate::frames::{Point3, Pose, Rot};
use crate::tunnel::Profile;

/// Share of the speed kept back for the error of its measurement.
pub const SPEED_MARGIN: f64 = 0.01;
/// The most modes of a head that alternatives are given for.
pub const MAX_MODES: usize = 8;

/// How far the vehicle may move across the tunnel, m, or turn, as a quaternion's component (half an angle, rad), before
/// the beams of its heads are cast anew. Both change the largest step by well under the speed margin.
const STILL_M: f64 = 0.01;
const STILL_TURN: f64 = 0.002;
/// Soundings of a head's ring: the finest steps of the heads that there are (0.3 degrees).
const RING: u32 = 1200;

/// Everything that the advice depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Situation {
    /// Where the vehicle is; `None` without a fix.
    pub pose: Option<Pose>,
    /// Speed along the tunnel, m/s; below zero on the way back.
    pub speed_mps: f64,
    /// The heads that are turning and give returns.
    pub heads: [Option<HeadMotion>; MAX_HEADS],
}

/// Why the advice is what it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reason {
    /// The distance between passes decides: slower helps.
    HelixPitch,
    /// The distance between neighbours of one turn, or a strip that no head sees, is as large as the target: slower
    /// won't help, another mode or place would.
    AngularStep,
    /// Without a position and heading nothing can be said.
    NoHeadingOrFix,
    /// No head gives returns.
    NoReturns,
}

impl Reason {
    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::HelixPitch => "helix_pitch",
            Self::AngularStep => "angular_step",
            Self::NoHeadingOrFix => "no_heading_or_fix",
            Self::NoReturns => "no_returns",
        }
    }
}

/// What would help where slower doesn't.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Remedy {
    /// Another mode.
    Mode(&'static str),
    /// The middle of the tunnel, level and straight.
    Centre,
}

impl Remedy {
    /// The word used in reports: `centre`, or the mode's name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Mode(name) => name,
            Self::Centre => "centre",
        }
    }
}

/// What all heads could do in one of their modes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternative {
    /// The mode.
    pub mode: &'static str,
    /// The largest speed at which it meets the target with the heads started in phase for it, m/s; zero where none is.
    pub v_max_mps: f64,
}

/// What is left of a dive.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Left {
    /// Length of tunnel in the direction of travel, m.
    pub length_m: f64,
    /// Time, seconds, where it is known.
    pub time_s: Option<f64>,
}

impl Left {
    /// Hours that the length takes at a speed; `None` at zero speed.
    pub fn hours_at(&self, speed_mps: f64) -> Option<f64> {
        (speed_mps > 0.0).then(|| self.length_m / speed_mps / 3600.0)
    }

    /// Whether the time is enough at a speed; `None` where it isn't known.
    pub fn suffices_at(&self, speed_mps: f64) -> Option<bool> {
        let time_s = self.time_s?;
        Some(self.hours_at(speed_mps).is_some_and(|hours| hours * 3600.0 <= time_s))
    }
}

/// The advice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Advice {
    /// The largest speed at which the target is met, m/s; zero where none is.
    pub v_max_mps: f64,
    /// What decides.
    pub reason: Reason,
    /// T_max predicted at the present speed, m; `None` where nothing can be said or nothing bounds it.
    pub predicted_t_m: Option<f64>,
    /// The longest time between two passes over a place that all heads see, seconds.
    pub pass_gap_s: f64,
    /// What that time would be if the heads' passes were spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The largest distance between neighbours of one turn, m.
    pub t_y_m: f64,
    /// Time between two pings, seconds; the longest of any head.
    pub ping_period_s: f64,
    /// By how much the head farthest out of its phase is, radians of its turn; `None` in sectors, or with one head.
    pub phase_error_rad: Option<f64>,
    /// What is left of the tunnel and of the time.
    pub left: Left,
    /// What would help where slower doesn't.
    pub remedy: Option<Remedy>,
    /// The modes that all heads have.
    pub alternatives: [Option<Alternative>; MAX_MODES],
}

impl Advice {
    fn nothing(reason: Reason) -> Self {
        Self {
            v_max_mps: 0.0,
            reason,
            predicted_t_m: None,
            pass_gap_s: 0.0,
            even_pass_gap_s: 0.0,
            t_y_m: 0.0,
            ping_period_s: 0.0,
            phase_error_rad: None,
            left: Left::default(),
            remedy: None,
            alternatives: [None; MAX_MODES],
        }
    }
}

/// What the advice is given for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Task {
    /// Target T, m.
    pub target_m: f64,
    /// Length of the tunnel, m.
    pub length_m: f64,
}

/// A head, and its ring as last cast.
#[derive(Debug, Clone)]
struct AdvisedHead {
    spec: HeadSpec,
    modes: Vec<HeadMode>,
    hidden: Vec<AngleRange>,
    ring: Ring,
    cast_at: Option<Pose>,
    /// The largest steps by stride: of the modes, and of the step that was measured.
    steps_m: Vec<(usize, f64)>,
    /// The same in the middle of the tunnel.
    centred_steps_m: Vec<(usize, f64)>,
}

/// Gives advice; remembers the beams of heads that keep their place in the section.
#[derive(Debug, Clone)]
pub struct Advisor {
    profile: Profile,
    task: Task,
    heads: Vec<AdvisedHead>,
    views: Vec<View>,
    strips: Strips,
    /// The head whose ring is looked at first.
    next: usize,
}

impl Advisor {
    /// For heads with the modes that each has, and the parts of the hull that may stand in their way.
    ///
    /// Allocates: startup only.
    pub fn new(
        profile: &Profile,
        task: Task,
        heads: &[(HeadSpec, Vec<HeadMode>)],
        hull: &[Obstacle],
    ) -> Self {
        let specs: Vec<HeadSpec> = heads.iter().map(|(spec, _)| *spec).collect();
        let hidden = occlusion::hidden_by_vehicle(&specs, hull);
        let [y, z] = profile.reference();
        let centre = Pose { position: Point3::new(0.0, y, z), attitude: Rot::identity() };
        let mut views: Vec<View> = Vec::new();
        let advised = heads.iter().zip(hidden).map(|((spec, modes), hidden)| {
            let mut head = AdvisedHead {
                spec: *spec,
                modes: modes.iter().copied().take(MAX_MODES).collect(),
                hidden,
                ring: Ring::default(),
                cast_at: None,
                steps_m: Vec::with_capacity(MAX_MODES + 1),
                centred_steps_m: Vec::new(),
            };
            views.push(View { sector: None, hidden: Vec::with_capacity(head.hidden.len()) });
            // Casting once makes the room that later casts use; a head that is outside there has nothing to remember.
            if let (Ok(()), Some(view)) = (head.cast(profile, &centre), views.last_mut()) {
                head.centred_steps_m.clone_from(&head.steps_m);
                head.look(profile, &centre, view);
            }
            head.cast_at = None;
            head
        });
        let heads: Vec<AdvisedHead> = advised.collect();
        let mut strips = Strips::with_room(heads.iter().map(|head| head.hidden.len()).sum());
        strips.rebuild(profile.perimeter_m(), &views);
        Self { profile: profile.clone(), task, heads, views, strips, next: 0 }
    }

    /// The largest speed at which the predicted T_max stays within the target, by inverting Eq. 16 with what is
    /// measured: turn period, step, number and phases of the heads as they would meet the wall at that speed, what
    /// the vehicle hides from them, and its place and attitude. `left_s` is the time that is left, where it is known.
    ///
    /// Source: metrics.md, "Speed advice".
    /// Allocates: never.
    pub fn advise(&mut self, situation: &Situation, left_s: Option<f64>) -> Advice {
        let Some(pose) = situation.pose else { return Advice::nothing(Reason::NoHeadingOrFix) };
        if situation.heads.iter().all(Option::is_none) {
            return Advice::nothing(Reason::NoReturns);
        }
        let Ok(t_y_m) = self.largest_step_m(situation, &pose) else {
            return Advice::nothing(Reason::NoHeadingOrFix);
        };
        let speed = situation.speed_mps.abs();
        let passes = Passes::measured(&situation.heads, situation.speed_mps);
        let ping_period_s =
            situation.heads.iter().flatten().map(HeadMotion::ping_period_s).fold(0.0, f64::max);
        let fastest = self.fastest_mps(situation, &passes, ping_period_s, t_y_m);
        let predicted_t_m = self.strips.t_max_m(&passes, speed, ping_period_s, t_y_m);
        let left_m = if situation.speed_mps < 0.0 {
            pose.position.x()
        } else {
            self.task.length_m - pose.position.x()
        };
        let left = Left { length_m: left_m.clamp(0.0, self.task.length_m), time_s: left_s };
        let in_sectors = situation.heads.iter().flatten().any(|motion| motion.sector_rad.is_some());
        let alternatives = self.alternatives(passes.heads(), in_sectors);
        let errors = passes.phase_errors_rad(self.heads.len()).into_iter().flatten();
        Advice {
            v_max_mps: fastest.unwrap_or(0.0) * (1.0 - SPEED_MARGIN),
            reason: if fastest.is_some() { Reason::HelixPitch } else { Reason::AngularStep },
            predicted_t_m: predicted_t_m.is_finite().then_some(predicted_t_m),
            pass_gap_s: passes.gap_s(passes.heads()).unwrap_or(0.0),
            even_pass_gap_s: passes.even_gap_s(),
            t_y_m,
            ping_period_s,
            phase_error_rad: errors
                .max_by(|a, b| a.abs().total_cmp(&b.abs()))
                .filter(|_| passes.heads().len() > 1),
            left,
            remedy: if fastest.is_none() { self.remedy(situation, &alternatives) } else { None },
            alternatives,
        }
    }

    /// The largest step of any head that turns, m.
    ///
    /// A head's beams are cast anew when the vehicle has moved; of several whose beams are old, one a call, since a
    /// vehicle doesn't move far between two.
    fn largest_step_m(&mut self, situation: &Situation, pose: &Pose) -> Result<f64, SamplingError> {
        let count = self.heads.len().max(1);
        let mut may_cast = true;
        let mut seen_anew = false;
        for offset in 0..count {
            let number = (self.next + offset) % count;
            let present = situation.heads.get(number).is_some_and(Option::is_some);
            let (Some(head), Some(view)) = (self.heads.get_mut(number), self.views.get_mut(number)) else {
                continue;
            };
            if present && (head.cast_at.is_none() || may_cast && !head.is_near(pose)) {
                may_cast &= head.cast_at.is_none();
                head.cast(&self.profile, pose)?;
                head.look(&self.profile, pose, view);
                seen_anew |= !head.hidden.is_empty();
                self.next = (number + 1) % count;
            }
        }
        if seen_anew {
            self.strips.rebuild(self.profile.perimeter_m(), &self.views);
        }
        let steps = self.heads.iter_mut().zip(&situation.heads);
        Ok(steps
            .filter_map(|(head, motion)| Some(head.step_m(motion.as_ref()?.step_rad)))
            .fold(0.0, f64::max))
    }

    /// The largest speed at which the phases measured now meet the target; `None` where no speed would, however the
    /// heads were phased.
    fn fastest_mps(
        &self,
        situation: &Situation,
        passes: &Passes,
        ping_period_s: f64,
        t_y_m: f64,
    ) -> Option<f64> {
        let target_m = self.task.target_m;
        let even_gap_s = passes.even_gap_s();
        let bound = spacing::speed_for_target_mps(target_m, t_y_m, even_gap_s, ping_period_s)?;
        self.strips.speed_for_target_mps(passes, target_m, ping_period_s, t_y_m).ok()?;
        let heading = if situation.speed_mps < 0.0 { -1.0 } else { 1.0 };
        let meets = |speed_mps: f64| {
            let then = Passes::measured(&situation.heads, heading * speed_mps);
            self.strips.t_max_m(&then, speed_mps, ping_period_s, t_y_m) <= target_m
        };
        Some(largest_speed_mps(bound, meets))
    }

    /// What each mode that all heads have would allow, those that turn now started in phase.
    fn alternatives(&self, heads: HeadSet, in_sectors: bool) -> [Option<Alternative>; MAX_MODES] {
        let mut alternatives = [None; MAX_MODES];
        let modes = self.heads.first().map_or(&[][..], |head| &head.modes);
        for (slot, mode) in alternatives.iter_mut().zip(modes) {
            let Some(v_mps) = self.mode_speed_mps(mode.name, heads, in_sectors) else { continue };
            *slot = Some(Alternative { mode: mode.name, v_max_mps: v_mps * (1.0 - SPEED_MARGIN) });
        }
        alternatives
    }

    /// The largest speed in a mode, zero where none is; `None` when a head doesn't have it.
    fn mode_speed_mps(&self, name: &str, heads: HeadSet, in_sectors: bool) -> Option<f64> {
        let (mut period_s, mut ping_period_s, mut t_y_m) = (0.0_f64, 0.0_f64, 0.0_f64);
        for head in heads.iter().filter_map(|number| self.heads.get(number)) {
            let mode = head.modes.iter().find(|mode| mode.name == name)?;
            period_s = period_s.max(mode.turn.period_s());
            ping_period_s = ping_period_s.max(mode.turn.ping_period_s());
            t_y_m = t_y_m.max(head.known_step_m(stride(mode.turn.step_rad()))?);
        }
        let passes = if in_sectors {
            // Sectors stay as large as they are, however many heads are left.
            Passes::in_sectors(heads, period_s, 2.0 * period_s / self.heads.len().max(1) as f64)
        } else {
            Passes::evenly_phased(heads, period_s)
        };
        let speed = self.strips.speed_for_target_mps(&passes.ok()?, self.task.target_m, ping_period_s, t_y_m);
        Some(speed.unwrap_or(0.0))
    }

    fn remedy(&self, situation: &Situation, alternatives: &[Option<Alternative>]) -> Option<Remedy> {
        let centred = |(head, motion): (&AdvisedHead, &Option<HeadMotion>)| {
            let stride = stride(motion.as_ref()?.step_rad);
            head.centred_steps_m.iter().find(|(known, _)| *known == stride).map(|(_, step_m)| *step_m)
        };
        let in_the_middle = self.heads.iter().zip(&situation.heads).filter_map(centred).reduce(f64::max);
        if in_the_middle.is_some_and(|t_y_m| t_y_m < self.task.target_m)
            && self.strips.as_slice().iter().all(|strip| !strip.seen_by.is_empty())
        {
            return Some(Remedy::Centre);
        }
        let best = alternatives.iter().flatten().max_by(|a, b| a.v_max_mps.total_cmp(&b.v_max_mps));
        best.filter(|best| best.v_max_mps > 0.0).map(|best| Remedy::Mode(best.mode))
    }

    /// The heads on which some strip depends that not all of them see.
    pub fn hidden_from(&self) -> HeadSet {
        let hidden = self.heads.iter().enumerate().filter(|(_, head)| !head.hidden.is_empty());
        hidden.fold(HeadSet::default(), |set, (number, _)| set.with(number))
    }
}

impl AdvisedHead {
    fn is_near(&self, pose: &Pose) -> bool {
        let Some(cast_at) = &self.cast_at else { return false };
        let near = |a: &[f64], b: &[f64], by: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= by);
        let place = |pose: &Pose| [pose.position.y(), pose.position.z()];
        near(&place(cast_at), &place(pose), STILL_M)
            && near(&cast_at.attitude.wxyz(), &pose.attitude.wxyz(), STILL_TURN)
    }

    /// Casts the head's ring anew and takes the largest steps from it.
    fn cast(&mut self, profile: &Profile, pose: &Pose) -> Result<(), SamplingError> {
        self.cast_at = None;
        let standing = Standing::new(profile, pose, &self.spec.mount)?;
        self.ring.recast(&standing, 0.0, RING)?;
        self.steps_m.clear();
        for mode in &self.modes {
            let stride = stride(mode.turn.step_rad());
            self.steps_m.push((stride, self.ring.largest_step_m(stride)));
        }
        self.cast_at = Some(*pose);
        Ok(())
    }

    /// Where on the wall its hidden angles fall.
    fn look(&self, profile: &Profile, pose: &Pose, view: &mut View) {
        view.hidden.clear();
        let Ok(standing) = Standing::new(profile, pose, &self.spec.mount) else { return };
        view.hidden.extend(self.hidden.iter().filter_map(|angles| Arc::of(&standing, angles).ok()));
    }

    fn known_step_m(&self, stride: usize) -> Option<f64> {
        self.steps_m.iter().find(|(known, _)| *known == stride).map(|(_, step_m)| *step_m)
    }

    /// The largest step at this angle between pings, m.
    fn step_m(&mut self, step_rad: f64) -> f64 {
        let stride = stride(step_rad);
        self.known_step_m(stride).unwrap_or_else(|| {
            let step_m = self.ring.largest_step_m(stride);
            self.steps_m.truncate(self.modes.len());
            self.steps_m.push((stride, step_m));
            step_m
        })
    }
}

fn stride(step_rad: f64) -> usize {
    Ring::stride(step_rad, RING)
}

/// The largest speed up to `fastest_mps` that `meets` the target.
///
/// Heads apart along the hull keep their phases at one speed only, so that what meets the target isn't an interval:
/// speeds are tried from above, and the edge of the first that meets it is then closed in on.
fn largest_speed_mps(fastest_mps: f64, meets: impl Fn(f64) -> bool) -> f64 {
    const TRIED: u32 = 64;
    // The bound itself is met but for rounding when the heads are evenly phased.
    let at = |k: u32| fastest_mps * (1.0 - f64::from(k) / f64::from(TRIED)) * (1.0 - 1e-12);
    let Some(first) = (0..TRIED).find(|k| meets(at(*k))) else { return 0.0 };
    let Some(too_fast) = first.checked_sub(1) else { return at(0) };
    let (mut good, mut bad) = (at(first), at(too_fast));
    for _ in 0..20 {
        let middle = f64::midpoint(good, bad);
        if meets(middle) {
            good = middle;
        } else {
            bad = middle;
        }
    }
    good
}

#[cfg(test)]
mod tests;
