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
/// Least and largest factor by which the wall is drawn together, or apart: a finer step or a longer range takes longer to go round.
const LEAST: f64 = 0.1;
const MOST: f64 = 3.0;
/// Without a factor that was present, distances are at most this share of what they were.
const HELPS: f64 = 0.93;
/// T as driven over the target from which speed counts although it was the planned one: T is an upper bound of D.
const WELL_OVER: f64 = 1.2;
/// Speed over the planned one from which it wasn't kept to.
const OVER_PLAN: f64 = 1.15;
/// Multiples of the target that what is left of the hole may reach, tried in turn before a larger set is: figures are those
/// of one moment, holes have many.
const ROUGHLY: [f64; 2] = [1.0, 1.0];
/// The same of the swing between passes: even a steady vehicle sways.
const SWINGS: f64 = 0.85;
/// Multiple of the target beyond which what is left of the hole says that something else is the matter.
const AT_MOST: f64 = 1.3;
/// Share of the target from which steps from the middle count.
const COARSE: f64 = 0.75;
/// Multiple of the target up to which a hole's size counts where it is asked what is lacking about it.
const WIDEST: f64 = 8.0;
/// Least and largest factor on a hole's size between which it is searched for with all that is lacking put back, and the steps of the search.
const SEARCHED: u32 = 5;
/// Share of what is lacking near a hole, for reasons that stay, from which that alone makes a hole.
const STAYS: f64 = 0.15;
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
    let mut trial = Trial::new(case, &seen, store, finder, present);
    let causes = trial.smallest();
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
    let around_m = (hole.diameter_m.min(WIDEST * target_m) + target_m) / 2.0;
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
    let is_uneven = drive.planned_gap_s < HELPS * drive.healthy_gap_s;
    // At another speed heads apart along the hull may happen to be even.
    let is_fast = drive.speed_mps > OVER_PLAN * drive.planned_mps;
    add(is_slow || is_uneven || is_fast && drive.all_gap_s < HELPS * drive.healthy_at_plan_s, Cause::Phase);
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

/// Silent heads would have pinged nobody knows where: in sectors, never heard, or all of them silent for longer than is remembered.
fn is_dark(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_in_sectors || is_unheard(case, seen)
}

/// Silent heads were never heard, or none was.
fn is_unheard(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_unheard || case.is_dark && !is_remembered(case)
}

/// Whether it is known where the silent heads would have pinged in the section.
fn is_remembered(case: &Case<'_>) -> bool {
    let mut lacking = case.lacks.between(case.bounds_m.0, case.bounds_m.1);
    lacking.any(|lack| lack.why.has(Cause::HeadSilent))
}

/// Tries what a hole would have been without some of the factors.
struct Trial<'a> {
    case: &'a Case<'a>,
    drive: &'a Drive,
    seen: &'a Seen,
    store: &'a SampleStore,
    finder: &'a mut HoleFinder,
    /// The factors that were present.
    present: Causes,
    left: u32,
    /// Without which factors the wall was laid out last, and for circles of which radius, m.
    laid: Option<(Causes, f64)>,
    /// Without which factors the section was found last to have met the target itself.
    passed: Option<Causes>,
    /// Diameter of the hole with all that is lacking put back, m, once it has been looked for.
    full_m: Option<f64>,
}

impl<'a> Trial<'a> {
    fn new(
        case: &'a Case<'a>,
        seen: &'a Seen,
        store: &'a SampleStore,
        finder: &'a mut HoleFinder,
        present: Causes,
    ) -> Self {
        let drive = &seen.worst;
        Self {
            case,
            drive,
            seen,
            store,
            finder,
            present,
            left: MOST_TRIED,
            laid: None,
            passed: None,
            full_m: None,
        }
    }

    /// The smallest set among the factors present without which the section would have met the target.
    fn smallest(&mut self) -> Causes {
        let present = self.present;
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
        let target_m = self.case.target_m;
        let is_all = removed.has(Cause::HeadSilent) && is_unheard(self.case, self.seen);
        let stays = !is_all && self.covers(removed) && self.stays_m(removed) > times * target_m;
        if stays || !self.is_sampled_without(removed, times * target_m) {
            return false;
        }
        let bounds_m = self.case.bounds_m;
        let otherwise = self.otherwise(removed);
        let radius_m = times * target_m / 2.0;
        self.lay(removed, radius_m, &otherwise);
        let mut passes = |radius_m| !self.finder.has_circle_otherwise(bounds_m, radius_m, &otherwise);
        // Most sets that do, do with nothing to spare, and needn't be searched for larger circles.
        if passes(target_m / 2.0) {
            self.passed = Some(removed);
            return true;
        }
        times > 1.0 && passes(radius_m)
    }

    /// Lays out the wall as it would have been without some factors, unless it lies there.
    fn lay(&mut self, removed: Causes, radius_m: f64, otherwise: &Otherwise) {
        let Case { bounds_m, first_visit, target_m, lacks, .. } = *self.case;
        if !self.laid.is_some_and(|(laid, most_m)| laid == removed && radius_m <= most_m) {
            let reach_m = (target_m.max(2.0 * radius_m) + bounds_m.1 - bounds_m.0) / otherwise.along;
            let put_back = lacks
                // Those about to be mirrored, too.
                .between(bounds_m.0 - 2.0 * reach_m, bounds_m.1 + 2.0 * reach_m)
                .filter(|lack| lack.why.is_within(removed))
                .map(|lack| [lack.x_m, lack.arc_m]);
            self.finder.lay_otherwise((self.store, first_visit), bounds_m, radius_m, otherwise, put_back);
            self.laid = Some((removed, radius_m));
        }
    }

    /// Whether wall is taken to be covered without some factors, since nobody knows where what is lacking would have been.
    fn covers(&self, removed: Causes) -> bool {
        let is_lost = self.case.is_torn || self.seen.unseen || self.seen.adrift;
        removed.has(Cause::PositionLost) && is_lost
            || removed.has(Cause::HeadSilent) && is_dark(self.case, self.seen)
    }

    /// The distance between neighbours that is left without some factors, by how the vehicle and its heads moved alone, m; infinite where
    /// much is lacking for reasons that stay.
    fn stays_m(&self, removed: Causes) -> f64 {
        let Case { bounds_m, lacks, .. } = *self.case;
        let (mut all, mut stay) = (0_u32, 0_u32);
        for lack in lacks.between(bounds_m.0, bounds_m.1) {
            all += 1;
            stay += u32::from(!lack.why.is_within(removed));
        }
        if f64::from(stay) > STAYS * f64::from(all) {
            return f64::INFINITY;
        }
        let [_, then] = self.drives(removed);
        spacing::t_max_m(then.along_m(), 0.0, then.t_y_m)
    }

    /// Whether what is lost by chance, and stays so, leaves enough: where beams no longer swing, the wall can't be drawn together for it.
    fn is_sampled_without(&self, removed: Causes, target_m: f64) -> bool {
        let is_lossy = self.present.less(removed).has(Cause::MissingReturns);
        if !is_lossy || !removed.has(Cause::OffAxis) {
            return true;
        }
        let [_, then] = self.drives(removed);
        spacing::t_max_m(self.drive.passes_needed * then.along_m(), 0.0, then.t_y_m) <= target_m
    }

    /// How vehicle and heads moved, and how they would have without some factors; `healthy_gap_s` is the time between passes of the heads
    /// that there are: where silent or stalled ones stay so, it is that without them.
    fn drives(&self, removed: Causes) -> [Drive; 2] {
        let stalls = Causes::of(Cause::HeadSilent).with(Cause::HeadStalled);
        let all_turn = self.present.less(removed).less(stalls) == self.present.less(removed);
        let mut now = *self.drive;
        if !all_turn {
            now.healthy_gap_s = now.gap_s.max(now.healthy_gap_s);
        }
        [now, now.without(removed, MARGIN * self.case.target_m, all_turn)]
    }

    /// Diameter of the hole with all that is lacking put back, m: what the figures of driving have to explain.
    fn full_m(&mut self) -> f64 {
        let diameter_m = self.case.hole.diameter_m;
        if let Some(full_m) = self.full_m {
            return full_m;
        }
        let lacking = [
            Cause::OutOfRange,
            Cause::MissingReturns,
            Cause::Occluded,
            Cause::HeadSilent,
            Cause::HeadStalled,
            Cause::PositionLost,
        ];
        let lacking: Causes = lacking.into_iter().filter(|cause| self.present.has(*cause)).collect();
        let most_m = diameter_m.min(WIDEST * self.case.target_m);
        let mut full_m = diameter_m;
        if !lacking.is_empty() && most_m > self.case.target_m {
            let otherwise = Otherwise { to_come: self.to_come(), ..Otherwise::NOTHING };
            self.laid = None;
            self.lay(lacking, most_m / 2.0, &otherwise);
            self.laid = None;
            let bounds_m = self.case.bounds_m;
            let (mut least_m, mut larger_m) = (self.case.target_m / 2.0, most_m);
            for _ in 0..SEARCHED {
                let tried_m = math::sqrt(least_m * larger_m);
                if self.finder.has_circle_otherwise(bounds_m, tried_m / 2.0, &otherwise) {
                    least_m = tried_m;
                } else {
                    larger_m = tried_m;
                }
            }
            full_m = larger_m;
        }
        self.full_m = Some(full_m);
        full_m
    }

    /// Where samples may still land; beyond the end of what was passed, the wall isn't as it is before.
    fn to_come(&self) -> Option<Reach> {
        self.case.to_come.filter(|_| is_passed(self.case))
    }

    /// How the wall would have been sampled without some factors.
    fn otherwise(&mut self, removed: Causes) -> Otherwise {
        let all = Some(Reach { from_m: f64::NEG_INFINITY, to_m: f64::INFINITY });
        let swept = self.case.swept_by_all;
        let mut covered = [None; 4];
        let to_come = self.to_come();
        if to_come.is_none() {
            covered[3] = self.case.to_come;
        }
        if removed.has(Cause::NotPassed) {
            let before = swept.map_or(f64::INFINITY, |swept| swept.from_m);
            let beyond = swept.map_or(f64::NEG_INFINITY, |swept| swept.to_m);
            covered[0] = Some(Reach { from_m: f64::NEG_INFINITY, to_m: before });
            covered[1] = Some(Reach { from_m: beyond, to_m: f64::INFINITY });
        }
        if self.covers(removed) {
            covered[2] = all;
        }
        let [now, then] = self.drives(removed);
        let ratio = |then: f64, was: f64| if was > 0.0 { (then / was).clamp(LEAST, MOST) } else { 1.0 };
        let is_drawn = [Cause::TooFast, Cause::OffAxis, Cause::Phase].iter().any(|cause| removed.has(*cause));
        // Figures of one moment don't explain more than the hole.
        let hole_m = if is_drawn { self.full_m() } else { self.case.hole.diameter_m };
        Otherwise {
            along: ratio(then.along_m(), now.along_m().min(hole_m.max(then.along_m()))),
            around: ratio(then.t_y_m, now.t_y_m),
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

    /// The same without some factors. `margin_m` is the target less a margin, for the speed that would have been right, m; `all_turn`: no
    /// head is silent or out of step any more.
    fn without(&self, removed: Causes, margin_m: f64, all_turn: bool) -> Self {
        let mut then = *self;
        let mut slower = 1.0;
        if removed.has(Cause::OutOfRange) {
            slower *= self.other.longer_turn;
        }
        if removed.has(Cause::AngularStep) {
            slower *= self.other.finer_turn;
            then.t_y_m *= self.other.finer_step;
            then.middle_t_y_m *= self.other.finer_step;
        }
        if removed.has(Cause::OffAxis) {
            (then.swing_m, then.t_y_m) = (0.0, then.middle_t_y_m.min(then.t_y_m));
        }
        let is_at_plan = removed.has(Cause::Phase) && self.is_slow_out_of_phase(1.0 / HELPS);
        if is_at_plan {
            then.speed_mps = self.planned_mps;
        }
        let is_slowed = removed.has(Cause::TooFast);
        let gap_s = match (all_turn, removed.has(Cause::Phase), is_slowed || is_at_plan) {
            (true, true, true) => self.all_gap_s,
            (true, true, false) => self.planned_gap_s.min(self.healthy_gap_s),
            (true, false, true) => self.healthy_at_plan_s,
            (false, true, _) => self.left_at_plan_s.min(self.healthy_gap_s),
            (false, false, true) => self.gap_at_plan_s,
            (_, false, false) => self.healthy_gap_s,
        };
        then.healthy_gap_s = slower * gap_s;
        then.ping_period_s *= slower;
        if is_slowed {
            let t_y_m = then.middle_t_y_m;
            let squared = (margin_m - t_y_m) * (margin_m + t_y_m);
            let along_m = math::sqrt(squared.max(0.0)).max(0.3 * margin_m);
            let fits = along_m / (then.speed_mps * slower * self.all_gap_s + then.advance_m()).max(1e-9);
            // What is advised allows for wall that the vehicle hides.
            let advised = if self.fits_mps > 0.0 { self.fits_mps / then.speed_mps.max(1e-9) } else { 1.0 };
            then.speed_mps *= fits.min(advised).min(1.0);
        }
        then
    }
}

#[cfg(test)]
mod tests;
