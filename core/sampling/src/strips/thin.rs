//! Detection of wall strips that heads pass less often than the strip that is passed most often.

use crate::head::HeadSet;
use crate::passes::Passes;

/// Number of head sets for which the longest time between passes is stored.
///
/// More sets are rare, because a strip is usually hidden from only one or two heads.
const SETS: usize = 8;
/// Number of strips whose head set is cached; for other strips, the time between passes is computed again.
const STRIPS: usize = 64;
/// Index that stands for a head set that is not stored.
const NOT_KEPT: u8 = u8::MAX;

/// Longest time between passes over each strip, and detection of thin strips.
///
/// A thin strip is passed less often than the strip that is passed most often.
pub(super) struct Thin<'a> {
    passes: &'a Passes,
    /// Head sets, each with its longest time between passes, s. Many strips share a set, because the same heads see
    /// them.
    sets: [(HeadSet, Option<f64>); SETS],
    set_of: [u8; STRIPS],
    best_s: f64,
}

impl<'a> Thin<'a> {
    /// Creates the detection of thin strips; `strips` lists the heads that see each strip.
    pub(super) fn of(passes: &'a Passes, strips: impl Iterator<Item = HeadSet>) -> Self {
        let mut thin = Self {
            passes,
            sets: [(HeadSet::default(), None); SETS],
            set_of: [NOT_KEPT; STRIPS],
            best_s: f64::INFINITY,
        };
        let mut count = 0;
        for (k, seen_by) in strips.enumerate() {
            let known = thin.sets.iter().take(count).position(|(set, _)| *set == seen_by);
            let number = match (known, thin.sets.get_mut(count)) {
                (Some(number), _) => Some(number),
                (None, Some(slot)) => {
                    *slot = (seen_by, passes.gap_s(seen_by));
                    count += 1;
                    Some(count - 1)
                }
                (None, None) => None,
            };
            let number = number.and_then(|number| u8::try_from(number).ok()).unwrap_or(NOT_KEPT);
            if let Some(set_of) = thin.set_of.get_mut(k) {
                *set_of = number;
            }
            if number == NOT_KEPT {
                thin.best_s = passes.gap_s(seen_by).map_or(thin.best_s, |gap_s| thin.best_s.min(gap_s));
            }
        }
        let gaps_s = thin.sets.iter().take(count).filter_map(|(_, gap_s)| *gap_s);
        thin.best_s = gaps_s.fold(thin.best_s, f64::min);
        thin
    }

    /// Time between passes over the strip that is passed most often, s; infinite if no strip is passed.
    pub(super) fn best_s(&self) -> f64 {
        self.best_s
    }

    /// Time between passes over the strip `k`, s; `None` if no head sees the strip.
    pub(super) fn gap_s(&self, k: usize, seen_by: HeadSet) -> Option<f64> {
        let kept = self.set_of.get(k).and_then(|number| self.sets.get(usize::from(*number)));
        kept.map_or_else(|| self.passes.gap_s(seen_by), |(_, gap_s)| *gap_s)
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
    pub(super) fn is_full(&self, k: usize, seen_by: HeadSet) -> bool {
        self.gap_s(k, seen_by).is_some_and(|gap_s| gap_s <= self.best_s)
    }
}
