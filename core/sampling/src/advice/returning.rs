//! Heads that return after a silence.

use crate::head::{HeadSet, MAX_HEADS};
use crate::passes::{Phasing, Situation};
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};

/// Longest time that a head may need to join its program after a silence. A driver moves it there within 2 s on a fast
/// line.
const JOINS_WITHIN: DurNs = DurNs(10_000_000_000);

/// A head on its way to its program takes steps that are longer than those of the other heads by at least this factor.
const COARSE: f64 = 1.5;

/// Leaves out heads that have returned but have not joined their program yet.
///
/// Such a head turns in coarse steps and at another rate than the other heads. Its present motion says nothing about its
/// next turns, so the advice goes by the other heads. A head that stays out of step counts after ten seconds. A head
/// that only stood still for a while goes on in its usual steps, so its passes count at once.
#[derive(Debug, Clone, Default)]
pub struct ReturningHeads {
    /// Heads present at the latest update, and all heads that have ever been present.
    present: HeadSet,
    known: HeadSet,
    /// Time of each head's last return.
    returned: [Option<MonoNs>; MAX_HEADS],
    /// Smallest step of the heads that had not just returned, at the latest update with such heads.
    usual_rad: Option<f64>,
}

stateful!(ReturningHeads { state: present, known, returned, usual_rad; });

impl ReturningHeads {
    /// Returns the situation without heads that are on their way to their program.
    ///
    /// Must be called at each advice update. Allocates: never.
    #[must_use]
    pub fn left_out(&mut self, at: MonoNs, situation: &Situation) -> Situation {
        let mut steady = HeadSet::default();
        let mut present = HeadSet::default();
        for (head, returned) in self.returned.iter_mut().enumerate() {
            if situation.heads.get(head).is_none_or(Option::is_none) {
                continue;
            }
            if self.known.has(head) && !self.present.has(head) {
                *returned = Some(at);
            }
            present = present.with(head);
            if returned.is_none_or(|returned| at.since(returned).0 >= JOINS_WITHIN.0) {
                steady = steady.with(head);
            }
        }
        (self.present, self.known) = (present, self.known.union(present));
        let in_step = Phasing::of(situation).in_step();
        let has_joined = |head: usize| in_step.has(head) && in_step.iter().any(|other| steady.has(other));
        let step_rad =
            |head: usize| situation.heads.get(head).copied().flatten().map(|motion| motion.step_rad);
        // If all heads return together, their steps before the silence tell.
        self.usual_rad = steady.iter().filter_map(step_rad).reduce(f64::min).or(self.usual_rad);
        let usual_rad = self.usual_rad.unwrap_or(f64::INFINITY);
        let is_coarse = |head: usize| step_rad(head).is_some_and(|step_rad| step_rad > COARSE * usual_rad);
        let mut counted = *situation;
        for (head, slot) in counted.heads.iter_mut().enumerate() {
            if !steady.has(head) && !has_joined(head) && is_coarse(head) {
                *slot = None;
            }
        }
        counted
    }
}
