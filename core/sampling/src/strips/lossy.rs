//! Number of passes over each strip that replace a single pass if returns are lost.

use super::Strips;
use super::thin::Thin;
use crate::head::{HeadSet, MAX_HEADS};
use crate::losses::{LossRate, Sampled};

impl Strips {
    /// Computes the number of passes over each strip that replace a single pass in a setting.
    ///
    /// The number is used with [`crate::passes::Passes::lossy`]. `rates` are the losses of each head, `None` for an
    /// absent head.
    ///
    /// Allocates: not if the capacity suffices for the settings.
    pub fn count_losses(&mut self, setting: usize, target_m: f64, rates: &[Option<LossRate>; MAX_HEADS]) {
        let first = setting * self.strips.len();
        self.needed.resize(self.steps_m.len(), [1.0; 2]);
        let lost = |heads: HeadSet| heads.iter().filter_map(|head| *rates.get(head)?);
        let all = HeadSet::first(MAX_HEADS);
        for k in 0..self.strips.len() {
            let (Some(strip), Some(steps_m)) = (self.strips.get(k), self.steps_m.get(first + k)) else {
                return;
            };
            let perimeter_m = self.seen_alike(k).length_m;
            let sampled = |t_y_m: f64| Sampled { target_m, t_y_m, perimeter_m };
            let passes = [
                sampled(steps_m[0]).passes_needed(lost(strip.seen_by)),
                sampled(steps_m[1]).passes_needed(lost(all)),
            ];
            if let Some(slot) = self.needed.get_mut(first + k) {
                *slot = passes;
            }
        }
    }

    /// Returns the number of passes that replace a single pass, within a strip and across it.
    pub(super) fn needed(&self, setting: usize, k: usize, thin: &Thin<'_>) -> [f64; 2] {
        let needed = || self.needed.get(setting * self.strips.len() + k).copied();
        if thin.is_lossy() { needed().unwrap_or([1.0; 2]) } else { [1.0; 2] }
    }
}
