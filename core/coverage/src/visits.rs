//! Visits of the vehicle to a place in the tunnel.
//!
//! A visit ends where the vehicle turns back, and where navigation breaks off. The error between passes of one visit is
//! known. The error between passes of different visits may be larger.

use serde::{Deserialize, Serialize};

use super::passage::PassError;
use headrace_fusion::Fix;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_geometry::tunnel::Profile;

/// Limits of the time between two samples. Up to `SAME_PASS`, the error between successive passes applies.
///
/// From `LONG_BEFORE` on, the error relative to a much earlier visit applies. In between, both errors are mixed.
const SAME_PASS: DurNs = DurNs(20_000_000_000);
const LONG_BEFORE: DurNs = DurNs(40_000_000_000);

/// The visit during which a sample was measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visit {
    /// Number of the visit, from zero. Later visits never have a lower number.
    pub number: u32,
    /// Number of the visit's navigation segment.
    pub tie: u32,
    /// Time at which the sample was measured.
    pub at: MonoNs,
    /// Error relative to the previous pass, and error relative to a much earlier visit.
    pub errors: [PassError; 2],
}

impl Visit {
    /// Creates the visit to which a fix at `at` belongs, after the vehicle has turned back `turns` times.
    pub fn of(fix: &Fix, at: MonoNs, turns: u32) -> Self {
        let [pass, long_before] =
            [fix.relative, fix.revisit].map(|relative| PassError { relative, ..PassError::of(fix) });
        Self {
            number: turns.saturating_add(fix.tie).saturating_add(fix.settled),
            tie: fix.tie,
            at,
            errors: [pass, long_before],
        }
    }

    /// Largest standard deviation of the diameter of a hole between samples of this and an earlier visit, m.
    ///
    /// `then` is the time of the earlier visit's latest sample.
    fn apart_sd_m(&self, then: MonoNs, profile: &Profile) -> f64 {
        let over = (self.at.since(then) + DurNs(-SAME_PASS.0)).as_secs_f64();
        let share = (over / (LONG_BEFORE.0 - SAME_PASS.0) as f64 * 1e9).clamp(0.0, 1.0);
        let [pass, long_before] = self.errors;
        let relative = pass.relative.weighted(1.0 - share, &long_before.relative, share);
        PassError { relative, ..pass }.worst_m(profile)
    }
}

/// The visits of a section. They have samples within the target T of the section.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Visits {
    /// Number of the newest visit, its navigation segment, and the time of its latest sample.
    ///
    /// `None` before the first visit.
    newest: Option<(u32, u32, MonoNs)>,
    /// Number of the first visit whose samples count.
    first: u32,
    /// Whether samples of several visits count.
    several: bool,
    /// Whether the visits belong to several navigation segments.
    unrelated: bool,
    /// Largest standard deviation of a hole's diameter between samples of different visits, m.
    apart_sd_m: f64,
}

impl Visits {
    /// Records a sample's visit among the section's visits.
    pub(super) fn note(&mut self, visit: &Visit, profile: &Profile) {
        if let Some((number, tie, last)) = self.newest.filter(|(number, ..)| *number != visit.number) {
            self.several |= number >= self.first;
            self.unrelated |= tie != visit.tie;
            self.apart_sd_m = self.apart_sd_m.max(visit.apart_sd_m(last, profile));
        }
        self.newest = Some((visit.number, visit.tie, visit.at));
    }

    /// Records the error between the passes of an earlier visit.
    ///
    /// `sd_m` is the standard deviation that this error causes in a hole's diameter, m.
    pub(super) fn note_earlier(&mut self, sd_m: f64) {
        self.apart_sd_m = self.apart_sd_m.max(sd_m);
    }

    /// Number of the newest visit to the section.
    pub(super) fn newest(&self) -> u32 {
        self.newest.map_or(0, |(number, ..)| number)
    }

    /// Number of the first visit whose samples count.
    pub(super) fn first(&self) -> u32 {
        self.first
    }

    /// Whether samples of several visits count.
    pub(super) fn are_several(&self) -> bool {
        self.several
    }

    /// Whether the offset between the visits is unknown.
    ///
    /// Then samples of one visit may only seem to fill the holes of another.
    pub(super) fn are_unrelated(&self) -> bool {
        self.unrelated
    }

    /// Keeps only the newest visit, which is enough to show that the section passes.
    pub(super) fn keep_newest(&mut self) {
        (self.first, self.several, self.unrelated, self.apart_sd_m) = (self.newest(), false, false, 0.0);
    }

    /// Returns the standard deviation of the diameter of a hole among the samples of all counted visits, m.
    ///
    /// `pass_sd_m` is the standard deviation by the newest visit alone.
    pub(super) fn sd_m(&self, pass_sd_m: f64) -> f64 {
        if self.several { pass_sd_m.max(self.apart_sd_m) } else { pass_sd_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_fusion::relative::Relative;
    use headrace_geometry::tunnel::shapes;

    /// Creates a visit with this number and navigation segment.
    ///
    /// The error between its passes is 1 cm, and its error relative to a much earlier visit is 10 cm (1 sd each).
    fn visit(number: u32, tie: u32, at_s: u64) -> Visit {
        let error = |sd_m: f64| PassError { relative: Relative::along(sd_m), from_m: [0.0; 2] };
        Visit { number, tie, at: MonoNs(at_s * 1_000_000_000), errors: [error(0.01), error(0.1)] }
    }

    fn after(noted: &[(u32, u32, u64)]) -> Visits {
        let profile = shapes::ceran().unwrap();
        let mut visits = Visits::default();
        for (number, tie, at_s) in noted {
            visits.note(&visit(*number, *tie, *at_s), &profile);
        }
        visits
    }

    #[test]
    fn visits_are_related_unless_navigation_was_interrupted_between_them() {
        let flags = |noted: &[(u32, u32, u64)]| {
            let visits = after(noted);
            (visits.newest(), visits.are_several(), visits.are_unrelated())
        };
        assert_eq!(flags(&[]), (0, false, false));
        assert_eq!(flags(&[(3, 1, 0), (3, 1, 9)]), (3, false, false), "one visit");
        assert_eq!(flags(&[(3, 1, 0), (4, 1, 60)]), (4, true, false), "the vehicle turned back");
        assert_eq!(flags(&[(3, 1, 0), (4, 2, 60)]), (4, true, true), "navigation was interrupted");
        let mut visits = after(&[(3, 1, 0), (4, 2, 60)]);
        visits.keep_newest();
        assert_eq!((visits.first(), visits.are_several(), visits.are_unrelated()), (4, false, false));
    }

    /// The error between two visits grows with the time between them, from 20 s to 40 s.
    #[test]
    fn error_between_visits_grows_with_the_time_between_them() {
        let sd_m = |gap_s: u64| after(&[(3, 1, 0), (4, 1, gap_s)]).sd_m(0.0);
        assert!(sd_m(20) > 0.0 && (sd_m(10) - sd_m(20)).abs() < 1e-12, "the error of one pass applies");
        assert!(
            sd_m(30) > 1.5 * sd_m(20) && sd_m(40) > 1.2 * sd_m(30),
            "{} {} {}",
            sd_m(20),
            sd_m(30),
            sd_m(40)
        );
        assert!((sd_m(40) / sd_m(20) - 10.0).abs() < 1e-9 && (sd_m(900) - sd_m(40)).abs() < 1e-12);
        assert!((after(&[(3, 1, 0), (3, 1, 900)]).sd_m(0.02) - 0.02).abs() < 1e-12, "one visit");
        assert!((after(&[(3, 1, 0), (4, 1, 10)]).sd_m(0.5) - 0.5).abs() < 1e-12, "the newest visit is worse");
    }
}
