//! Explains a fail by the smallest set of factors without which the hole would have met the target.
//!
//! For each factor, the geometry shows how large the hole would be without it. Samples that are missing because of the
//! factor are put back. If the factor moved passes or steps apart, the wall is compressed by the same ratio.
//! `docs/why/coverage.md` states the order of the factors and the reasons for it.

mod case;
mod trial;

use core::iter;

use super::cause::{Cause, Causes};
use super::evidence::Evidence;
use super::hole::HoleFinder;
use super::missing_samples::MissingSample;
use super::passage::{Drive, Passage};
use super::store::SampleStore;
use headrace_geometry::math;
use headrace_sampling::head::HeadSet;
use headrace_sampling::losses::{LossRate, MOST_PASSES, Sampled};
use headrace_sampling::spacing;
use trial::Trial;

pub use case::Case;
use case::{HELPS, Seen, WIDEST, is_dark, is_in, is_passed};

/// Speed is a factor if the spacing T exceeds this multiple of the target, even if the vehicle kept to the planned
/// speed.
///
/// T is the sample spacing at the driven speed with all heads at their scheduled angles. No hole is then larger than T.
const WELL_OVER: f64 = 1.2;
/// Ratio of the speed to the planned speed above which the vehicle did not follow the plan.
const OVER_PLAN: f64 = 1.15;
/// Replaces `WELL_OVER` and `OVER_PLAN` if there is no position.
///
/// The speed then comes only from the inertial unit, and is less accurate.
const OVER_LOST: f64 = 1.4;
/// Speed is a factor if it exceeds this multiple of the planned speed, and of the largest speed that meets the target.
///
/// The ratio is just above the measurement error of the speed.
const OVER_ALL: f64 = 1.03;
/// Swing of the beams is a factor if, without it, passes are closer together than this share of their actual distance.
///
/// The share is below 1 because even a steady vehicle sways.
const SWINGS: f64 = 0.85;
/// The angular step is a factor if it is longer on the wall than this share of the target, as seen from the tunnel's
/// centre.
const COARSE: f64 = 0.75;

/// Determines the causes of a section's hole. `passages` are those of all sections within the target T of it.
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
    let in_hole = |missing: &&MissingSample| is_in(case.hole, case.target_m, store.perimeter_m(), missing);
    let radius_m = case.target_m;
    let sampled =
        Sampled { target_m: case.target_m, t_y_m: drive.middle_t_y_m, perimeter_m: store.perimeter_m() };
    let missing_share = seen.share(seen.missing);
    let is_lossy = causes.has(Cause::MissingReturns);
    let here =
        if is_lossy { sampled.passes_needed(iter::once(LossRate::independent(missing_share))) } else { 1.0 };
    // If other causes contribute too, lost returns must explain only a hole as large as the target.
    let times = if causes.len() > 1 { 1.0 } else { WIDEST };
    let hole_m = case.hole.diameter_m.min(times * case.target_m);
    let is_by_chance = !is_lossy || sampled.is_by_chance(hole_m, drive.along_m(), drive.lost);
    let passes_needed = if is_by_chance { here.max(drive.passes_needed) } else { MOST_PASSES };
    let lost = case
        .missing_samples
        .between(case.hole.x_m - radius_m, case.hole.x_m + radius_m)
        .filter(in_hole)
        .count();
    let evidence = Evidence {
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
        silent_heads: silent_heads(case, &seen, causes, store.perimeter_m()),
    };
    debug_assert!(evidence.is_consistent(), "causes and figures of a fail agree: {evidence:?}");
    evidence
}

/// Heads that were silent. If silence is a cause, these include the heads whose missing samples lie in the hole.
///
/// A head that was silent for a moment only was still near its last place, and does not count as silent otherwise.
fn silent_heads(case: &Case<'_>, seen: &Seen, causes: Causes, perimeter_m: f64) -> HeadSet {
    if !causes.has(Cause::HeadSilent) {
        return seen.silent;
    }
    let Case { hole, missing_samples, .. } = *case;
    let [from_m, to_m] = [-0.5, 0.5].map(|side| hole.x_m + side * hole.diameter_m);
    let is_silent = |missing: &&MissingSample| missing.why.has(Cause::HeadSilent);
    let in_hole = |missing: &&MissingSample| is_in(hole, hole.diameter_m, perimeter_m, missing);
    let nearby = missing_samples.between(from_m, to_m).filter(is_silent).filter(in_hole);
    nearby.fold(seen.silent, |heads, missing| heads.with(usize::from(missing.head)))
}

/// Factors that were present when the section was passed.
fn present(case: &Case<'_>, seen: &Seen, perimeter_m: f64) -> Causes {
    let Case { hole, bounds_m: (from_m, to_m), target_m, .. } = *case;
    let around_m = f64::midpoint(hole.diameter_m.min(WIDEST * target_m), target_m);
    let nearby = case.missing_samples.between(from_m - around_m, to_m + around_m);
    let near = |missing: &&MissingSample| {
        // The hole may extend all round the wall. Then missing samples at any arc length count.
        let off_m = math::wrap_signed(missing.arc_m - hole.arc_m, perimeter_m).abs();
        off_m < hole.diameter_m + target_m
    };
    let mut present = nearby.filter(near).fold(Causes::default(), |all, missing| all.union(missing.why));
    let drive = &seen.worst;
    let is_passed = is_passed(case);
    let is_lost = case.is_torn || seen.unseen || seen.adrift;
    let mut add = |is_present: bool, cause: Cause| {
        if is_present {
            present = present.with(cause);
        }
    };
    add(!is_passed && !case.none_alive || !hole.bounded && seen.silent.is_empty(), Cause::NotPassed);
    add(is_lost, Cause::PositionLost);
    add(is_dark(case, seen), Cause::HeadSilent);
    let coarse = drive.middle_t_y_m > 0.9 * target_m;
    add(drive.middle_t_y_m > COARSE * target_m, Cause::AngularStep);
    let as_planned = spacing::t_max_m(drive.planned_along_m(), drive.advance_m(), drive.middle_t_y_m);
    let over = if coarse { drive.planned_along_m() } else { as_planned } / target_m;
    // The measured speed is less reliable without a position.
    let well_over = if is_lost { OVER_LOST } else { WELL_OVER };
    let over_planned = if is_lost { OVER_LOST } else { OVER_PLAN };
    let is_over_all = !is_lost
        && drive.fits_mps > 0.0
        && drive.planned_mps > 0.0
        && drive.speed_mps > OVER_ALL * drive.fits_mps.max(drive.planned_mps);
    let is_over_plan = over > 1.0 && drive.speed_mps > over_planned * drive.planned_mps;
    add(over > well_over || is_over_plan || is_over_all, Cause::TooFast);
    let is_slow = drive.is_slow_out_of_phase(1.0 / HELPS);
    let is_uneven = drive.planned_gap_s < HELPS * drive.healthy_gap_s;
    // Above the planned speed, passes of heads at different places along the hull may be evenly spread by chance.
    let is_fast = drive.speed_mps > OVER_PLAN * drive.planned_mps;
    add(is_slow || is_uneven || is_fast && drive.all_gap_s < HELPS * drive.healthy_at_plan_s, Cause::Phase);
    let steady = Drive { swing_m: 0.0, ..*drive };
    let aside = drive.middle_t_y_m < HELPS * drive.t_y_m;
    add(steady.along_m() < SWINGS * drive.along_m() || aside, Cause::OffAxis);
    present
}

#[cfg(test)]
mod tests;
