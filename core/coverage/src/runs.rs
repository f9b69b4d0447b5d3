//! Missed stretches (in the code: runs). Neighbouring failed sections are reported as one event with a permanent
//! number.

use serde::{Deserialize, Serialize};

use super::again::{Again, Failing, NAMED_OF, Tally};
use super::cause::{Cause, Causes};
use super::hole::Hole;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::MonoNs;

/// Maximum gap between neighbouring failed sections of one missed stretch, m.
///
/// Beyond a wider gap, the speed that one section needs says nothing about the next one.
const JOIN_M: f64 = 0.5;

/// Number of a missed stretch. It is never used for another missed stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RunId(pub u32);

/// A missed stretch: neighbouring failed sections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Most frequent cause among the stretch's sections. In a tie, the cause stays as it was.
    pub cause: Cause,
    /// Number of the stretch's sections with each cause, in the order of [`Cause::ALL`].
    counts: [u32; Cause::ALL.len()],
    /// Counts that decide the advice on passing the stretch again.
    tally: Tally,
    /// Index of the stretch's first section.
    pub from: i64,
    /// Index after the stretch's last section.
    pub to: i64,
    /// Number of the stretch's sections that fail.
    pub failed: u32,
    /// Index of the section with the largest hole, and this hole.
    ///
    /// In a cleared missed stretch, both are from the time before it was cleared.
    pub worst: (i64, Hole),
    /// Time at which the stretch was first flagged.
    pub raised: MonoNs,
    /// Time of the stretch's latest change.
    pub changed: MonoNs,
    /// Time at which the last of the stretch's sections stopped failing; `None` while one fails.
    pub cleared: Option<MonoNs>,
    /// Missed stretch into which this one was merged.
    pub merged_into: Option<RunId>,
}

impl Run {
    /// Whether the figures of a stretch that is not cleared agree: its ends, the counts of its sections, and its
    /// largest hole.
    fn is_consistent(&self) -> bool {
        let Self { from, to, failed, .. } = *self;
        let is_counted = self.counts.iter().all(|count| *count <= failed) && self.tally.is_of(failed);
        let is_open = self.cleared.is_none() && self.merged_into.is_none();
        let is_within = i64::from(failed) <= to - from && (from..to).contains(&self.worst.0);
        is_counted && is_open && is_within
    }

    /// Whether any section of the stretch still fails.
    pub fn is_open(&self) -> bool {
        self.failed > 0
    }

    /// Number of the stretch's sections that have this cause.
    pub fn count(&self, cause: Cause) -> u32 {
        self.counts.get(cause as usize).copied().unwrap_or(0)
    }

    /// Causes named in texts: the main cause, and the next most frequent one if at least a tenth of the sections have
    /// it.
    pub fn named(&self) -> Causes {
        let others = Cause::ALL.into_iter().filter(|cause| *cause != self.cause);
        let next = others.rev().max_by_key(|cause| self.count(*cause));
        let next = next.filter(|cause| NAMED_OF * self.count(*cause) >= self.failed.max(1));
        next.map_or(Causes::of(self.cause), |next| Causes::of(self.cause).with(next))
    }

    /// All causes of the stretch's sections. The main cause comes first, and the others follow by frequency.
    ///
    /// Allocates: the list. So only outputs call this function, never the loop.
    pub fn causes(&self) -> Vec<Cause> {
        let mut causes: Vec<Cause> =
            Cause::ALL.into_iter().filter(|cause| *cause == self.cause || self.count(*cause) > 0).collect();
        causes.sort_by_key(|cause| (*cause != self.cause, core::cmp::Reverse(self.count(*cause))));
        causes
    }

    /// Advice for passing the stretch again.
    pub fn again(&self) -> Again {
        self.tally.again(self.failed)
    }

    /// Adds a section to the stretch's counts.
    fn count_in(&mut self, section: &Failing) {
        self.tally.add(section);
        for cause in section.causes.iter() {
            if let Some(count) = self.counts.get_mut(cause as usize) {
                *count += 1;
            }
        }
    }

    /// Removes a section from the stretch's counts. Returns true if the lowest speed must be found again.
    fn count_out(&mut self, section: &Failing) -> bool {
        for cause in section.causes.iter() {
            if let Some(count) = self.counts.get_mut(cause as usize) {
                debug_assert!(*count > 0, "a removed section was counted for {cause:?}");
                *count = count.saturating_sub(1);
            }
        }
        self.tally.remove(section)
    }

    /// Resets the stretch's counts to zero.
    fn count_none(&mut self) {
        self.counts.fill(0);
        self.tally = Tally::default();
    }

    /// Makes the most frequent cause the stretch's main cause.
    fn choose(&mut self) {
        let most = Cause::ALL.into_iter().rev().max_by_key(|cause| self.count(*cause));
        self.cause = most.filter(|most| self.count(*most) > self.count(self.cause)).unwrap_or(self.cause);
    }
}

/// Kind of change of a missed stretch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunChange {
    /// The missed stretch is new.
    Raised,
    /// The ends, the causes or the largest hole of the stretch have changed.
    Changed,
    /// No section of the stretch fails any more, because a later pass filled the holes.
    Cleared,
    /// The stretch was merged into another missed stretch.
    Merged,
}

/// All missed stretches of a dive.
#[derive(Debug, Clone)]
pub struct Runs {
    first: i64,
    join: i64,
    runs: Vec<Run>,
    /// For each section: number of its stretch plus one, or zero.
    member: Vec<u32>,
    /// Causes and required speed of each section that belongs to a missed stretch.
    failing: Vec<Failing>,
}

stateful!(Runs { lists: runs; slots: member, failing; fixed: first, join; });

/// Context for updating missed stretches, with a function to call for each that changes.
pub struct RunUpdate<'a> {
    /// Time of the change.
    pub at: MonoNs,
    /// Function that returns the hole of any section.
    pub hole: &'a dyn Fn(i64) -> Option<Hole>,
    /// Function that is called for every missed stretch that changes.
    pub tell: &'a mut dyn FnMut(RunId, RunChange),
}

impl Runs {
    /// Creates an empty set of missed stretches for `count` sections of length `section_m` from index `first` on.
    ///
    /// Allocates: at startup, all memory that it will ever use.
    pub fn new(first: i64, count: usize, section_m: f64) -> Self {
        let join = headrace_geometry::math::floor_to_i64(JOIN_M / section_m + 1e-9).max(0) + 1;
        let (member, failing) = (vec![0; count], vec![Failing::default(); count]);
        Self { first, join, runs: Vec::with_capacity(count), member, failing }
    }

    /// Returns all missed stretches so far, by number.
    pub fn all(&self) -> &[Run] {
        &self.runs
    }

    /// Returns the missed stretch with the number `id`.
    pub fn get(&self, id: RunId) -> Option<&Run> {
        self.runs.get(id.0 as usize)
    }

    /// Returns the stretch to which a section belongs.
    pub fn of(&self, section: i64) -> Option<RunId> {
        self.member.get(self.slot(section)?).copied()?.checked_sub(1).map(RunId)
    }

    /// Whether a section is too far from a missed stretch to belong to it.
    pub fn is_beyond(&self, run: &Run, section: i64) -> bool {
        section - run.to >= self.join || run.from - section > self.join
    }

    /// Sets the state of a section: it fails for the given causes, or does not fail (`None`).
    ///
    /// Allocates: never.
    pub fn set(&mut self, section: i64, failing: Option<Failing>, update: &mut RunUpdate<'_>) {
        let was_in = self.of(section);
        match (was_in, failing) {
            (Some(id), Some(failing)) => {
                let before = self.failing_at(section);
                self.put_down_to(section, failing);
                self.count_again(id, [&before, &failing]);
                self.measure_again(id, section, update);
                (update.tell)(id, RunChange::Changed);
            }
            (Some(id), None) => self.leave(section, id, update),
            (None, Some(failing)) => self.join(section, failing, update),
            (None, None) => {}
        }
        for id in [was_in, self.of(section)].into_iter().flatten() {
            debug_assert!(self.is_consistent(id), "{id:?} fits its sections: {:?}", self.get(id));
        }
    }

    /// Whether a missed stretch is consistent. An open one must begin and end with its own sections, and must be too
    /// far from others to be joined. A closed one is always consistent.
    fn is_consistent(&self, id: RunId) -> bool {
        let is_own = |section: i64| self.of(section) == Some(id);
        let is_apart = |section: i64| self.of(section).is_none_or(|of| of == id);
        self.get(id).is_some_and(|run| {
            let Run { from, to, .. } = *run;
            let mut beside = (from - self.join..from).chain(to..to + self.join);
            let fits = is_own(from) && is_own(to - 1) && beside.all(is_apart);
            !run.is_open() || run.is_consistent() && fits
        })
    }

    /// Replaces a section's entry `before` in the counts of its missed stretch by `now`.
    fn count_again(&mut self, id: RunId, [before, now]: [&Failing; 2]) {
        let Some(mut run) = self.get(id).copied() else {
            debug_assert!(false, "{id:?} of a section is one of {} runs", self.runs.len());
            return;
        };
        let was_least = run.count_out(before);
        if was_least && !run.tally.is_least(now) {
            run.count_none();
            let members = (run.from..run.to).filter(|index| self.of(*index) == Some(id));
            members.for_each(|index| run.count_in(&self.failing_at(index)));
        } else {
            run.count_in(now);
        }
        run.choose();
        if let Some(slot) = self.runs.get_mut(id.0 as usize) {
            *slot = run;
        }
    }

    /// Causes for which a section fails, and the speed that it needs.
    fn failing_at(&self, section: i64) -> Failing {
        debug_assert!(self.slot(section).is_some(), "section {section} is one of {}", self.member.len());
        self.slot(section).and_then(|slot| self.failing.get(slot)).copied().unwrap_or_default()
    }

    fn put_down_to(&mut self, section: i64, failing: Failing) {
        if let Some(slot) = self.slot(section).and_then(|slot| self.failing.get_mut(slot)) {
            *slot = failing;
        }
    }

    /// Adds a failed section to the neighbouring missed stretches, which it may merge. Without neighbours, starts a new
    /// one.
    fn join(&mut self, section: i64, failing: Failing, update: &mut RunUpdate<'_>) {
        let near = |side: i64| (1..=self.join).find_map(|step| self.of(section + side * step));
        let (kept, other) = match (near(-1), near(1)) {
            (Some(a), Some(b)) if a != b => (a.min(b), Some(a.max(b))),
            (Some(id), _) | (None, Some(id)) => (id, None),
            (None, None) => {
                if let Some(id) = self.begin(section, failing, update) {
                    (update.tell)(id, RunChange::Raised);
                }
                return;
            }
        };
        self.put(section, kept);
        self.put_down_to(section, failing);
        self.add(kept, section, update);
        if let Some(other) = other {
            self.merge(other, kept, update.at);
            (update.tell)(other, RunChange::Merged);
        }
        (update.tell)(kept, RunChange::Changed);
    }

    /// Removes a section from its missed stretch, which then shrinks, splits or is cleared.
    fn leave(&mut self, section: i64, id: RunId, update: &mut RunUpdate<'_>) {
        self.take_out(section);
        let Some(run) = self.get(id).copied() else {
            debug_assert!(false, "{id:?} is one of {} runs", self.runs.len());
            return;
        };
        let mut after = (section + 1..run.to).filter(|index| self.of(*index) == Some(id));
        let later = after.next();
        let earlier = (run.from..section).rev().find(|index| self.of(*index) == Some(id));
        if let (Some(earlier), Some(later)) = (earlier, later)
            && later - earlier > self.join
            && let Some(new) = self.begin(later, self.failing_at(later), update)
        {
            for index in later..run.to {
                if self.of(index) == Some(id) {
                    self.put(index, new);
                }
            }
            self.measure(new, update);
            (update.tell)(new, RunChange::Raised);
        }
        self.measure(id, update);
        let open = self.get(id).is_some_and(Run::is_open);
        (update.tell)(id, if open { RunChange::Changed } else { RunChange::Cleared });
    }

    fn begin(&mut self, section: i64, failing: Failing, update: &RunUpdate<'_>) -> Option<RunId> {
        if self.runs.len() == self.runs.capacity() {
            // All numbers of missed stretches are used up. The section remains flagged, but belongs to no stretch.
            return None;
        }
        let id = RunId(u32::try_from(self.runs.len()).ok()?);
        let worst = (section, (update.hole)(section)?);
        let (from, to, at) = (section, section + 1, update.at);
        let mut run = Run {
            cause: failing.causes.iter().next().unwrap_or(Cause::Unknown),
            counts: [0; Cause::ALL.len()],
            tally: Tally::default(),
            from,
            to,
            failed: 1,
            worst,
            raised: at,
            changed: at,
            cleared: None,
            merged_into: None,
        };
        run.count_in(&failing);
        self.runs.push(run);
        self.put(section, id);
        self.put_down_to(section, failing);
        Some(id)
    }

    fn merge(&mut self, other: RunId, kept: RunId, at: MonoNs) {
        let Some(run) = self.get(other).copied() else {
            debug_assert!(false, "{other:?} is one of {} runs", self.runs.len());
            return;
        };
        for index in run.from..run.to {
            if self.of(index) == Some(other) {
                self.put(index, kept);
            }
        }
        if let Some(kept) = self.runs.get_mut(kept.0 as usize) {
            kept.failed += run.failed;
            kept.worst = larger(kept.worst, run.worst);
            kept.counts.iter_mut().zip(run.counts).for_each(|(count, more)| *count += more);
            kept.tally.join(&run.tally);
            kept.choose();
        }
        if let Some(run) = self.runs.get_mut(other.0 as usize) {
            (run.failed, run.changed, run.cleared, run.merged_into) = (0, at, Some(at), Some(kept));
            run.count_none();
        }
    }

    /// Updates the figures of a missed stretch for a section that was just added to it.
    fn add(&mut self, id: RunId, section: i64, update: &RunUpdate<'_>) {
        let (hole, failing) = ((update.hole)(section), self.failing_at(section));
        if let Some(run) = self.runs.get_mut(id.0 as usize) {
            run.failed += 1;
            run.count_in(&failing);
            run.choose();
            run.changed = update.at;
            run.worst = hole.map_or(run.worst, |hole| larger(run.worst, (section, hole)));
        }
    }

    /// Updates the largest hole of a missed stretch, because the hole of this section has changed.
    fn measure_again(&mut self, id: RunId, section: i64, update: &RunUpdate<'_>) {
        let (Some(run), Some(hole)) = (self.runs.get_mut(id.0 as usize), (update.hole)(section)) else {
            return;
        };
        if run.worst.0 == section && hole.diameter_m < run.worst.1.diameter_m {
            self.measure(id, update);
        } else {
            run.changed = update.at;
            run.worst = larger(run.worst, (section, hole));
        }
    }

    /// Computes the section count, causes, ends and largest hole of a missed stretch again.
    fn measure(&mut self, id: RunId, update: &RunUpdate<'_>) {
        let Some(run) = self.get(id).copied() else {
            debug_assert!(false, "{id:?} is one of {} runs", self.runs.len());
            return;
        };
        let members = || (run.from..run.to).filter(|index| self.of(*index) == Some(id));
        let failed = u32::try_from(members().count()).unwrap_or(u32::MAX);
        let holes = members().filter_map(|index| Some((index, (update.hole)(index)?)));
        let worst = holes.reduce(larger).unwrap_or(run.worst);
        let ends = members().next().zip(members().next_back());
        let (from, to) = ends.map_or((run.from, run.to), |(first, last)| (first, last + 1));
        let cleared = (failed == 0).then_some(update.at);
        let mut now = Run { failed, worst, from, to, cleared, changed: update.at, ..run };
        now.count_none();
        members().for_each(|index| now.count_in(&self.failing_at(index)));
        now.choose();
        if let Some(run) = self.runs.get_mut(id.0 as usize) {
            *run = now;
        }
    }

    fn put(&mut self, section: i64, id: RunId) {
        if let Some(slot) = self.slot(section).and_then(|slot| self.member.get_mut(slot)) {
            *slot = id.0 + 1;
        }
        if let Some(run) = self.runs.get_mut(id.0 as usize) {
            (run.from, run.to) = (run.from.min(section), run.to.max(section + 1));
        }
    }

    fn take_out(&mut self, section: i64) {
        if let Some(slot) = self.slot(section).and_then(|slot| self.member.get_mut(slot)) {
            *slot = 0;
        }
    }

    fn slot(&self, section: i64) -> Option<usize> {
        usize::try_from(section - self.first).ok().filter(|slot| *slot < self.member.len())
    }
}

/// Returns the section with the larger hole, or the first one if both holes are equal.
fn larger(a: (i64, Hole), b: (i64, Hole)) -> (i64, Hole) {
    if b.1.diameter_m > a.1.diameter_m { b } else { a }
}

#[cfg(test)]
mod tests;
