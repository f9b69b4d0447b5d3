//! A run: successive returns of a head that agree only with one another so far.

use serde::{Deserialize, Serialize};

use crate::wall_limits::{PlacedReturn, WallLimits};

/// Maximum number of waiting returns.
pub const MOST_WAITING: usize = 24;
/// Ratio of distance from the wall to width above which a run is no wall.
///
/// The run has a jump to the wall on both sides. It hangs in the water, or is an echo off two walls. Rocks, heaps,
/// niches and caves are about as wide as they are high or deep. Side tunnels appear as deep as they are wide.
///
/// Tuned on the condition `murk` of the field table: its clusters of returns are at least 12 times as far from the
/// wall as they are wide.
const SLENDER: f64 = 4.0;

/// A run of returns, as described in the parent module.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Run {
    waiting: [PlacedReturn; MOST_WAITING],
    waits: u8,
    /// First return of the run, including returns that no longer wait, and number of returns.
    first: Option<PlacedReturn>,
    all: u32,
    /// Largest distance of the run from the design, and its width, m.
    off_m: f64,
    width_m: f64,
}

impl Run {
    /// Number of waiting returns.
    pub(super) fn count(&self) -> u32 {
        u32::from(self.waits)
    }

    /// Returns the waiting returns.
    pub(super) fn returns(&self) -> impl Iterator<Item = &PlacedReturn> {
        self.waiting.iter().take(usize::from(self.waits))
    }

    /// Adds a waiting return.
    pub(super) fn add(&mut self, placed: &PlacedReturn, limits: &WallLimits) {
        let first = *self.first.get_or_insert(*placed);
        self.all += 1;
        self.off_m = self.off_m.max(placed.off_m.abs());
        // Each return stands for a step, half of it on either side.
        let steps = f64::from(self.all.max(2)) / f64::from(self.all.max(2) - 1);
        self.width_m = self.width_m.max(steps * limits.width_m(&first, placed));
        if let Some(slot) = self.waiting.get_mut(usize::from(self.waits)) {
            *slot = *placed;
            self.waits += 1;
        }
    }

    /// Whether the run is wide enough to be wall.
    pub(super) fn is_broad(&self) -> bool {
        self.all > 1 && SLENDER * self.width_m >= self.off_m
    }

    /// Whether no further return can wait.
    pub(super) fn is_full(&self) -> bool {
        usize::from(self.waits) == MOST_WAITING
    }

    /// Removes the waiting returns except the last one.
    pub(super) fn give_up(&mut self, last: &PlacedReturn) {
        self.waiting[0] = *last;
        self.waits = 1;
    }
}
