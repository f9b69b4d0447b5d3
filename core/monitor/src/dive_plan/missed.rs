//! Missed stretches, as passes for the plan.

use super::route::{Changes, Pass, Roll};
use super::selection::MOST_PASSES;
use headrace_coverage::{Cause, Run, RunId, Sections};

/// Missed stretches in ascending order. Stretches whose passes overlap are one entry.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct MissedList {
    list: [Option<Missed>; MOST_PASSES],
}

/// Missed stretch, with the chainages between which the vehicle's origin must pass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Missed {
    pub(crate) run: RunId,
    pub(crate) near_m: f64,
    pub(crate) far_m: f64,
    pub(crate) missed_m: f64,
    /// Largest speed inwards, m/s; zero if no speed is known to meet the target.
    pub(crate) at_most_mps: f64,
    /// Whether the stretch needs two passes, one rolled to each side.
    pub(crate) is_rolled: bool,
    pub(crate) changes: Changes,
}

impl Missed {
    fn of(sections: &Sections, id: RunId, run: &Run) -> Self {
        let (from_m, to_m) = (sections.bounds_m(run.from).0, sections.bounds_m(run.to - 1).1);
        Self {
            run: id,
            near_m: sections.back_to_m(from_m),
            // The same run-up as at the other end.
            far_m: -sections.back_to_m(-to_m),
            missed_m: to_m - from_m,
            at_most_mps: run.again().at_most_mps,
            is_rolled: run.count(Cause::Occluded) > 0,
            changes: Changes { causes: run.named(), is_beyond_speed: run.again().is_beyond_speed },
        }
    }

    /// One pass over both stretches, at the lower speed, with the changes that either of them needs.
    fn joined(&self, other: &Self) -> Self {
        let speeds = [self.at_most_mps, other.at_most_mps].into_iter().filter(|mps| *mps > 0.0);
        Self {
            near_m: self.near_m.min(other.near_m),
            far_m: self.far_m.max(other.far_m),
            missed_m: self.missed_m + other.missed_m,
            at_most_mps: speeds.reduce(f64::min).unwrap_or(0.0),
            is_rolled: self.is_rolled || other.is_rolled,
            changes: Changes {
                causes: self.changes.causes.union(other.changes.causes),
                is_beyond_speed: self.changes.is_beyond_speed || other.changes.is_beyond_speed,
            },
            ..if self.near_m <= other.near_m { *self } else { *other }
        }
    }

    pub(crate) fn pass(&self, inward_mps: f64, outward_mps: f64) -> Pass {
        let Self { run, near_m, far_m, missed_m, changes, .. } = *self;
        let is_speed_known = self.at_most_mps > 0.0;
        let roll = if self.is_rolled { Roll::Left } else { Roll::Level };
        Pass { run, near_m, far_m, missed_m, inward_mps, outward_mps, is_speed_known, roll, changes }
    }
}

impl MissedList {
    /// All missed stretches that are not cleared yet. Allocates: never.
    pub(crate) fn of(sections: &Sections) -> Self {
        let mut missed = Self::default();
        for (id, run) in (0..).map(RunId).zip(sections.runs().all()).filter(|(_, run)| run.is_open()) {
            missed.add(Missed::of(sections, id, run));
        }
        missed
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Missed> {
        self.list.iter().flatten()
    }

    /// Adds a stretch, joined with all entries that its pass overlaps. If the list is full, the stretch joins the
    /// nearest entry.
    pub(super) fn add(&mut self, mut new: Missed) {
        let overlaps = |entry: &Missed, new: &Missed| entry.near_m < new.far_m && entry.far_m > new.near_m;
        while let Some(entry) = self.take(|entry| overlaps(entry, &new)) {
            new = new.joined(&entry);
        }
        if self.list.iter().all(Option::is_some) {
            let gap_m = |entry: &Missed| (entry.near_m - new.far_m).max(new.near_m - entry.far_m);
            let nearest_m = self.iter().map(gap_m).fold(f64::INFINITY, f64::min);
            if let Some(entry) = self.take(|entry| gap_m(entry) <= nearest_m) {
                new = new.joined(&entry);
            }
        }
        if let Some(slot) = self.list.iter_mut().find(|slot| slot.is_none()) {
            *slot = Some(new);
        }
        let near_m = |entry: &Option<Missed>| entry.map_or(f64::INFINITY, |entry| entry.near_m);
        self.list.sort_unstable_by(|a, b| near_m(a).total_cmp(&near_m(b)));
    }

    /// Removes and returns the first entry for which `is_wanted` holds.
    fn take(&mut self, is_wanted: impl Fn(&Missed) -> bool) -> Option<Missed> {
        self.list.iter_mut().find(|slot| slot.is_some_and(|entry| is_wanted(&entry))).and_then(Option::take)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_coverage::Causes;

    fn missed(near_m: f64, far_m: f64, at_most_mps: f64) -> Missed {
        Missed {
            run: RunId(0),
            near_m,
            far_m,
            missed_m: 1.0,
            at_most_mps,
            is_rolled: false,
            changes: Changes::default(),
        }
    }

    #[test]
    fn overlapping_passes_are_one_pass_at_the_lower_speed() {
        let mut list = MissedList::default();
        for entry in [
            missed(20.0, 24.0, 0.1),
            missed(5.0, 9.0, 0.09),
            missed(12.0, 15.0, 0.0),
            missed(8.0, 12.5, 0.12),
        ] {
            list.add(entry);
        }
        let found: Vec<_> =
            list.iter().map(|entry| (entry.near_m, entry.far_m, entry.at_most_mps, entry.missed_m)).collect();
        assert_eq!(found, [(5.0, 15.0, 0.09, 3.0), (20.0, 24.0, 0.1, 1.0)]);
    }

    #[test]
    fn pass_over_two_stretches_has_the_changes_of_both() {
        let with = |cause, is_beyond_speed| Changes { causes: Causes::of(cause), is_beyond_speed };
        let mut list = MissedList::default();
        list.add(Missed { changes: with(Cause::TooFast, false), ..missed(5.0, 9.0, 0.09) });
        list.add(Missed { changes: with(Cause::MissingReturns, true), ..missed(8.0, 15.0, 0.0) });
        let causes = Causes::of(Cause::TooFast).with(Cause::MissingReturns);
        let found: Vec<_> = list.iter().map(|entry| entry.changes).collect();
        assert_eq!(found, [Changes { causes, is_beyond_speed: true }]);
    }

    #[test]
    fn full_list_joins_the_nearest_stretches_and_loses_none() {
        let mut list = MissedList::default();
        for number in 0..=MOST_PASSES {
            let near_m = 10.0 * number as f64;
            list.add(missed(near_m, near_m + 4.0, 0.1));
        }
        assert_eq!(list.iter().count(), MOST_PASSES);
        assert!((list.iter().map(|entry| entry.missed_m).sum::<f64>() - 11.0).abs() < 1e-9);
        assert!(list.iter().is_sorted_by(|a, b| a.far_m < b.near_m));
    }
}
