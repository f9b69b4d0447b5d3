//! Why a section failed: the smallest set of factors without which its hole would have met the target.
//!
//! Each factor that was present is taken away from what was measured, by the geometry that makes the hole: samples that
//! are lacking for it are put back, or the wall is drawn together by as much as passes or steps would have been closer.
//! `docs/coverage.md` has the order and its reasons.

use core::iter;

use super::cause::Cause;
use super::causes::Causes;
use super::evidence::Evidence;
use super::frontier::Reach;
use super::hole::{Hole, HoleFinder, Otherwise};
use super::lacks::{Lack, Lacks};
use super::passage::{Drive, Passage};
use super::store::SampleStore;
use headrace_geometry::math;
use headrace_sampling::head::HeadSet;
use headrace_sampling::losses::{LossRate, Sampled};
use headrace_sampling::spacing;

/// A failed section and its surroundings.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// Its hole.
    pub hole: &'a Hole,
    /// Chainages at which it begins and ends, m.
    pub bounds_m: (f64, f64),
    /// Number of the first visit whose samples count.
    pub first_visit: u32,
    /// Stretch that every live head had swept by then.
    pub swept_by_all: Option<Reach>,
    /// Where samples may still land: nothing is known of the wall there.
    pub to_come: Option<Reach>,
    /// No head was alive then.
    pub none_alive: bool,
    /// No head pinged in it, and some went through it silent.
    pub is_dark: bool,
    /// Nothing sure relates its samples to each other.
    pub is_torn: bool,
    /// Target T, m.
    pub target_m: f64,
    /// Causes named of the sections beside it: of equally small sets, those are preferred.
    pub beside: [Causes; 2],
    /// Latest lacks.
    pub lacks: &'a Lacks,
}

/// The share of the target that is left for the hole when speed is put right: a plan keeps a margin.
const MARGIN: f64 = 0.85;
/// Least factor by which the wall is drawn together.
const LEAST: f64 = 0.1;
/// Without a factor that was present, distances are at most this share of what they were.
const HELPS: f64 = 0.93;
/// T as driven over the target from which speed counts although it was the planned one: T is an upper bound of D.
const WELL_OVER: f64 = 1.2;
/// Speed over the planned one from which it wasn't kept to.
const OVER_PLAN: f64 = 1.15;
/// Multiples of the target that what is left of the hole may reach, tried in turn before a larger set is: figures are those
/// of one moment, holes have many.
const ROUGHLY: [f64; 2] = [1.0, 1.05];
/// The same of the swing between passes: even a steady vehicle sways.
const SWINGS: f64 = 0.85;
/// Multiple of the target beyond which what is left of the hole says that something else is the matter.
const AT_MOST: f64 = 1.3;
/// Share of the target from which steps from the middle count.
const COARSE: f64 = 0.75;
/// Ratio of a finer mode's step to the present one.
const FINER: f64 = 0.375;
/// Largest set that is looked for.
const MOST_NAMED: u32 = 3;
/// Most sets that are tried.
const MOST_TRIED: u32 = 120;

/// Determines the causes of a section's hole from the sections within T of it.
///
/// Allocates: never.
pub fn explain<'a>(
    case: &Case<'_>,
    passages: impl Iterator<Item = &'a Passage>,
    store: &SampleStore,
    finder: &mut HoleFinder,
) -> Evidence {
    let seen = Seen::over(passages);
    let drive = seen.worst;
    let present = present(case, &seen, store.perimeter_m());
    let mut trial =
        Trial { case, drive: &drive, seen: &seen, store, finder, left: MOST_TRIED, laid: None, passed: None };
    let causes = trial.smallest(present);
    let in_hole = |lack: &&Lack| is_in(case.hole, case.target_m, store.perimeter_m(), lack);
    let radius_m = case.target_m;
    let sampled =
        Sampled { target_m: case.target_m, t_y_m: drive.middle_t_y_m, perimeter_m: store.perimeter_m() };
    let missing_share = seen.share(seen.missing);
    let is_lossy = causes.has(Cause::MissingReturns);
    let here =
        if is_lossy { sampled.passes_needed(iter::once(LossRate::independent(missing_share))) } else { 1.0 };
    let passes_needed = here.max(drive.passes_needed);
    let lost = case.lacks.between(case.hole.x_m - radius_m, case.hole.x_m + radius_m).filter(in_hole).count();
    Evidence {
        cause: causes.iter().next().unwrap_or(Cause::Unknown),
        causes,
        speed_mps: drive.speed_mps,
        fits_mps: drive.fits_mps,
        pass_gap_s: drive.gap_s,
        even_pass_gap_s: drive.even_gap_s,
        all_pass_gap_s: drive.all_gap_s,
        missing_share,
        with_losses_mps: drive.with_losses_mps(passes_needed),
        occluded_share: seen.share(seen.occluded),
        standing_share: seen.share(seen.standing),
        lost_in_hole: u32::try_from(lost).unwrap_or(u32::MAX),
        t_y_m: drive.t_y_m,
        middle_t_y_m: drive.middle_t_y_m,
        swing_m: drive.swing_m,
        silent_heads: seen.silent,
    }
}

/// Whether a lack lies in a hole, as far as the target matters: the hole may still shrink from ahead.
fn is_in(hole: &Hole, target_m: f64, perimeter_m: f64, lack: &Lack) -> bool {
    let around_m = math::wrap_signed(lack.arc_m - hole.arc_m, perimeter_m);
    math::hypot(lack.x_m - hole.x_m, around_m) < hole.diameter_m.min(target_m) / 2.0
}

/// Counts over sections, and the moment of the largest T as driven.
#[derive(Debug, Clone, Copy, Default)]
struct Seen {
    pings: u32,
    missing: u32,
    occluded: u32,
    standing: u32,
    silent: HeadSet,
    unseen: bool,
    adrift: bool,
    worst: Drive,
}

impl Seen {
    fn over<'a>(passages: impl Iterator<Item = &'a Passage>) -> Self {
        let mut seen = passages.fold(Self::default(), |sum, passage| {
            let drive = passage.drive;
            Self {
                pings: sum.pings.saturating_add(passage.pings),
                missing: sum.missing.saturating_add(passage.missing).saturating_add(passage.out_of_range),
                occluded: sum.occluded.saturating_add(passage.occluded),
                standing: sum.standing.saturating_add(passage.standing),
                silent: sum.silent.union(passage.silent),
                unseen: sum.unseen || passage.unseen,
                adrift: sum.adrift || passage.adrift,
                worst: Drive {
                    t_y_m: sum.worst.t_y_m.max(drive.t_y_m),
                    middle_t_y_m: sum.worst.middle_t_y_m.max(drive.middle_t_y_m),
                    ..sum.worst.or_worse(drive)
                },
            }
        });
        seen.worst.middle_t_y_m = seen.worst.middle_t_y_m.min(seen.worst.t_y_m);
        seen
    }

    fn share(&self, count: u32) -> f64 {
        f64::from(count) / f64::from(self.pings.max(1))
    }
}

/// The factors that were present.
fn present(case: &Case<'_>, seen: &Seen, perimeter_m: f64) -> Causes {
    let Case { hole, bounds_m: (from_m, to_m), target_m, .. } = *case;
    let around_m = target_m / 2.0;
    let lacking = case.lacks.between(from_m - around_m, to_m + around_m);
    let near = |lack: &&Lack| {
        // Whatever is lacking round the wall where the hole is all round.
        let off_m = math::wrap_signed(lack.arc_m - hole.arc_m, perimeter_m).abs();
        off_m < hole.diameter_m + target_m
    };
    let mut present = lacking.filter(near).fold(Causes::default(), |all, lack| all.union(lack.why));
    let drive = &seen.worst;
    let is_passed = is_passed(case);
    let mut add = |is_present: bool, cause: Cause| {
        if is_present {
            present = present.with(cause);
        }
    };
    add(!is_passed && !case.none_alive || !hole.bounded && seen.silent.is_empty(), Cause::NotPassed);
    add(case.is_torn || seen.unseen || seen.adrift, Cause::PositionLost);
    add(is_dark(case, seen), Cause::HeadSilent);
    let coarse = drive.middle_t_y_m > 0.9 * target_m;
    add(drive.middle_t_y_m > COARSE * target_m, Cause::AngularStep);
    let as_planned = spacing::t_max_m(drive.planned_along_m(), drive.advance_m(), drive.middle_t_y_m);
    let over = if coarse { drive.planned_along_m() } else { as_planned } / target_m;
    add(over > WELL_OVER || over > 1.0 && drive.speed_mps > OVER_PLAN * drive.planned_mps, Cause::TooFast);
    let is_slow = drive.is_slow_out_of_phase(1.0 / HELPS);
    add(is_slow || drive.planned_gap_s < HELPS * drive.healthy_gap_s, Cause::Phase);
    let steady = Drive { swing_m: 0.0, ..*drive };
    let aside = drive.middle_t_y_m < HELPS * drive.t_y_m;
    add(steady.along_m() < SWINGS * drive.along_m() || aside, Cause::OffAxis);
    present
}

/// Whether every live head has swept the hole, as far as the target matters.
fn is_passed(case: &Case<'_>) -> bool {
    let radius_m = case.hole.diameter_m.min(case.target_m) / 2.0;
    let [from_m, to_m] = [case.hole.x_m - radius_m, case.hole.x_m + radius_m];
    case.swept_by_all.is_some_and(|swept| from_m >= swept.from_m && to_m <= swept.to_m)
}

/// Silent heads would have pinged nobody knows where: in sectors, never heard, or all of them silent.
fn is_dark(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_in_sectors || is_unheard(case, seen)
}

/// Silent heads were never heard, or none was.
fn is_unheard(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_unheard || case.is_dark
}

/// Tries what a hole would have been without some of the factors.
struct Trial<'a> {
    case: &'a Case<'a>,
    drive: &'a Drive,
    seen: &'a Seen,
    store: &'a SampleStore,
    finder: &'a mut HoleFinder,
    left: u32,
    /// Without which factors the wall was laid out last, and for circles of which radius, m.
    laid: Option<(Causes, f64)>,
    /// Without which factors the section was found last to have met the target itself.
    passed: Option<Causes>,
}

impl Trial<'_> {
    /// The smallest set among these factors without which the section would have met the target.
    fn smallest(&mut self, present: Causes) -> Causes {
        if present.is_empty() || !self.passes_without(present, AT_MOST) {
            return Causes::of(Cause::Unknown);
        }
        // Nothing else is known of wall that wasn't passed.
        let not_passed = Causes::of(Cause::NotPassed);
        if not_passed.is_within(present) && self.passes_without(not_passed, ROUGHLY[1]) {
            return not_passed;
        }
        // Nor of heads that were never there.
        let silent = Causes::of(Cause::HeadSilent);
        if is_unheard(self.case, self.seen) && self.passes_without(silent, ROUGHLY[1]) {
            return silent;
        }
        // A speed is changed most easily: what the planned one would have mended is put down to that.
        let phase = Causes::of(Cause::Phase);
        if self.drive.is_slow_out_of_phase(1.0 / HELPS) && self.passes_without(phase, ROUGHLY[1]) {
            return phase;
        }
        let (lost, is_only_adrift) = (Causes::of(Cause::PositionLost), self.is_only_adrift());
        let mut needed = Causes::default();
        for size in 1..=present.len().min(MOST_NAMED) {
            if size == 2 {
                needed = self.needed(present);
            }
            let sets = (1..=present.bits())
                .filter(|bits| bits & !present.bits() == 0 && bits.count_ones() == size)
                .map(Causes::from_bits);
            let mut roughly = None;
            let fit = |set: &Causes| {
                let is_last = is_only_adrift && size == 1 && *set == lost;
                set.len() == size && set.is_within(present) && needed.is_within(*set) && !is_last
            };
            for set in self.case.beside.into_iter().chain(sets).filter(fit) {
                if !self.passes_without(set, ROUGHLY[1]) {
                    continue;
                }
                if self.passes_without(set, ROUGHLY[0]) {
                    return set;
                }
                roughly = roughly.or(Some(set));
            }
            if let Some(set) = roughly {
                return set;
            }
            if size == 1 && is_only_adrift && self.passes_without(lost, ROUGHLY[1]) {
                return lost;
            }
        }
        present
    }

    /// Whether nothing but the error of one pass against the next speaks of the position: a fail is one in spite of that error, which explains
    /// any hole, so that whatever else does comes first.
    fn is_only_adrift(&self) -> bool {
        self.seen.adrift && !self.seen.unseen && !self.case.is_torn
    }

    /// The factors without which no set will do: all the others together don't.
    fn needed(&mut self, present: Causes) -> Causes {
        let mut is_needed = |cause: &Cause| {
            let others = Causes::from_bits(present.bits() & !Causes::of(*cause).bits());
            !self.passes_without(others, ROUGHLY[1])
        };
        present.iter().filter(|cause| is_needed(cause)).collect()
    }

    /// Whether the section would have met so many times the target without some factors.
    fn passes_without(&mut self, removed: Causes, times: f64) -> bool {
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
        if self.passed == Some(removed) {
            return true;
        }
        let Case { bounds_m, first_visit, target_m, lacks, .. } = *self.case;
        let otherwise = self.otherwise(removed);
        let radius_m = times * target_m / 2.0;
        if !self.laid.is_some_and(|(laid, most_m)| laid == removed && radius_m <= most_m) {
            let reach_m = (target_m + bounds_m.1 - bounds_m.0) / otherwise.along;
            let put_back = lacks
                // Those about to be mirrored, too.
                .between(bounds_m.0 - 2.0 * reach_m, bounds_m.1 + 2.0 * reach_m)
                .filter(|lack| lack.why.is_within(removed))
                .map(|lack| [lack.x_m, lack.arc_m]);
            self.finder.lay_otherwise((self.store, first_visit), bounds_m, radius_m, &otherwise, put_back);
            self.laid = Some((removed, radius_m));
        }
        let mut passes = |radius_m| !self.finder.has_circle_otherwise(bounds_m, radius_m, &otherwise);
        // Most sets that do, do with nothing to spare, and needn't be searched for larger circles.
        if passes(target_m / 2.0) {
            self.passed = Some(removed);
            return true;
        }
        times > 1.0 && passes(radius_m)
    }

    /// How the wall would have been sampled without some factors.
    fn otherwise(&self, removed: Causes) -> Otherwise {
        let all = Some(Reach { from_m: f64::NEG_INFINITY, to_m: f64::INFINITY });
        let swept = self.case.swept_by_all;
        let mut covered = [None; 4];
        // Beyond the end of what was passed, the wall isn't as it is before.
        let to_come = self.case.to_come.filter(|_| is_passed(self.case));
        if to_come.is_none() {
            covered[3] = self.case.to_come;
        }
        if removed.has(Cause::NotPassed) {
            let before = swept.map_or(f64::INFINITY, |swept| swept.from_m);
            let beyond = swept.map_or(f64::NEG_INFINITY, |swept| swept.to_m);
            covered[0] = Some(Reach { from_m: f64::NEG_INFINITY, to_m: before });
            covered[1] = Some(Reach { from_m: beyond, to_m: f64::INFINITY });
        }
        if removed.has(Cause::PositionLost) && (self.case.is_torn || self.seen.unseen || self.seen.adrift)
            || removed.has(Cause::HeadSilent) && is_dark(self.case, self.seen)
        {
            covered[2] = all;
        }
        let then = self.drive.without(removed, MARGIN * self.case.target_m);
        let ratio = |then: f64, was: f64| if was > 0.0 { (then / was).clamp(LEAST, 1.0) } else { 1.0 };
        let finer = if removed.has(Cause::AngularStep) { FINER } else { 1.0 };
        Otherwise {
            // Figures of one moment don't explain more than the hole.
            along: ratio(
                then.along_m(),
                self.drive.along_m().min(self.case.hole.diameter_m.max(then.along_m())),
            ),
            around: ratio(then.t_y_m, self.drive.t_y_m) * finer,
            covered,
            to_come,
        }
    }
}

impl Drive {
    /// The largest speed that fits where it takes so many passes for one, m/s.
    fn with_losses_mps(&self, passes_needed: f64) -> f64 {
        let turn_s = passes_needed * self.all_gap_s + self.ping_period_s;
        if passes_needed > 1.0 {
            self.fits_mps.min(self.fits_along_m / turn_s.max(1e-9))
        } else {
            self.fits_mps
        }
    }

    /// The same without some factors. `margin_m` is the target less a margin, for the speed that would have been right, m.
    fn without(&self, removed: Causes, margin_m: f64) -> Self {
        let mut then = *self;
        if removed.has(Cause::OffAxis) {
            (then.swing_m, then.t_y_m) = (0.0, self.middle_t_y_m.min(self.t_y_m));
        }
        if removed.has(Cause::Phase) && self.is_slow_out_of_phase(1.0 / HELPS) {
            (then.speed_mps, then.healthy_gap_s) = (self.planned_mps, self.all_gap_s);
        } else if removed.has(Cause::Phase) {
            then.healthy_gap_s = self.planned_gap_s.min(self.healthy_gap_s);
        }
        if removed.has(Cause::TooFast) {
            // At the planned speed, heads as scheduled are evenly spread.
            if self.planned_gap_s > 0.0 {
                then.healthy_gap_s *= (self.all_gap_s / self.planned_gap_s).min(1.0);
            }
            let t_y_m = if removed.has(Cause::AngularStep) { FINER * then.t_y_m } else { self.middle_t_y_m };
            let squared = (margin_m - t_y_m) * (margin_m + t_y_m);
            let along_m = math::sqrt(squared.max(0.0)).max(0.3 * margin_m);
            let fits = along_m / (then.speed_mps * self.all_gap_s + self.advance_m()).max(1e-9);
            // What is advised allows for wall that the vehicle hides.
            let advised = if self.fits_mps > 0.0 { self.fits_mps / then.speed_mps.max(1e-9) } else { 1.0 };
            then.speed_mps *= fits.min(advised).min(1.0);
        }
        then
    }
}

#[cfg(test)]
mod tests;
