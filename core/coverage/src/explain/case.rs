//! A failed section as input for explaining the fail. It comes with ping counts of its surroundings, and with driving
//! figures as they would be without some factors.

use crate::cause::{Cause, Causes};
use crate::frontier::Reach;
use crate::hole::Hole;
use crate::missing_samples::{MissingSample, MissingSamples};
use crate::passage::{Drive, Passage};
use headrace_geometry::math;
use headrace_sampling::head::HeadSet;
use headrace_sampling::losses::MOST_PASSES;

/// Removing a factor helps only if it reduces the spacing of samples below this share of the actual spacing.
pub(super) const HELPS: f64 = 0.93;
/// Largest hole for which missing samples are searched in the surroundings, in multiples of the target.
pub(super) const WIDEST: f64 = 8.0;

/// A failed section and its surroundings, as input for explaining the fail.
#[derive(Debug, Clone, Copy)]
pub struct Case<'a> {
    /// Largest hole of the section.
    pub hole: &'a Hole,
    /// Chainages of the section's two ends, m.
    pub bounds_m: (f64, f64),
    /// Number of the first visit whose samples count.
    pub first_visit: u32,
    /// Stretch that every live head had swept at the time of the request.
    pub swept_by_all: Option<Reach>,
    /// Stretch where samples may still land, so its wall is not known yet.
    pub to_come: Option<Reach>,
    /// Whether no head was alive (pinging) at the time of the request.
    pub none_alive: bool,
    /// Whether no head pinged in the section, although at least one passed through it.
    pub is_dark: bool,
    /// Whether the section's samples come from several navigation segments.
    pub is_torn: bool,
    /// Coverage target T, m.
    pub target_m: f64,
    /// Causes of the two neighbouring sections. If several sets of causes are equally small, these are tried first.
    pub beside: [Causes; 2],
    /// The most recent missing samples.
    pub missing_samples: &'a MissingSamples,
}

/// Ping counts of the sections round a hole. `worst` holds the driving figures at the moment with the largest distance
/// between passes.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Seen {
    pub(super) pings: u32,
    pub(super) missing: u32,
    pub(super) occluded: u32,
    pub(super) standing: u32,
    pub(super) silent: HeadSet,
    pub(super) unseen: bool,
    pub(super) adrift: bool,
    pub(super) worst: Drive,
}

impl Seen {
    pub(super) fn over<'a>(passages: impl Iterator<Item = &'a Passage>) -> Self {
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

    pub(super) fn share(&self, count: u32) -> f64 {
        f64::from(count) / f64::from(self.pings.max(1))
    }
}

/// Whether every live head has swept the hole. In a hole larger than the target, only the central part, as large as the
/// target, must be swept.
pub(super) fn is_passed(case: &Case<'_>) -> bool {
    let radius_m = case.hole.diameter_m.min(case.target_m) / 2.0;
    let [from_m, to_m] = [case.hole.x_m - radius_m, case.hole.x_m + radius_m];
    case.swept_by_all.is_some_and(|swept| from_m >= swept.from_m && to_m <= swept.to_m)
}

/// Whether it is unknown where silent heads would have pinged, so that their pings cannot be put back.
///
/// True if the silent heads sweep in sectors, if one of them never pinged, or if all heads were silent for longer than
/// the list of missing samples covers.
pub(super) fn is_dark(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_in_sectors || is_unheard(case, seen)
}

/// Whether it is unknown where silent heads would have pinged, for another reason than sectors.
///
/// True if some silent heads never pinged. Also true if no head pinged in the section and no missing samples of silent
/// heads are listed.
pub(super) fn is_unheard(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_unheard || case.is_dark && !is_remembered(case)
}

/// Whether missing samples of silent heads are listed for the section.
pub(super) fn is_remembered(case: &Case<'_>) -> bool {
    let mut missing = case.missing_samples.between(case.bounds_m.0, case.bounds_m.1);
    missing.any(|missing| missing.why.has(Cause::HeadSilent))
}

/// Whether a missing sample lies in the central part of a hole.
///
/// The central part is at most as large as the target, because samples that land later may still shrink the hole.
pub(super) fn is_in(hole: &Hole, target_m: f64, perimeter_m: f64, missing: &MissingSample) -> bool {
    let around_m = math::wrap_signed(missing.arc_m - hole.arc_m, perimeter_m);
    math::hypot(missing.x_m - hole.x_m, around_m) < hole.diameter_m.min(target_m) / 2.0
}

impl Drive {
    /// Largest speed that leaves time for `passes_needed` passes where one was planned, m/s.
    ///
    /// Zero if too many returns are lost for any useful speed.
    pub(crate) fn with_losses_mps(&self, passes_needed: f64) -> f64 {
        if passes_needed >= MOST_PASSES {
            return 0.0;
        }
        let turn_s = passes_needed * self.all_gap_s + self.ping_period_s;
        if passes_needed > 1.0 {
            self.fits_mps.min(self.fits_along_m / turn_s.max(1e-9))
        } else {
            self.fits_mps
        }
    }

    /// Returns the driving figures as they would have been without the factors in `removed`.
    ///
    /// Without the speed factor, the speed is low enough for holes of at most `margin_m`, m. This is the target less a
    /// margin. `all_turn` means that no head is silent or stalled.
    pub(super) fn without(&self, removed: Causes, margin_m: f64, all_turn: bool) -> Self {
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
            // If the vehicle hides wall from some heads, the advised speed is lower than the one computed here, and is
            // used.
            let advised = if self.fits_mps > 0.0 { self.fits_mps / then.speed_mps.max(1e-9) } else { 1.0 };
            then.speed_mps *= fits.min(advised).min(1.0);
        }
        then
    }
}
