//! Detection of wall strips that heads pass less often than the strip that is passed most often.

use crate::head::HeadSet;
use crate::passes::Passes;

/// Number of head sets for which the longest time between passes is kept. For other sets, it is computed again.
///
/// More sets are rare, because a strip is usually hidden from only one or two heads.
const SETS: usize = 8;

/// Longest time between passes over each strip, and detection of thin strips.
///
/// A thin strip is passed less often than the strip that is passed most often.
pub(super) struct Thin<'a> {
    passes: &'a Passes,
    /// Longest time between passes of each head set, s.
    gaps_s: [Option<f64>; SETS],
    best_s: f64,
}

impl<'a> Thin<'a> {
    /// Creates the detection of thin strips; `sets` lists the different sets of heads that see a strip.
    pub(super) fn of(passes: &'a Passes, sets: &[HeadSet]) -> Self {
        let mut thin = Self { passes, gaps_s: [None; SETS], best_s: f64::INFINITY };
        for (number, seen_by) in sets.iter().enumerate() {
            let gap_s = passes.gap_s(*seen_by);
            if let Some(slot) = thin.gaps_s.get_mut(number) {
                *slot = gap_s;
            }
            thin.best_s = thin.best_s.min(gap_s.unwrap_or(f64::INFINITY));
        }
        thin
    }

    /// Time between passes over the strip that is passed most often, s; infinite if no strip is passed.
    pub(super) fn best_s(&self) -> f64 {
        self.best_s
    }

    /// Time between passes over a strip, s; `None` if no head sees the strip. `set` is the index of the set `seen_by`.
    pub(super) fn gap_s(&self, set: u8, seen_by: HeadSet) -> Option<f64> {
        let kept = self.gaps_s.get(usize::from(set)).copied();
        kept.unwrap_or_else(|| self.passes.gap_s(seen_by))
    }

    /// Longest time, s, that `needed` successive passes over a strip take; see [`Passes::time_for_s`].
    pub(super) fn time_for_s(&self, seen_by: HeadSet, gap_s: f64, needed: f64) -> f64 {
        if needed > 1.0 { self.passes.time_for_s(seen_by, gap_s, needed) } else { gap_s }
    }

    /// Unevenness of two heads' passes where their sectors meet, as in [`Passes::uneven_ends`].
    pub(super) fn uneven_ends(&self) -> Option<f64> {
        self.passes.uneven_ends()
    }

    /// Whether extra passes over each place are required for lost returns.
    pub(super) fn is_lossy(&self) -> bool {
        self.passes.is_lossy()
    }

    /// Whether a strip is passed as often as the strip that is passed most often.
    pub(super) fn is_full(&self, set: u8, seen_by: HeadSet) -> bool {
        self.gap_s(set, seen_by).is_some_and(|gap_s| gap_s <= self.best_s)
    }
}
