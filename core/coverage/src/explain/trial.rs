//! Computes the hole that a section would have without some of the factors that were present.

use super::case::{Case, HELPS, Seen, WIDEST, is_dark, is_in, is_passed, is_unheard};
use crate::cause::{Cause, Causes};
use crate::frontier::Reach;
use crate::hole::{HoleFinder, WallChanges};
use crate::missing_samples::MissingSample;
use crate::passage::Drive;
use crate::store::SampleStore;
use headrace_geometry::math;
use headrace_geometry::tunnel::WallPoint;
use headrace_sampling::spacing;

/// Share of the target to which holes shrink if the speed factor is removed. Plans keep the rest as a margin.
const MARGIN: f64 = 0.85;
/// Limits of the factor by which the wall is compressed or stretched.
///
/// A finer step or a longer range takes longer per turn, which stretches the wall.
const LEAST: f64 = 0.1;
const MOST: f64 = 3.0;
/// If a hole exceeds this multiple of the target even without all present factors, its cause is unknown.
const AT_MOST: f64 = 1.3;
/// Maximum number of bisection steps in the search for the hole's diameter, if all missing samples are put back.
const SEARCHED: u32 = 5;
/// Largest share of the missing samples that may remain after some factors are removed. A larger share means that the
/// remaining factors cause a hole by themselves.
const STAYS: f64 = 0.15;
/// Maximum number of causes in a set that explains a fail.
const MOST_NAMED: u32 = 3;
/// Maximum number of sets of causes tested per fail.
const MOST_TRIED: u32 = 120;

/// Computes the holes that a section would have without some factors.
pub(super) struct Trial<'a> {
    case: &'a Case<'a>,
    drive: &'a Drive,
    seen: &'a Seen,
    store: &'a SampleStore,
    finder: &'a mut HoleFinder,
    /// Factors that were present in the section (`present`), and those of them that caused missing samples (`missing_causes`).
    present: Causes,
    missing_causes: Causes,
    left: u32,
    /// Bounds of the hole's diameter if all missing samples are put back, m, and number of bisection steps left.
    full_m: [f64; 2],
    halvings: u32,
}

impl<'a> Trial<'a> {
    pub(super) fn new(
        case: &'a Case<'a>,
        seen: &'a Seen,
        store: &'a SampleStore,
        finder: &'a mut HoleFinder,
        present: Causes,
    ) -> Self {
        let drive = &seen.worst;
        let missing_causes = [
            Cause::OutOfRange,
            Cause::MissingReturns,
            Cause::Occluded,
            Cause::HeadSilent,
            Cause::HeadStalled,
            Cause::PositionLost,
        ];
        let missing_causes: Causes = missing_causes.into_iter().filter(|cause| present.has(*cause)).collect();
        let most_m = case.hole.diameter_m.min(WIDEST * case.target_m);
        let [from_m, to_m] = [-0.5, 0.5].map(|side| case.hole.x_m + side * case.hole.diameter_m);
        // Samples that are put back outside the hole cannot shrink it.
        let fills = |missing: &MissingSample| {
            missing.why.is_within(missing_causes)
                && is_in(case.hole, case.hole.diameter_m, store.perimeter_m(), missing)
        };
        let is_whole = most_m <= case.target_m || !case.missing_samples.between(from_m, to_m).any(fills);
        let full_m = if is_whole { [case.hole.diameter_m; 2] } else { [case.target_m / 2.0, most_m] };
        let halvings = if is_whole { 0 } else { SEARCHED };
        Self { case, drive, seen, store, finder, present, left: MOST_TRIED, missing_causes, full_m, halvings }
    }

    /// Smallest set of present factors without which the section would have passed.
    pub(super) fn smallest(&mut self) -> Causes {
        let silent = Causes::of(Cause::HeadSilent);
        // If no head pinged, the silence of the heads is a certain cause. Speed, step, swing and phase are then not
        // tested. Other causes remain possible, because even heads that ping might not have detected the wall.
        let surely = if self.case.is_dark { silent } else { Causes::default() };
        if self.case.is_dark {
            let is_driven = |cause: &Cause| {
                matches!(cause, Cause::TooFast | Cause::AngularStep | Cause::OffAxis | Cause::Phase)
            };
            self.present = self.present.iter().filter(|cause| !is_driven(cause)).collect();
            self.present = self.present.union(surely);
        }
        if let Some(alone) = self.alone(surely) {
            return alone;
        }
        let present = self.present;
        if present.is_empty() || !self.passes_without(present, AT_MOST) {
            return if surely.is_empty() { Causes::of(Cause::Unknown) } else { surely };
        }
        let needed = surely.union(self.needed(present));
        for size in 2..=present.len().min(MOST_NAMED) {
            let fit = |set: &Causes| set.len() == size && set.is_within(present) && needed.is_within(*set);
            let sets = (1..=present.bits()).filter(|bits| bits & !present.bits() == 0).map(Causes::from_bits);
            for set in self.case.beside.into_iter().chain(sets).filter(fit) {
                if self.passes_without(set, 1.0) {
                    return self.less_occluded(set);
                }
            }
        }
        present
    }

    /// Removes `occluded` from the set if wall is out of range and the other causes nearly suffice.
    ///
    /// With a longer range, other heads see the wall that stays hidden from some.
    fn less_occluded(&mut self, set: Causes) -> Causes {
        let rest = set.without(Cause::Occluded);
        let is_far = set.has(Cause::Occluded) && set.has(Cause::OutOfRange);
        if is_far && self.passes_without(rest, AT_MOST) { rest } else { set }
    }

    /// Returns the single factor without which the section would have passed.
    ///
    /// If `surely` contains a certain factor, only that factor is tested.
    fn alone(&mut self, surely: Causes) -> Option<Causes> {
        let [not_passed, silent, phase, lost] =
            [Cause::NotPassed, Cause::HeadSilent, Cause::Phase, Cause::PositionLost].map(Causes::of);
        let is_short = self.is_short();
        let first = [
            // If the heads have not swept the wall, nothing is known about the other factors.
            (true, not_passed),
            // If some heads never pinged, nothing is known about the other factors.
            (is_unheard(self.case, self.seen), silent),
            // If the planned speed would have met the target, phase is named first. Its remedy is a change of speed,
            // which is the easiest one.
            (!is_short && self.drive.is_slow_out_of_phase(1.0 / HELPS), phase),
        ];
        // Factors that would explain almost any hole are tested last.
        let last = [(self.is_only_adrift(), lost), (is_short, phase)];
        let present = self.present;
        let is_last = |set: &Causes| last.iter().any(|(is, last)| *is && set == last);
        let fit = |set: &Causes| set.len() == 1 && surely.is_within(*set) && !is_last(set);
        let others = self.case.beside.into_iter().chain(present.iter().map(Causes::of)).filter(fit);
        let those = |(is, set): (bool, Causes)| is.then_some(set);
        let in_turn =
            first.into_iter().filter_map(those).chain(others).chain(last.into_iter().filter_map(those));
        in_turn.filter(|set| set.is_within(present)).find(|set| self.passes_without(*set, 1.0))
    }

    /// Whether a head is silent or stalled. The other heads then leave uneven gaps, which look like a phase error.
    fn is_short(&self) -> bool {
        self.present.has(Cause::HeadSilent) || self.present.has(Cause::HeadStalled)
    }

    /// Whether the displacement between passes is uncertain, and nothing else about the position is in doubt.
    ///
    /// A fail already allows for this uncertainty, which would explain any hole. So every other explanation comes
    /// first.
    fn is_only_adrift(&self) -> bool {
        self.seen.adrift && !self.seen.unseen && !self.case.is_torn
    }

    /// Returns the factors that every set of causes must contain to explain the fail.
    ///
    /// The section fails if one of them stays, even if all other factors are removed.
    fn needed(&mut self, present: Causes) -> Causes {
        let mut is_needed = |cause: &Cause| !self.passes_without(present.without(*cause), 1.0);
        present.iter().filter(|cause| is_needed(cause)).collect()
    }

    /// Whether the section's hole would measure at most `times` the target without the factors `removed`.
    fn passes_without(&mut self, removed: Causes, times: f64) -> bool {
        if self.left == 0 {
            return false;
        }
        self.left -= 1;
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
        !self.finder.has_circle_otherwise(bounds_m, radius_m, &otherwise)
    }

    /// Lays out the wall as it would be without the factors in `removed`, for the search for holes.
    fn lay(&mut self, removed: Causes, radius_m: f64, otherwise: &WallChanges) {
        let Case { bounds_m, first_visit, target_m, missing_samples, .. } = *self.case;
        let reach_m = (target_m.max(2.0 * radius_m) + bounds_m.1 - bounds_m.0) / otherwise.along;
        let put_back = missing_samples
            // Mirroring the wall later needs samples from this wider range.
            .between(bounds_m.0 - 2.0 * reach_m, bounds_m.1 + 2.0 * reach_m)
            .filter(|missing| missing.why.is_within(removed))
            .map(|missing| WallPoint { x_m: missing.x_m, arc_m: missing.arc_m });
        self.finder.lay_otherwise((self.store, first_visit), bounds_m, radius_m, otherwise, put_back);
    }

    /// Whether all wall counts as covered without the factors in `removed`.
    ///
    /// True if it is unknown at which places these factors caused missing samples.
    fn covers(&self, removed: Causes) -> bool {
        let is_lost = self.case.is_torn || self.seen.unseen || self.seen.adrift;
        removed.has(Cause::PositionLost) && is_lost
            || removed.has(Cause::HeadSilent) && is_dark(self.case, self.seen)
    }

    /// Distance between neighbouring samples without the factors in `removed`, m. It is computed only from the movement
    /// of vehicle and heads.
    ///
    /// Infinite if the remaining factors cause many missing samples.
    fn stays_m(&self, removed: Causes) -> f64 {
        let Case { bounds_m, missing_samples, .. } = *self.case;
        let (mut all, mut stay) = (0_u32, 0_u32);
        for missing in missing_samples.between(bounds_m.0, bounds_m.1) {
            all += 1;
            stay += u32::from(!missing.why.is_within(removed));
        }
        if f64::from(stay) > STAYS * f64::from(all) {
            return f64::INFINITY;
        }
        let [_, then] = self.drives(removed);
        spacing::t_max_m(then.along_m(), 0.0, then.t_y_m)
    }

    /// Whether random losses leave enough samples once the beams no longer swing.
    ///
    /// This needs its own check, because the compression of the wall does not allow for losses.
    fn is_sampled_without(&self, removed: Causes, target_m: f64) -> bool {
        let is_lossy = self.present.less(removed).has(Cause::MissingReturns);
        if !is_lossy || !removed.has(Cause::OffAxis) {
            return true;
        }
        let [_, then] = self.drives(removed);
        spacing::t_max_m(self.drive.passes_needed * then.along_m(), 0.0, then.t_y_m) <= target_m
    }

    /// Returns the movement of vehicle and heads twice: as driven, and without the factors in `removed`.
    ///
    /// If silent or stalled heads remain a factor, `healthy_gap_s` is at least the actual time between passes.
    fn drives(&self, removed: Causes) -> [Drive; 2] {
        let stalls = Causes::of(Cause::HeadSilent).with(Cause::HeadStalled);
        let staying = self.present.less(removed);
        let all_turn = staying.less(stalls) == staying;
        let mut now = *self.drive;
        if !all_turn {
            now.healthy_gap_s = now.gap_s.max(now.healthy_gap_s);
        }
        [now, now.without(removed, MARGIN * self.case.target_m, all_turn)]
    }

    /// Diameter of the hole if all missing samples are put back, m. The factors that moved passes apart must explain a
    /// hole of this size.
    ///
    /// It is only as exact as a comparison with `least_m` and `most_m` requires.
    fn full_m(&mut self, [least_m, most_m]: [f64; 2]) -> f64 {
        let matters = |[smaller_m, larger_m]: [f64; 2]| smaller_m < most_m && larger_m > least_m;
        if least_m < most_m && self.halvings > 0 && matters(self.full_m) {
            let otherwise = WallChanges { to_come: self.to_come(), ..WallChanges::NOTHING };
            let [mut smaller_m, mut larger_m] = self.full_m;
            self.lay(self.missing_causes, larger_m / 2.0, &otherwise);
            while self.halvings > 0 && matters([smaller_m, larger_m]) {
                self.halvings -= 1;
                let tried_m = math::sqrt(smaller_m * larger_m);
                if self.finder.has_circle_otherwise(self.case.bounds_m, tried_m / 2.0, &otherwise) {
                    smaller_m = tried_m;
                } else {
                    larger_m = tried_m;
                }
            }
            self.full_m = [smaller_m, larger_m];
        }
        self.full_m[1]
    }

    /// Stretch where samples may still land. The wall is mirrored into it.
    ///
    /// `None` if some live head has not swept the hole; then the wall is not mirrored.
    fn to_come(&self) -> Option<Reach> {
        self.case.to_come.filter(|_| is_passed(self.case))
    }

    /// Returns the changes to the wall that removing the factors in `removed` causes.
    fn otherwise(&mut self, removed: Causes) -> WallChanges {
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
        // The driving figures are from a single moment, so their effect is limited by the size of the hole.
        let [now_m, then_m] = [now.along_m(), then.along_m()];
        let hole_m = if is_drawn { self.full_m([then_m, now_m]) } else { self.case.hole.diameter_m };
        WallChanges {
            along: ratio(then_m, now_m.min(hole_m.max(then_m))),
            around: ratio(then.t_y_m, now.t_y_m),
            covered,
            to_come,
        }
    }
}
