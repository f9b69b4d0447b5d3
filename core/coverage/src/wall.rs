//! Which returns are taken for wall: those where the design says, and those that others agree with.
//!
//! A return within the tolerance of the design is wall. Another one needs a neighbour along the turn that is wall, or an earlier
//! pass nearby, that found the wall as far off the design. Successive returns that agree with one another alone are a *run*: it is wall
//! once it is broad for how far it is off the design, or where it ends in a slope to the wall. What nobody agrees with, and
//! what hangs before the wall, is *doubtful*: a fish, a cloud of bubbles, an echo by way of two walls. It waits for the head's
//! next returns before it is called so, since a boulder begins with one return.

use serde::{Deserialize, Serialize};

use super::relief::Relief;
use super::trust::{Beam, Distrust, HeadTrust, Others};
use super::wall_limits::{PlacedReturn, WallLimits};

mod run;

pub use run::MOST_WAITING;
use run::Run;

/// What a return is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Taken {
    /// Wall.
    Wall,
    /// Not settled: wall, or something in the water.
    Doubtful,
    /// The head's next returns decide.
    Waits,
}

/// What a return has decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sorted {
    /// What the returns that waited are taken for, all of them; `None` if none did, or they go on waiting.
    pub waiting: Option<Taken>,
    /// What this one is taken for.
    pub this: Taken,
    /// The head isn't believed any more: why, and the chainages of its late returns, m.
    pub distrusted: Option<(Distrust, [f64; 2])>,
}

/// A head's last returns, and whether it is believed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadWall {
    /// The last return and the one before, and what they are taken for.
    last: [Option<(PlacedReturn, Taken)>; 2],
    /// The returns that wait.
    run: Run,
    trust: HeadTrust,
}

impl HeadWall {
    /// Why the head isn't believed; `None` if it is.
    pub fn distrusted(&self) -> Option<Distrust> {
        self.trust.distrusted()
    }

    /// Sorts the head's next return, and those that waited for it. `beam` says how it was had.
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
        let distrusted = self.trust.note(&placed, beam, jump_m, doubtful, limits, &others);
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

    /// What a return and those that waited are taken for, and those. `agrees` with the last one.
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
            // Ended in a slope to the wall, or wide enough.
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
