//! Upper bound on the fraction of causes that a program can display correctly. The bound comes from a reference
//! computation that knows the injected causes.
//!
//! The reference simulates the same dive without each cause, but with other noise than the judged dive. Its fraction
//! of right answers is an upper bound for any method.

use std::collections::BTreeMap;

use headrace_coverage::Cause;

use super::judging::{InterventionDive, Right, hole_at_m, report, right};
use super::matrix::Count;

/// Number of noise seeds with which the reference computation simulates each dive.
const NOISES: u64 = 3;

/// Number of right answers of the reference for dives with two causes. The reference knows everything about a dive
/// except the noise.
#[derive(Debug, Default, Clone, Copy)]
pub struct UpperBound {
    /// Answers for all stretches.
    pub stretches: Count,
    /// Answers for stretches that truly have two causes.
    pub pairs: Count,
}

impl UpperBound {
    /// Adds the answers for a dive. Ignores dives with a single injected cause.
    pub fn add(&mut self, dive: &InterventionDive) {
        if dive.drawn.injected.len() < 2 {
            return;
        }
        let sets_by_noise: Vec<Vec<Right>> = (1..=NOISES).map(|noise| dive.with_noise(noise)).collect();
        let mut from = 0;
        for stretch in dive.stretches() {
            let of_stretch = from..from + stretch.sections.len();
            from = of_stretch.end;
            let sets = sets_by_noise.iter().flat_map(|by_noise| &by_noise[of_stretch.clone()]).flatten();
            let mut counts: BTreeMap<Vec<usize>, u32> = BTreeMap::new();
            for set in sets {
                *counts.entry(set.iter().map(|cause| *cause as usize).collect()).or_default() += 1;
            }
            let most = counts.into_iter().max_by_key(|(_, count)| *count).map(|(set, _)| set);
            let numbers = |set: &Vec<Cause>| set.iter().map(|cause| *cause as usize).collect::<Vec<_>>();
            let is_right = most.is_some_and(|most| stretch.right.iter().any(|set| numbers(set) == most));
            self.stretches.add(is_right);
            if stretch.right.iter().all(|set| set.len() > 1) {
                self.pairs.add(is_right);
            }
        }
    }

    /// Returns the sum of both results, count by count.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self { stretches: self.stretches.and(other.stretches), pairs: self.pairs.and(other.pairs) }
    }
}

impl InterventionDive {
    /// Sets of causes that count as right for each section, from simulations with the noise number `noise`.
    fn with_noise(&self, noise: u64) -> Vec<Right> {
        let drawn = self.drawn.with_noise(noise);
        let without = [0, 1].map(|k| report(&drawn, &|other| other != k));
        let right_of = |start_m: f64| {
            let alone = without.iter().map(|report| hole_at_m(report, start_m) <= drawn.target_m);
            right(&drawn, &alone.collect::<Vec<_>>(), true).unwrap_or_default()
        };
        self.sections.iter().map(|section| right_of(section.ends_m[0])).collect()
    }
}
