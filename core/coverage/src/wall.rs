//! Which returns are taken for wall: those where the design says, and those that others agree with.
//!
//! A return within the tolerance of the design is wall. Another one needs a neighbour along the turn, or an earlier pass
//! nearby, that found the wall as far off the design. What nobody agrees with is *doubtful*: a fish, a bubble, an echo by
//! way of two walls. It waits for the head's next return before it is called so, since a boulder begins with one return.

use serde::{Deserialize, Serialize};

use super::relief::Relief;
use super::trust::{Beam, Distrust, HeadTrust};
use super::wall_limits::{PlacedReturn, WallLimits};

/// What a return is taken for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Taken {
    /// Wall.
    Wall,
    /// Not settled: wall, or something in the water.
    Doubtful,
    /// The head's next return decides.
    Waits,
}

/// What a return has decided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sorted {
    /// What the return that waited for this one is taken for; `None` if none did.
    pub waiting: Option<Taken>,
    /// What this one is taken for.
    pub this: Taken,
    /// The head isn't believed any more: why, and the chainages of its late returns, m.
    pub distrusted: Option<(Distrust, [f64; 2])>,
}

/// A head's last returns, and whether it is believed.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct HeadWall {
    /// The last return and the one before.
    last: [Option<PlacedReturn>; 2],
    /// The last one waits.
    waits: bool,
    trust: HeadTrust,
}

impl HeadWall {
    /// Why the head isn't believed; `None` if it is.
    pub fn distrusted(&self) -> Option<Distrust> {
        self.trust.distrusted()
    }

    /// Sorts the head's next return, and the one that waited for it. `beam` says how it was had.
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
        let before = self.last;
        let [last, last_but_one] =
            before.map(|other| other.is_some_and(|other| limits.agree(&placed, &other)));
        let is_design = limits.is_design(&placed);
        let is_wall = is_design || last || last_but_one || relief.supports(&placed, limits);
        let waiting =
            core::mem::take(&mut self.waits).then_some(if last { Taken::Wall } else { Taken::Doubtful });
        self.last = [Some(placed), before[0]];
        relief.vote(head, &placed, limits);
        let both_design = is_design && before[0].is_some_and(|other| limits.is_design(&other));
        let doubtful = u32::from(waiting == Some(Taken::Doubtful));
        let jump_m = before[0].filter(|_| !last && !both_design).map(|other| placed.off_m - other.off_m);
        let distrusted = self.trust.note(&placed, beam, jump_m, doubtful, limits, relief.ballot(head));
        relief.believe(head, self.distrusted().is_none());
        if self.distrusted().is_some() {
            return Sorted { waiting: waiting.map(|_| Taken::Doubtful), this: Taken::Doubtful, distrusted };
        }
        if let (Some(Taken::Wall), Some(other)) = (waiting, before[0]) {
            relief.remember(&other, true, limits);
        }
        relief.remember(&placed, is_wall, limits);
        self.waits = !is_wall;
        let this = if is_wall { Taken::Wall } else { Taken::Waits };
        Sorted { waiting, this, distrusted }
    }
}

#[cfg(test)]
mod tests;
