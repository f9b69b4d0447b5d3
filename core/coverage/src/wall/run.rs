//! Successive returns of a head that agree with one another and with nothing else yet.

use serde::{Deserialize, Serialize};

use crate::wall_limits::{PlacedReturn, WallLimits};

/// Most returns that wait for one another.
pub const MOST_WAITING: usize = 24;
/// What is off the wall by more than so many times its width, with a jump to the wall on both sides, hangs in the water, or came by way
/// of two walls: rocks, heaps, niches and caves are about as wide as they are high or deep, and of a side tunnel as much is seen.
/// Tuned on the field table's murk: clusters of returns there are 12 times and more as far from the wall as they are wide.
const SLENDER: f64 = 4.0;

/// See the module's description.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Run {
    waiting: [PlacedReturn; MOST_WAITING],
    waits: u8,
    /// The first return, also of a run of which some have been given up, and how many there were.
    first: Option<PlacedReturn>,
    all: u32,
    /// How far it is off the design at most, and how wide it is, m.
    off_m: f64,
    width_m: f64,
}

impl Run {
    /// How many wait.
    pub(super) fn count(&self) -> u32 {
        u32::from(self.waits)
    }

    /// Those that wait.
    pub(super) fn returns(&self) -> impl Iterator<Item = &PlacedReturn> {
        self.waiting.iter().take(usize::from(self.waits))
    }

    /// Adds a return, which waits.
    pub(super) fn add(&mut self, placed: &PlacedReturn, limits: &WallLimits) {
        let first = *self.first.get_or_insert(*placed);
        self.all += 1;
        self.off_m = self.off_m.max(placed.off_m.abs());
        // Each return stands for a step to either side.
        let steps = f64::from(self.all.max(2)) / f64::from(self.all.max(2) - 1);
        self.width_m = self.width_m.max(steps * limits.width_m(&first, placed));
        if let Some(slot) = self.waiting.get_mut(usize::from(self.waits)) {
            *slot = *placed;
            self.waits += 1;
        }
    }

    /// Whether it is wall for its width.
    pub(super) fn is_broad(&self) -> bool {
        self.all > 1 && SLENDER * self.width_m >= self.off_m
    }

    /// Whether no further return can wait.
    pub(super) fn is_full(&self) -> bool {
        usize::from(self.waits) == MOST_WAITING
    }

    /// Those that waited are given up but for the last one.
    pub(super) fn give_up(&mut self, last: &PlacedReturn) {
        self.waiting[0] = *last;
        self.waits = 1;
    }
}
