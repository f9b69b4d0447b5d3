//! Keeps the plan up to date during the dive.

use serde::{Deserialize, Serialize};

use super::missed::MissedList;
use super::route::{Changes, DivePlan, DiveStep, Onward, Pass, Roll, Start, StepKind, plan};
use super::selection::MOST_PASSES;
use headrace_coverage::RunId;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::head::HeadMotion;
use headrace_sampling::passes::{Phasing, Situation};

/// Chainage of the portal, at which a dive ends, m.
const PORTAL_M: f64 = 0.0;
/// Interval between two plans, unless the missed stretches change.
const EVERY: DurNs = DurNs(1_000_000_000);
/// Distance from the end of a pass within which the pass begins, m.
const AT_END_M: f64 = 0.2;
/// Distance beyond the end of a pass up to which its verdict is awaited, m.
const JUDGED_M: f64 = 0.5;
/// Distance driven back after which a pass is given up, m.
const TURNED_M: f64 = 0.3;
/// Speed over the limit at which a pass is given up, as a ratio. Smaller excesses are usual.
const TOO_FAST: f64 = 1.05;
/// Speed below which the vehicle may be about to turn, m/s.
const SLOW_MPS: f64 = 0.02;
/// Ratio between neighbouring speeds of the search for the speed on the way out, and their number.
const SLOWER_BY: f64 = 0.97;
const SLOWER: usize = 60;

/// Settings of the plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlanSettings {
    /// Chainage up to which the tunnel is inspected: the end of the tunnel or of the cable, m.
    pub(crate) end_m: f64,
    /// Speed without inspecting, m/s.
    pub(crate) transit_mps: f64,
    /// Speed for which the heads are set in phase, m/s; zero if none is planned.
    pub(crate) planned_mps: f64,
    /// Distance before wall to inspect from which all heads pass it, m.
    pub(crate) run_up_m: f64,
}

/// State of the vehicle at an advice update.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Now<'a> {
    pub(crate) at: MonoNs,
    pub(crate) situation: &'a Situation,
    /// Whether the position is known well enough.
    pub(crate) is_sure: bool,
    /// Largest speed, m/s; `None` if the position is doubtful, or no speed meets the target.
    pub(crate) v_max_mps: Option<f64>,
    /// Remaining time, s; `None` if it is unlimited.
    pub(crate) left_s: Option<f64>,
}

/// Pass that the vehicle is making.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Begun {
    is_inward: bool,
    /// Farthest chainage in the direction of the pass, m.
    farthest_m: f64,
}

/// Progress of the dive, from which plans are made.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Progress {
    /// First, lowest and highest chainage of the vehicle, m.
    visited_m: Option<[f64; 3]>,
    /// Last advised speed on the way inwards, m/s.
    inward_mps: Option<f64>,
    begun: Option<Begun>,
    /// Stretch that has been passed while rolled left.
    rolled: Option<RunId>,
    /// Time of the last plan, with the count and the total length of the missed stretches then.
    planned: Option<(MonoNs, usize, f64)>,
}

/// Planner with its state.
#[derive(Debug, Clone)]
pub(crate) struct Planner {
    settings: PlanSettings,
    progress: Progress,
}

stateful!(Planner { state: progress; fixed: settings; });

/// Passes over the missed stretches, in ascending order.
#[derive(Clone, Copy)]
struct PassList([Option<Pass>; MOST_PASSES]);

impl Planner {
    pub(crate) fn new(settings: PlanSettings) -> Self {
        Self { settings, progress: Progress::default() }
    }

    /// The plan at an advice update; `before` is the plan at the update before.
    ///
    /// There is no plan without a position or without missed stretches. Allocates: never.
    pub(crate) fn update(
        &mut self,
        now: &Now<'_>,
        missed: &MissedList,
        before: Option<DivePlan>,
    ) -> Option<DivePlan> {
        let Some(x_m) = now.situation.pose.map(|pose| pose.position.x()) else {
            self.progress.begun = None;
            return None;
        };
        let speed_mps = now.situation.speed_mps;
        let progress = &mut self.progress;
        if now.is_sure || progress.visited_m.is_none() {
            let [first_m, least_m, most_m] = progress.visited_m.unwrap_or([x_m; 3]);
            progress.visited_m = Some([first_m, least_m.min(x_m), most_m.max(x_m)]);
        }
        if speed_mps > -SLOW_MPS {
            progress.inward_mps = now.v_max_mps.or(progress.inward_mps);
        }
        if missed.iter().next().is_none() {
            progress.planned = None;
            return None;
        }
        let mut passes = self.passes(now.situation, missed);
        let had = self.progress.begun;
        self.follow(x_m, speed_mps, &passes, before);
        let begun = self.begun(x_m, now.left_s, &mut passes);
        let now_missed = (missed.iter().count(), missed.iter().map(|entry| entry.missed_m).sum::<f64>());
        let is_due = self.progress.planned.is_none_or(|(at, count, missed_m)| {
            now.at.since(at).0 >= EVERY.0 || count != now_missed.0 || (missed_m - now_missed.1).abs() > 1e-9
        });
        let is_same_pass =
            had.map(|begun| begun.is_inward) == self.progress.begun.map(|begun| begun.is_inward);
        if !is_due && is_same_pass && before.is_some() {
            return before;
        }
        self.progress.planned = Some((now.at, now_missed.0, now_missed.1));
        let start = Start {
            x_m,
            home_m: PORTAL_M,
            transit_mps: self.settings.transit_mps,
            left_s: now.left_s,
            begun,
        };
        let (list, count) = passes.packed(start.x_m);
        Some(plan(&start, list.get(..count).unwrap_or_default(), self.onward(x_m)))
    }

    /// Tunnel ahead of the farthest chainage, unless the dive has begun at the far end.
    fn onward(&self, x_m: f64) -> Option<Onward> {
        let [first_m, least_m, most_m] = self.progress.visited_m?;
        let is_inward = most_m - first_m >= first_m - least_m;
        let is_left = self.settings.end_m.is_finite() && most_m < self.settings.end_m - AT_END_M;
        let at_most_mps = self.inward_mps().filter(|_| is_inward && is_left)?;
        let from_m = x_m.clamp(most_m - self.settings.run_up_m, most_m);
        Some(Onward { from_m, to_m: self.settings.end_m, at_most_mps })
    }

    fn inward_mps(&self) -> Option<f64> {
        self.progress.inward_mps.or(Some(self.settings.planned_mps)).filter(|mps| *mps > 0.0)
    }

    fn passes(&self, situation: &Situation, missed: &MissedList) -> PassList {
        let mut passes = PassList([None; MOST_PASSES]);
        let otherwise_mps = self.inward_mps().unwrap_or(self.settings.transit_mps);
        let farthest_m = self.progress.visited_m.map_or(0.0, |[.., most_m]| most_m.max(self.settings.end_m));
        let mut last = (0.0, 0.0);
        for (entry, slot) in missed.iter().zip(&mut passes.0) {
            let inward_mps = if entry.at_most_mps > 0.0 { entry.at_most_mps } else { otherwise_mps };
            if inward_mps.total_cmp(&last.0).is_ne() {
                last = (inward_mps, outward_mps(situation, self.settings.planned_mps, inward_mps));
            }
            let pass = entry.pass(inward_mps, last.1);
            let is_half = self.progress.rolled == Some(pass.run) && pass.roll == Roll::Left;
            let roll = if is_half { Roll::Right } else { pass.roll };
            let far_m = pass.far_m.min(farthest_m);
            *slot = Some(Pass { near_m: pass.near_m.max(PORTAL_M).min(far_m), far_m, roll, ..pass });
        }
        passes
    }

    /// Notes whether the vehicle is making a pass that the plan contains next.
    fn follow(&mut self, x_m: f64, speed_mps: f64, passes: &PassList, before: Option<DivePlan>) {
        let Some(pass) = passes.at(x_m).and_then(|number| *passes.0.get(number)?) else {
            self.progress.begun = None;
            return;
        };
        let limit_mps =
            |is_inward: bool| TOO_FAST * if is_inward { pass.inward_mps } else { pass.outward_mps };
        if let Some(begun) = &mut self.progress.begun {
            let along = if begun.is_inward { 1.0 } else { -1.0 };
            begun.farthest_m = along * (along * begun.farthest_m).max(along * x_m);
            let has_turned = along * (begun.farthest_m - x_m) > TURNED_M;
            if has_turned || speed_mps.abs() > limit_mps(begun.is_inward) {
                self.progress.begun = None;
            }
        }
        let next = before.into_iter().flat_map(|plan| plan.steps).take(2).flatten();
        let mut next = next.filter(|step| step.kind == StepKind::Inspect);
        if self.progress.begun.is_none()
            && let Some(step) = next.find(|step| (step.from_m - x_m).abs() <= AT_END_M)
        {
            let is_inward = step.to_m > step.from_m;
            let along_mps = if is_inward { speed_mps } else { -speed_mps };
            let may_go = (-SLOW_MPS..=limit_mps(is_inward)).contains(&along_mps);
            self.progress.begun = may_go.then_some(Begun { is_inward, farthest_m: x_m });
        }
    }

    /// The rest of the pass that the vehicle is making. Its stretch is removed from `passes`, unless a second pass is
    /// due. `None` if the remaining time does not suffice for it and for the way home.
    fn begun(&mut self, x_m: f64, left_s: Option<f64>, passes: &mut PassList) -> Option<DiveStep> {
        let Begun { is_inward, .. } = self.progress.begun?;
        let slot = passes.at(x_m).and_then(|number| passes.0.get_mut(number))?;
        let pass = (*slot)?;
        let (to_m, mps) =
            if is_inward { (pass.far_m, pass.inward_mps) } else { (pass.near_m, pass.outward_mps) };
        let is_over = if is_inward { x_m >= to_m } else { x_m <= to_m };
        let takes_s = (to_m - x_m).abs() / mps.min(self.settings.transit_mps)
            + (to_m - PORTAL_M).abs() / self.settings.transit_mps;
        if !is_over && left_s.is_some_and(|left_s| left_s < takes_s) {
            return None;
        }
        if is_over && pass.roll == Roll::Left {
            (self.progress.rolled, self.progress.begun) = (Some(pass.run), None);
            *slot = Some(Pass { roll: Roll::Right, ..pass });
            return None;
        }
        *slot = (pass.roll == Roll::Left).then_some(Pass { roll: Roll::Right, ..pass });
        let (kind, at_most_mps) = (StepKind::Inspect, pass.is_speed_known.then_some(mps));
        let Pass { run, roll, changes, .. } = pass;
        let step =
            DiveStep { kind, from_m: x_m, to_m, at_most_mps, roll, run: Some(run), changes, ends_s: 0.0 };
        (!is_over).then_some(step)
    }
}

impl PassList {
    fn iter(&self) -> impl Iterator<Item = &Pass> {
        self.0.iter().flatten()
    }

    /// Number of the pass that the vehicle at `x_m` is in, or whose verdict it awaits.
    fn at(&self, x_m: f64) -> Option<usize> {
        let away_m = |pass: &Pass| (pass.near_m - x_m).max(x_m - pass.far_m).max(0.0);
        let numbered =
            self.0.iter().enumerate().filter_map(|(number, pass)| Some((number, away_m(&(*pass)?))));
        let near = numbered.filter(|(_, away_m)| *away_m <= JUDGED_M);
        near.reduce(|a, b| if b.1 < a.1 { b } else { a }).map(|(number, _)| number)
    }

    /// The passes without empty slots, and their number.
    fn packed(&self, x_m: f64) -> ([Pass; MOST_PASSES], usize) {
        let none = Pass {
            run: RunId(0),
            near_m: x_m,
            far_m: x_m,
            missed_m: 0.0,
            inward_mps: 1.0,
            outward_mps: 1.0,
            is_speed_known: false,
            roll: Roll::Level,
            changes: Changes::default(),
        };
        let mut packed = [none; MOST_PASSES];
        let used = self.iter().zip(&mut packed).map(|(pass, slot)| *slot = *pass).count();
        (packed, used)
    }
}

/// Largest speed outwards that leaves gaps no longer than `inward_mps` does inwards, m/s; zero if there is none.
///
/// Heads that are apart along the hull are set in phase for the way inwards. On the way out they pass the wall in
/// another order.
fn outward_mps(situation: &Situation, planned_mps: f64, inward_mps: f64) -> f64 {
    let phasing = Phasing::of(situation).as_scheduled(situation.configured, planned_mps);
    if phasing.apart_m() <= 0.0 {
        return inward_mps;
    }
    let ping_s = situation.heads.iter().flatten().map(HeadMotion::ping_period_s).fold(0.0, f64::max);
    let along_m = |mps: f64| {
        let passes = phasing.at(mps);
        mps.abs() * (passes.gap_s(passes.heads()).unwrap_or(f64::INFINITY) + ping_s)
    };
    let most_m = along_m(inward_mps) * (1.0 + 1e-9);
    let mut mps = inward_mps;
    for _ in 0..SLOWER {
        if along_m(-mps) <= most_m {
            return mps;
        }
        mps *= SLOWER_BY;
    }
    0.0
}

#[cfg(test)]
mod tests;
