//! Heads that return after a silence.

use crate::head::MAX_HEADS;
use crate::passes::{Phasing, Situation};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Longest time that a head may need to join its program after a silence. A driver moves it there within 2 s on a fast
/// line.
const JOINS_WITHIN: DurNs = DurNs(10_000_000_000);

/// Leaves out heads that have returned but have not joined their program yet.
///
/// Such a head turns in coarse steps and at another rate than the heads in step. Its present motion says nothing about
/// its next turns, so the advice goes by the other heads. A head that stays out of step counts after ten seconds.
#[derive(Debug, Clone, Default)]
pub struct ReturningHeads {
    /// Time since which each head has been present.
    since: [Option<MonoNs>; MAX_HEADS],
}

stateful!(ReturningHeads { state: since; });

impl ReturningHeads {
    /// Returns the situation without heads that are on their way to their program.
    ///
    /// Must be called at each advice update. Allocates: never.
    #[must_use]
    pub fn left_out(&mut self, at: MonoNs, situation: &Situation) -> Situation {
        let in_step = Phasing::of(situation).in_step();
        let mut counted = *situation;
        for (head, (slot, since)) in counted.heads.iter_mut().zip(&mut self.since).enumerate() {
            *since = slot.and(Some(since.unwrap_or(at)));
            let is_new = since.is_some_and(|since| at.since(since).0 < JOINS_WITHIN.0);
            if is_new && !in_step.has(head) && !in_step.is_empty() {
                *slot = None;
            }
        }
        counted
    }
}
