//! The sections, how they are judged, and the missed stretches that flagged sections form.

use core::ops::Range;

use crate::cause::{Cause, Causes};
use crate::evidence::Evidence;
use crate::explain::{Case, explain};
use crate::frontier::{Outlook, Reach, clear_of};
use crate::hole::{FARTHEST_M, Hole, HoleFinder, WallChanges};
use crate::missing_samples::MissingSamples;
use crate::openings::Opening;
use crate::passage::PassError;
use crate::runs::{Run, RunChange, RunId, RunUpdate, Runs};
use crate::section::{Judgement, Metres, Section, Verdict};
use crate::store::SampleStore;
use crate::unsure::{Driven, Stretch};
use crate::visits::Visit;
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::{Profile, WallPoint};
use headrace_sampling::Target;

/// Request to judge a section, with the outlook at a given time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Index of the section, from chainage zero.
    pub section: i64,
    /// Time at which the request was made.
    pub at: MonoNs,
    /// Stretch that every awaited head had swept at this time. A head is awaited if its samples may still land.
    pub swept_by_all: Option<Reach>,
    /// Whether no head was alive at this time.
    pub none_alive: bool,
    /// Stretch where samples may still land if the vehicle does not turn back.
    pub to_come: Option<Reach>,
    /// Stretch where some heads have not been. They will not reach it unless the vehicle turns back.
    pub not_passed: Option<Reach>,
    /// Stretch where all heads have been, at the end of the dive. `None` before the end.
    pub ended: Option<Ended>,
    /// Whether the section is judged only if it is certain to fail, because of a large empty circle in which no more
    /// samples can land. The circle need not be its largest hole.
    pub only_fails: bool,
}

/// Stretch where all heads have been when the dive ends. It contains `None` if there is no such stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ended(pub Option<Reach>);

impl Ended {
    /// Whether a hole extends to wall where some heads have not been.
    fn is_beyond(self, hole: &Hole) -> bool {
        let radius_m = hole.diameter_m / 2.0;
        self.0.is_none_or(|all| hole.x_m - radius_m < all.from_m || hole.x_m + radius_m > all.to_m)
    }
}

/// Initial check positions. They are below and above every finite reach, so the first movement causes a check.
pub(super) const LOOK_AT_ONCE: [f64; 2] = [f64::MIN, f64::MAX];

impl Request {
    /// Returns a function that makes the request to judge a section, with the time and stretches of the outlook.
    pub fn at(outlook: &Outlook) -> impl Fn(i64) -> Self + use<> {
        let Outlook { at, swept_by_all, none_alive, to_come, not_passed, .. } = *outlook;
        move |section| Self {
            section,
            at,
            swept_by_all,
            none_alive,
            to_come,
            not_passed,
            ended: None,
            only_fails: false,
        }
    }
}

/// Measured hole of a section.
struct Measured {
    hole: Hole,
    /// Standard deviation of the hole's diameter, m.
    sd_m: f64,
    /// Whether the newest visit alone shows that the section passes.
    by_newest: bool,
    /// Whether the section's doubtful returns, if they were wall, would fill every hole over the target.
    filled_by_doubtful: bool,
}

/// Inputs of judging, and a function to call for each missed stretch that changes.
pub struct Judging<'a> {
    /// Store with all samples.
    pub store: &'a SampleStore,
    /// The most recent missing samples, for the causes of fails.
    pub missing_samples: &'a MissingSamples,
    /// Hole search with its working memory.
    pub finder: &'a mut HoleFinder,
    /// Design profile of the tunnel.
    pub profile: &'a Profile,
    /// Function that is called for every missed stretch that changes.
    pub tell: &'a mut dyn FnMut(RunId, RunChange),
}

/// All sections of the part of the tunnel that the store covers, and the missed stretches.
#[derive(Debug, Clone)]
pub struct Sections {
    pub(super) section_m: f64,
    pub(super) target: Target,
    /// Distance before a missed stretch at which the vehicle's origin should turn round, m.
    run_up_m: f64,
    first: i64,
    /// Number of judged sections by verdict, in the order of [`Verdict::ALL`]. One more entry counts open sections that
    /// were not inspected.
    judged: [u32; Verdict::ALL.len() + 1],
    sections: Vec<Section>,
    runs: Runs,
    /// Chainages that the ends of the heads' reach must pass before sections are checked again, m.
    ///
    /// The first one is for sections behind the heads, the second one for sections ahead.
    pub(super) next_look_m: [f64; 2],
}

stateful!(Sections { state: runs, judged, next_look_m; slots: sections; fixed: section_m, target, run_up_m, first; });

impl Sections {
    /// Creates sections of the length `section_m` over [`from_m`, `to_m`].
    ///
    /// Allocates: at startup, all memory that they will ever use.
    pub fn new(section_m: f64, target: Target, from_m: f64, to_m: f64) -> Self {
        let first = math::floor_to_i64(from_m / section_m);
        let end = -math::floor_to_i64(-to_m / section_m);
        let count = usize::try_from(end - first).unwrap_or(0);
        let runs = Runs::new(first, count, section_m);
        Self {
            section_m,
            target,
            run_up_m: target.max_hole_m,
            first,
            judged: [0; 5],
            sections: vec![Section::default(); count],
            runs,
            next_look_m: LOOK_AT_ONCE,
        }
    }

    /// Sets how far the heads reach in front of or behind the vehicle's origin, m.
    #[must_use]
    pub fn with_heads_reach_m(self, reach_m: f64) -> Self {
        Self { run_up_m: reach_m + self.target.max_hole_m, ..self }
    }

    /// Returns the chainage to which the vehicle's origin has to go back, m, rounded down to a decimetre.
    ///
    /// From there, all heads pass the stretch from its beginning.
    pub fn back_to_m(&self, start_m: f64) -> f64 {
        back_to_m(start_m, self.run_up_m)
    }

    /// Returns the missed stretches.
    pub fn runs(&self) -> &Runs {
        &self.runs
    }

    /// Returns the chainage at which the first missed stretch begins, m; `None` if no section is flagged.
    pub fn missed_from_m(&self) -> Option<f64> {
        let open = self.runs.all().iter().filter(|run| run.is_open());
        open.map(|run| run.from).min().map(|from| self.bounds_m(from).0)
    }

    /// Masks a declared opening in the sections that it overlaps.
    pub fn mask(&mut self, opening: &Opening, profile: &Profile) {
        for index in self.index_of(opening.from_m)..=self.index_of(opening.to_m) {
            let (from_m, to_m) = self.bounds_m(index);
            let share = opening.share_of(from_m, to_m, profile);
            if let Some(section) = self.get_mut(index) {
                section.masked_share = (section.masked_share + share).min(1.0);
            }
        }
    }

    /// Number of sections.
    pub fn len(&self) -> usize {
        self.sections.len()
    }

    /// Whether the tunnel stretch has no sections.
    pub fn is_empty(&self) -> bool {
        self.sections.is_empty()
    }

    /// Length of a section, m.
    pub fn section_m(&self) -> f64 {
        self.section_m
    }

    /// Coverage target, with the confidence of verdicts.
    pub fn target(&self) -> Target {
        self.target
    }

    /// Distance from the heads' reach beyond which the heads have left a section, m.
    ///
    /// Samples that are farther away do not change a pass.
    pub fn left_m(&self) -> f64 {
        self.target.max_hole_m / 2.0
    }

    /// Returns the index of the section at a chainage.
    pub fn index_of(&self, x_m: f64) -> i64 {
        math::floor_to_i64(x_m / self.section_m)
    }

    /// Chainages of a section's two ends, m.
    pub fn bounds_m(&self, index: i64) -> (f64, f64) {
        (index as f64 * self.section_m, (index + 1) as f64 * self.section_m)
    }

    /// Returns a section by its index from chainage zero.
    pub fn get(&self, index: i64) -> Option<&Section> {
        self.sections.get(usize::try_from(index - self.first).ok()?)
    }

    /// Returns mutable access to a section by its index.
    pub fn get_mut(&mut self, index: i64) -> Option<&mut Section> {
        self.sections.get_mut(usize::try_from(index - self.first).ok()?)
    }

    /// Records a sample at `x_m`. Every section within the target T of it must be judged again.
    pub fn touch(&mut self, x_m: f64, visit: &Visit, profile: &Profile) {
        let (from, to) =
            (self.index_of(x_m - self.target.max_hole_m), self.index_of(x_m + self.target.max_hole_m));
        for index in from..=to {
            if let Some(section) = self.get_mut(index) {
                section.stale = true;
                section.visits.note(visit, profile);
            }
        }
    }

    /// Measures a section's hole and updates its verdict, flag and missed stretch.
    ///
    /// Allocates: never.
    pub fn judge(&mut self, request: &Request, judging: &mut Judging<'_>) -> Option<Judgement> {
        let section = self.get(request.section)?;
        if section.verdict == Verdict::Pass && section.visits.are_several() && section.doubt().is_none() {
            // A later visit does not revoke a pass.
            return None;
        }
        let asks = request.only_fails || request.ended.is_some() || section.is_flagged();
        let fails = asks && self.fails_already(request, judging);
        if request.only_fails && !fails {
            return None;
        }
        let measured = self.measure(request.section, judging)?;
        let fails = fails && !measured.filled_by_doubtful;
        if request.only_fails && !fails {
            return None;
        }
        let section = self.get(request.section)?;
        let before = Self::counted(section);
        let is_like = section.hole.is_some_and(|before| before.is_like(&measured.hole));
        let is_same = is_like && section.evidence.is_some() && !section.explained_in_part;
        self.decide(request, &measured, fails, judging)?;
        // Evidence is kept while the hole is unchanged, because the missing samples in it may no longer be stored.
        if self.get(request.section)?.verdict == Verdict::Fail && !is_same {
            let evidence = self.explain(&measured.hole, request, judging);
            let evidence = self.as_beside(request.section, evidence);
            let section = self.get_mut(request.section)?;
            (section.evidence, section.explained_in_part) = (Some(evidence), request.only_fails);
        }
        let section = self.get_mut(request.section)?;
        let (judgement, now) = (section.flag(request.at), Self::counted(section));
        self.count(before, now);
        self.tell_runs(request, judging);
        Some(judgement)
    }

    /// Updates a section's hole and verdict. `fails` means that the section is certain to fail, even if its largest
    /// hole does not show it.
    fn decide(
        &mut self,
        request: &Request,
        &Measured { hole, sd_m, by_newest, filled_by_doubtful }: &Measured,
        fails: bool,
        judging: &mut Judging<'_>,
    ) -> Option<()> {
        let (target, (from_m, to_m)) = (self.target, self.bounds_m(request.section));
        let clear_m = clear_of(request.to_come, hole.x_m);
        let passed_m = clear_of(request.not_passed, hole.x_m);
        let section = self.get_mut(request.section)?;
        let had_a_flag = section.is_flagged();
        section.hole = Some(hole);
        section.hole_sd_m = sd_m;
        section.filled_by_doubtful = filled_by_doubtful;
        section.verdict = match verdict(&hole, sd_m, target, clear_m.min(passed_m)) {
            Verdict::Pass if section.doubt().is_some() => Verdict::CannotSay,
            Verdict::Fail if filled_by_doubtful => Verdict::CannotSay,
            Verdict::Open | Verdict::CannotSay if fails => Verdict::Fail,
            verdict => verdict,
        };

        if by_newest && section.verdict != Verdict::Pass {
            section.verdict = Verdict::Pass;
            section.keep_newest_visit();
        }
        // More samples do not change a pass, and samples outside a hole's radius do not change the hole.
        section.settled = section.verdict == Verdict::Pass || clear_m >= hole.diameter_m / 2.0;
        let alone = verdict(&hole, sd_m, target, clear_m);
        section.not_inspected = section.verdict == Verdict::Open && alone != Verdict::Open;
        if section.not_inspected {
            // The largest hole extends to wall where some heads have not been. Even so, the section may fail because of
            // another hole.
            let radius_m = f64::midpoint(target.max_hole_m, target.error_m(sd_m));
            section.settled &=
                clear_of(request.to_come, from_m).min(clear_of(request.to_come, to_m)) >= radius_m;
            if had_a_flag || !filled_by_doubtful && self.fails_already(request, judging) {
                let section = self.get_mut(request.section)?;
                (section.verdict, section.not_inspected) = (Verdict::Fail, false);
            }
        }
        let section = self.get_mut(request.section)?;
        // At the end of the dive, no more samples will come.
        section.not_inspected |=
            section.verdict == Verdict::Open && request.ended.is_some_and(|ended| ended.is_beyond(&hole));
        if request.ended.is_some() && section.verdict == Verdict::Open && section.is_flagged() {
            // The section had failed. The dive ended while the vehicle was going back over it.
            (section.verdict, section.not_inspected) = (Verdict::Fail, false);
        }
        Some(())
    }

    /// Returns the evidence of a section, with known causes if possible.
    ///
    /// If the section's cause is unknown, it gets the causes of a flagged neighbour. So the edge of a missed stretch
    /// has the causes of the stretch.
    fn as_beside(&self, index: i64, evidence: Evidence) -> Evidence {
        if evidence.cause != Cause::Unknown {
            return evidence;
        }
        let flagged = |index: i64| self.get(index).filter(|section| section.is_flagged())?.evidence;
        match flagged(index - 1).or_else(|| flagged(index + 1)) {
            Some(beside) => Evidence { cause: beside.cause, causes: beside.causes, ..evidence },
            None => evidence,
        }
    }

    /// Returns the index in `judged` under which a section is counted; `None` if it has not been judged.
    fn counted(section: &Section) -> Option<usize> {
        section.hole?;
        Some(if section.not_inspected { Verdict::ALL.len() } else { section.verdict as usize })
    }

    /// Measures the hole that decides a section's verdict.
    ///
    /// The samples of all visits count, unless those of the newest visit alone show that the section passes.
    fn measure(&self, index: i64, judging: &mut Judging<'_>) -> Option<Measured> {
        let Judging { store, finder, profile, .. } = judging;
        let ((from_m, to_m), pass_error) = (self.bounds_m(index), self.pass_error(index));
        let section = self.get(index)?;
        let pass_sd_m = |hole: &Hole| pass_error.sd_m(profile.point_at(hole.arc_m));
        let passes =
            |hole: &Hole, sd_m: f64| verdict(hole, sd_m, self.target, f64::INFINITY) == Verdict::Pass;
        let hole = finder.largest_since(store, from_m, to_m, section.visits.first());
        let sd_m = section.visits.sd_m(pass_sd_m(&hole));
        let is_shown = section.doubt().is_none() && passes(&hole, sd_m);
        if !is_shown && section.is_visited_anew() && section.wall_doubt().is_none() {
            let newest = finder.largest_since(store, from_m, to_m, section.visits.newest());
            let newest_sd_m = pass_sd_m(&newest);
            if passes(&newest, newest_sd_m) {
                return Some(Measured {
                    hole: newest,
                    sd_m: newest_sd_m,
                    by_newest: true,
                    filled_by_doubtful: false,
                });
            }
        }
        let least_m = self.target.max_hole_m + self.target.error_m(sd_m);
        let first_visit = section.visits.first();
        // If the hole is unchanged, its doubtful returns still count, even if they are no longer stored.
        let is_known = section.filled_by_doubtful && section.hole.is_some_and(|before| before.is_like(&hole));
        let filled_by_doubtful = hole.least_m > least_m
            && (is_known || is_filled_by_doubtful(judging, (from_m, to_m), least_m / 2.0, first_visit));
        Some(Measured { hole, sd_m, by_newest: false, filled_by_doubtful })
    }

    /// Moves a judged section from its previous entry in `judged` to its present one.
    fn count(&mut self, before: Option<usize>, now: Option<usize>) {
        if let Some(count) = before.and_then(|before| self.judged.get_mut(before)) {
            *count -= 1;
        }
        if let Some(count) = now.and_then(|now| self.judged.get_mut(now)) {
            *count += 1;
        }
    }

    /// Returns the length of each verdict within the coverage extent, m. Together they are as long as all sections of
    /// the extent.
    pub fn metres(&self, way: Option<Reach>) -> Metres {
        let mut metres = Metres::default();
        let (mut all, section_m) = (self.sections_of(way).count(), self.section_m);
        let judged: u32 = self.judged.iter().sum();
        debug_assert!(
            judged as usize <= all,
            "judged sections are in the coverage extent: {judged} of {all}"
        );
        for (verdict, count) in Verdict::ALL.into_iter().zip(self.judged) {
            if verdict != Verdict::Open {
                metres.add(verdict, f64::from(count) * section_m);
                all = all.saturating_sub(count as usize);
            }
        }
        metres.not_inspected_m = self.judged.last().map_or(0.0, |count| f64::from(*count) * section_m);
        metres.add(Verdict::Open, all as f64 * section_m - metres.not_inspected_m);
        metres
    }

    /// Returns the error between the passes through a section.
    ///
    /// If no head pinged in the section, it is the largest error of the sections that are at most half the target away.
    pub(super) fn pass_error(&self, index: i64) -> PassError {
        if let Some(section) = self.get(index).filter(|section| section.passage.placed > 0) {
            return section.passage.pass_error;
        }
        let (from_m, to_m) = self.bounds_m(index);
        let near = self.index_of(from_m - self.target.max_hole_m / 2.0)
            ..=self.index_of(to_m + self.target.max_hole_m / 2.0);
        near.filter_map(|index| self.get(index)).fold(PassError::default(), |mut worst, section| {
            worst.add(&section.passage.pass_error);
            worst
        })
    }

    /// Adds a flagged section to its missed stretch, or removes a section whose flag has been cleared.
    fn tell_runs(&mut self, request: &Request, judging: &mut Judging<'_>) {
        let Self { sections, runs, first, target, .. } = self;
        let get = |index: i64| sections.get(usize::try_from(index - *first).ok()?);
        let is_consistent = |section: &Section| section.is_consistent(*target);
        debug_assert!(
            get(request.section).is_some_and(is_consistent),
            "a judged section agrees with a target of {} m: {:?}",
            target.max_hole_m,
            get(request.section)
        );
        let flagged = get(request.section).filter(|section| section.is_flagged());
        let evidence = flagged.and_then(|section| section.evidence);
        let failing = evidence.as_ref().map(Evidence::failing);
        let hole = |index: i64| get(index)?.hole;
        runs.set(
            request.section,
            failing,
            &mut RunUpdate { at: request.at, hole: &hole, tell: judging.tell },
        );
    }

    /// Determines the causes of a section's hole. They follow from the heads' passages through all sections within the
    /// target T of it.
    ///
    /// If the heads have left only a part of the section, the largest hole in this part counts.
    fn explain(&self, whole: &Hole, request: &Request, judging: &mut Judging<'_>) -> Evidence {
        let mut bounds_m = self.bounds_m(request.section);
        let near = self.index_of(bounds_m.0 - self.target.max_hole_m)
            ..=self.index_of(bounds_m.1 + self.target.max_hole_m);
        let mut hole = *whole;
        if let Some(reach) = request.to_come.filter(|_| request.only_fails) {
            let left =
                (bounds_m.0.max(reach.to_m + self.left_m()), bounds_m.1.min(reach.from_m - self.left_m()));
            let left = if reach.from_m.is_finite() { (bounds_m.0, left.1) } else { (left.0, bounds_m.1) };
            if left.0 < left.1 {
                let first = self.get(request.section).map_or(0, |section| section.visits.first());
                (bounds_m, hole) = (left, judging.finder.largest_since(judging.store, left.0, left.1, first));
            }
        }
        let beside = |index: i64| {
            let section = self.get(index).filter(|section| section.is_flagged());
            section.and_then(|section| section.evidence).map_or(Causes::default(), |evidence| evidence.causes)
        };
        debug_assert!(self.get(request.section).is_some(), "section {} exists", request.section);
        let here = self.get(request.section).copied().unwrap_or_default();
        let (visits, passage) = (here.visits, here.passage);
        let case = Case {
            hole: &hole,
            bounds_m,
            first_visit: visits.first(),
            swept_by_all: request.swept_by_all,
            to_come: request.to_come,
            none_alive: request.none_alive,
            is_dark: passage.pings == 0 && !passage.silent.is_empty(),
            is_torn: visits.are_unrelated(),
            target_m: self.target.max_hole_m,
            beside: [beside(request.section - 1), beside(request.section + 1)],
            missing_samples: judging.missing_samples,
        };
        let passages = near.filter_map(|index| Some(&self.get(index)?.passage));
        explain(&case, passages, judging.store, judging.finder)
    }

    /// Returns the evidence for one cause of a missed stretch.
    ///
    /// It is that of the section with the largest hole, if this section has the cause. Otherwise it is that of the last
    /// section along the tunnel which has the cause.
    pub fn evidence_of(&self, run: &Run, cause: Cause) -> Option<Evidence> {
        let evidence = |index: i64| self.get(index)?.evidence.filter(|evidence| evidence.causes.has(cause));
        evidence(run.worst.0).or_else(|| (run.from..run.to).rev().find_map(evidence))
    }

    /// Returns the index range of the existing sections that a stretch touches.
    pub fn sections_of(&self, stretch: Option<Reach>) -> Range<i64> {
        let Some(reach) = stretch else { return 0..0 };
        let end = self.first + i64::try_from(self.sections.len()).unwrap_or(i64::MAX);
        clamp(self.index_of(reach.from_m)..self.index_of(reach.to_m) + 1, &(self.first..end))
    }
}

impl Sections {
    /// Returns an unsure section as a stretch; `None` if the section is not unsure.
    pub fn unsure(&self, index: i64) -> Option<Stretch> {
        let section = self.get(index)?;
        let hole_m = section.hole.map_or(0.0, |hole| hole.diameter_m);
        let error_m = self.target.error_m(section.hole_sd_m);
        let driven = Driven::of(&section.passage);
        Some(Stretch::one(section.unsure()?, index, [hole_m, error_m, section.hole_sd_m], driven))
    }

    /// Returns the unsure stretches within `way`, for instance the coverage extent, in order.
    ///
    /// Allocates: the list. Called only at the end of a dive.
    pub fn unsure_stretches(&self, way: Option<Reach>) -> Vec<Stretch> {
        let mut all: Vec<Stretch> = Vec::new();
        for stretch in self.sections_of(way).filter_map(|index| self.unsure(index)) {
            if !all.last_mut().is_some_and(|last| last.join(&stretch, self.section_m())) {
                all.push(stretch);
            }
        }
        all
    }
}

/// Whether doubtful returns, if they were wall, leave no empty circle of `radius_m` centred between the chainages.
fn is_filled_by_doubtful(
    judging: &mut Judging<'_>,
    (from_m, to_m): (f64, f64),
    radius_m: f64,
    first_visit: u32,
) -> bool {
    let Judging { store, missing_samples, finder, .. } = judging;
    if radius_m >= FARTHEST_M {
        return false;
    }
    let doubtful =
        || missing_samples.between(from_m - radius_m, to_m + radius_m).filter(|missing| missing.may_be_wall);
    if doubtful().next().is_none() {
        return false;
    }
    let more = doubtful().map(|missing| WallPoint { x_m: missing.x_m, arc_m: missing.arc_m });
    finder.lay_otherwise((store, first_visit), (from_m, to_m), radius_m, &WallChanges::NOTHING, more);
    !finder.has_circle_otherwise((from_m, to_m), radius_m, &WallChanges::NOTHING)
}

/// Verdict on a hole. Its centre is at the distance `clear_m` from the stretch where samples may still land.
///
/// D is the hole's diameter, `sd_m` (sd) its standard deviation, T the target and k the confidence.
/// - `pass` if D + k sd <= T. More samples do not enlarge D.
/// - `fail` if D - k sd > T for any final D, as samples come no nearer to the centre than `clear_m`.
/// - `fail` also for a hole without samples around it, once no more can come.
/// - `open` otherwise while D may change, and `cannot_say` afterwards.
///
/// A verdict must hold for both the lower and the upper bound of D.
pub(crate) fn verdict(hole: &Hole, sd_m: f64, target: Target, clear_m: f64) -> Verdict {
    let (target_m, error_m) = (target.max_hole_m, target.error_m(sd_m));
    debug_assert!(hole.is_consistent(), "bounds enclose the diameter: {hole:?}");
    debug_assert!(
        error_m >= 0.0 && clear_m >= 0.0,
        "error and distance aren't negative: {error_m}, {clear_m} m"
    );
    let is_left = 2.0 * clear_m >= hole.diameter_m;
    if hole.bounded && hole.most_m + error_m <= target_m {
        Verdict::Pass
    } else if hole.least_m.min(2.0 * clear_m) - error_m > target_m || !hole.bounded && is_left {
        Verdict::Fail
    } else if is_left {
        Verdict::CannotSay
    } else {
        Verdict::Open
    }
}

/// Returns the chainage `run_up_m` before the start of a stretch, m, rounded down to a decimetre.
pub fn back_to_m(start_m: f64, run_up_m: f64) -> f64 {
    math::floor_to_i64((start_m - run_up_m) * 10.0 + 1e-6) as f64 / 10.0
}

pub(super) fn clamp(range: Range<i64>, within: &Range<i64>) -> Range<i64> {
    range.start.max(within.start)..range.end.min(within.end)
}

#[cfg(test)]
mod tests;
