//! Decides which returns are wall: those near the design profile, and those with which other returns agree.
//!
//! A return within the tolerance of the design is wall. Another return needs a neighbour along the turn that is wall,
//! or an earlier pass nearby with the same deviation from the design. Successive returns that agree only with one
//! another are a *run*. A run is wall if it is wide for its distance from the design, or if it ends in a slope to the
//! wall.
//!
//! An isolated return is *doubtful*. So is a run that hangs in front of the wall: a fish, a cloud of bubbles, an echo
//! off two walls. A return waits for the head's next returns before it counts as doubtful, since a boulder begins
//! with a single return.

use serde::{Deserialize, Serialize};

use super::relief::Relief;
use super::trust::{Beam, Disagreement, Distrust, HeadTrust, Others};
use super::wall_limits::{PlacedReturn, WallLimits};

/// Classification of a return.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Taken {
    /// The return came from wall.
    Wall,
    /// Uncertain: wall, or something in the water.
    Doubtful,
    /// Pending: the head's next returns decide.
    Waits,
}

/// Decisions on a head's returns that follow from its newest return.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sorted {
    /// Classification of all waiting returns; `None` if no return waits, or if the returns still wait.
    pub waiting: Option<Taken>,
    /// Classification of the newest return.
    pub this: Taken,
    /// Reason if the newest return makes the head distrusted, and the chainages of the head's recent returns,
    /// m.
    pub distrusted: Option<(Distrust, [f64; 2])>,
}

/// Maximum number of a head's returns that wait for classification.
pub const MOST_WAITING: usize = 24;
/// A run is no wall if its distance from the wall is more than this multiple of its width, and if it has a
/// jump to the wall on both sides.
///
/// Such a run hangs in the water, or is an echo off two walls. Rocks, heaps, niches and caves are about as
/// wide as they are high or deep. Side tunnels appear as deep as they are wide.
///
/// Tuned on the condition `murk` of the field table: its clusters of returns are at least 12 times as far
/// from the wall as they are wide.
const SLENDER: f64 = 4.0;

/// A run: successive returns that agree only with one another.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
struct Run {
    waiting: [PlacedReturn; MOST_WAITING],
    waits: u8,
    /// First return and number of returns of the run. Both include returns that have already been classified.
    first: Option<PlacedReturn>,
    all: u32,
    /// Largest distance of the run from the design, and its width, m.
    off_m: f64,
    width_m: f64,
}

impl Run {
    /// Number of the run's returns that wait for classification.
    fn count(&self) -> u32 {
        u32::from(self.waits)
    }

    /// Returns the run's returns that wait for classification.
    fn returns(&self) -> impl Iterator<Item = &PlacedReturn> {
        self.waiting.iter().take(usize::from(self.waits))
    }

    /// Adds a return that waits for classification to the run.
    fn add(&mut self, placed: &PlacedReturn, limits: &WallLimits) {
        debug_assert!(!self.is_full(), "a run is given up when {MOST_WAITING} returns wait: {}", self.waits);
        let first = *self.first.get_or_insert(*placed);
        self.all += 1;
        self.off_m = self.off_m.max(placed.off_m.abs());
        // Each return represents one step of width: half a step on either side.
        let steps = f64::from(self.all.max(2)) / f64::from(self.all.max(2) - 1);
        self.width_m = self.width_m.max(steps * limits.width_m(&first, placed));
        if let Some(slot) = self.waiting.get_mut(usize::from(self.waits)) {
            *slot = *placed;
            self.waits += 1;
        }
    }

    /// Whether the run is wide enough to be wall.
    fn is_broad(&self) -> bool {
        self.all > 1 && SLENDER * self.width_m >= self.off_m
    }

    /// Whether there is no room for another waiting return.
    fn is_full(&self) -> bool {
        usize::from(self.waits) == MOST_WAITING
    }

    /// Removes all waiting returns except the last one.
    fn give_up(&mut self, last: &PlacedReturn) {
        self.waiting[0] = *last;
        self.waits = 1;
    }
}

/// The last returns of a head, and the trust in this head.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadWall {
    /// The last two returns, latest first, and their classification.
    last: [Option<(PlacedReturn, Taken)>; 2],
    /// The run of returns that wait for classification.
    run: Run,
    trust: HeadTrust,
}

impl HeadWall {
    /// Reason for distrusting the head; `None` if it is trusted.
    pub fn distrusted(&self) -> Option<Distrust> {
        self.trust.distrusted()
    }

    /// Classifies the head's next return and the returns that waited for it.
    ///
    /// `beam` is the beam of the next return.
    ///
    /// Allocates: never.
    pub fn sort(
        &mut self,
        head: usize,
        placed: PlacedReturn,
        beam: &Beam<'_>,
        limits: &WallLimits,
        relief: &mut Relief,
    ) -> Sorted {
        let [last, last_but_one] =
            self.last.map(|before| before.filter(|(other, _)| limits.agree(&placed, other)));
        let is_of_wall =
            |other: Option<(PlacedReturn, Taken)>| other.is_some_and(|(_, taken)| taken == Taken::Wall);
        let is_design = limits.is_design(&placed);
        let is_wall =
            is_design || is_of_wall(last) || is_of_wall(last_but_one) || relief.supports(&placed, limits);
        let before = self.last[0].map(|(other, _)| other);
        let (waited, waiting, this) = self.decide(&placed, is_wall, last.is_some(), limits);
        relief.vote(head, &placed, limits);
        let both_design = is_design && before.is_some_and(|other| limits.is_design(&other));
        let jump_m =
            before.filter(|_| last.is_none() && !both_design).map(|other| placed.off_m - other.off_m);
        let doubtful = if waiting == Some(Taken::Doubtful) { waited.count() } else { 0 };
        let others = Others { ballot: relief.ballot(head), change: relief.others_change(head) };
        let distrusted = self.trust.note(&placed, beam, Disagreement { jump_m, doubtful }, limits, &others);
        relief.note_changing(head, !self.trust.is_stuck(limits));
        relief.believe(head, self.distrusted().is_none());
        if self.distrusted().is_some() {
            self.run = Run::default();
            self.last[0] = Some((placed, Taken::Doubtful));
            let waiting = (waited.count() > 0).then_some(Taken::Doubtful);
            return Sorted { waiting, this: Taken::Doubtful, distrusted };
        }
        if let Some(taken) = waiting {
            waited.returns().for_each(|other| relief.remember(other, taken == Taken::Wall, limits));
        }
        if this == Taken::Wall {
            relief.remember(&placed, true, limits);
        }
        Sorted { waiting, this, distrusted }
    }

    /// Classifies a head's new return and the returns that wait for it.
    ///
    /// `agrees` means that the new return agrees with the head's previous return. Output: the run of waiting
    /// returns, its classification (`None` if undecided), and the classification of the new return.
    fn decide(
        &mut self,
        placed: &PlacedReturn,
        is_wall: bool,
        agrees: bool,
        limits: &WallLimits,
    ) -> (Run, Option<Taken>, Taken) {
        let waited = self.run;
        let goes_on = !is_wall && agrees && waited.count() > 0;
        let mut run = if goes_on { waited } else { Run::default() };
        if !is_wall {
            run.add(placed, limits);
        }
        let is_broad = run.is_broad();
        let this = if is_wall || is_broad { Taken::Wall } else { Taken::Waits };
        let waiting = match waited.count() {
            0 => None,
            // Either the run ended in a slope to the wall, or the run is wide enough.
            _ if is_wall && agrees || is_broad && goes_on => Some(Taken::Wall),
            _ if !goes_on => Some(Taken::Doubtful),
            _ if run.is_full() => Some(Taken::Doubtful),
            _ => None,
        };
        if waiting == Some(Taken::Doubtful) && goes_on {
            run.give_up(placed);
        }
        self.run = if this == Taken::Wall { Run::default() } else { run };
        let settled = |(other, taken): (PlacedReturn, Taken)| {
            (other, waiting.filter(|_| taken == Taken::Waits).unwrap_or(taken))
        };
        self.last = [Some((*placed, this)), self.last[0].map(settled)];
        (waited, waiting, this)
    }
}

#[cfg(test)]
mod tests;
