//! A failed section, its surroundings, and what was counted of them.

use crate::cause::Cause;
use crate::causes::Causes;
use crate::frontier::Reach;
use crate::hole::Hole;
use crate::lacks::{Lack, Lacks};
use crate::passage::{Drive, Passage};
use headrace_geometry::math;
use headrace_sampling::head::HeadSet;

/// Without a factor that was present, distances are at most this share of what they were.
pub(super) const HELPS: f64 = 0.93;
/// Multiple of the target up to which a hole's size counts where it is asked what is lacking about it.
pub(super) const WIDEST: f64 = 8.0;

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

/// Counts over sections, and the moment of the largest T as driven.
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

/// Whether every live head has swept the hole, as far as the target matters.
pub(super) fn is_passed(case: &Case<'_>) -> bool {
    let radius_m = case.hole.diameter_m.min(case.target_m) / 2.0;
    let [from_m, to_m] = [case.hole.x_m - radius_m, case.hole.x_m + radius_m];
    case.swept_by_all.is_some_and(|swept| from_m >= swept.from_m && to_m <= swept.to_m)
}

/// Silent heads would have pinged nobody knows where: in sectors, never heard, or all of them silent for longer than is remembered.
pub(super) fn is_dark(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_in_sectors || is_unheard(case, seen)
}

/// Silent heads were never heard, or none was.
pub(super) fn is_unheard(case: &Case<'_>, seen: &Seen) -> bool {
    !seen.silent.is_empty() && seen.worst.is_unheard || case.is_dark && !is_remembered(case)
}

/// Whether it is known where the silent heads would have pinged in the section.
pub(super) fn is_remembered(case: &Case<'_>) -> bool {
    let mut lacking = case.lacks.between(case.bounds_m.0, case.bounds_m.1);
    lacking.any(|lack| lack.why.has(Cause::HeadSilent))
}

/// Whether a lack lies in a hole, as far as the target matters: the hole may still shrink from ahead.
pub(super) fn is_in(hole: &Hole, target_m: f64, perimeter_m: f64, lack: &Lack) -> bool {
    let around_m = math::wrap_signed(lack.arc_m - hole.arc_m, perimeter_m);
    math::hypot(lack.x_m - hole.x_m, around_m) < hole.diameter_m.min(target_m) / 2.0
}
