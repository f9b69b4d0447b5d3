//! Position gaps: stretches of the dive in which the heads pinged, but the vehicle had no position.
//!
//! The heads' returns in a gap have no place on the wall, so the coverage extent excludes the gap. The list tells how
//! long each gap lasted and where the vehicle probably was.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::passes::Situation;

/// Maximum number of listed gaps. Beyond it, the two oldest gaps become one.
const MOST_GAPS: usize = 32;
/// Duration of the shortest listed gap. The alignment of the filter takes a second at the start of a dive.
const SHORTEST: DurNs = DurNs(5_000_000_000);
/// Number of latest advice updates, two minutes, over which the speed is averaged to predict the end of a gap.
///
/// The last fixes before a gap often come from the inertial unit alone, so their speed is uncertain.
const AVERAGED: u32 = 600;

/// A stretch of the dive without a position.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PositionGap {
    /// First and last advice update without a position.
    pub span: [MonoNs; 2],
    /// Number of pings without a position.
    pub pings: u64,
    /// Chainage of the last fix before the gap, m; `None` if there was none.
    pub from_m: Option<f64>,
    /// Chainage at the end of the gap, m; `None` if it can't be predicted.
    ///
    /// After the gap this is the first fix. Until then it is predicted from the mean speed before the gap.
    pub to_m: Option<f64>,
    /// Whether a fix has ended the gap, so that `to_m` is measured.
    pub is_over: bool,
}

/// The last fix: its time and chainage, the mean speed until then, and the number of updates in this mean.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct LastFix {
    at: MonoNs,
    x_m: f64,
    mean_mps: f64,
    updates: u32,
}

/// Position gaps of the dive, in order.
#[derive(Debug, Resource)]
pub struct PositionGaps {
    gaps: Vec<PositionGap>,
    last: Option<LastFix>,
    /// Number of pings without a position until the last update.
    pings: u64,
}

stateful!(PositionGaps { state: last, pings; lists: gaps; });

impl PositionGaps {
    /// Creates an empty list. Allocates: all memory of the list.
    pub(super) fn with_room() -> Self {
        Self { gaps: Vec::with_capacity(MOST_GAPS), last: None, pings: 0 }
    }

    /// Position gaps of at least five seconds, in order.
    pub fn iter(&self) -> impl Iterator<Item = &PositionGap> {
        self.gaps.iter().filter(|gap| gap.is_listed())
    }

    /// Notes an advice update. `pings` is the number of pings without a position so far.
    pub(super) fn note(&mut self, at: MonoNs, situation: &Situation, pings: u64) {
        debug_assert!(pings >= self.pings, "counts only grow: {pings} after {}", self.pings);
        let new = pings - self.pings;
        self.pings = pings;
        match situation.pose {
            Some(pose) => self.end(at, pose.position.x(), situation.speed_mps),
            None if new > 0 => self.extend(at, new),
            None => {}
        }
    }

    fn end(&mut self, at: MonoNs, x_m: f64, speed_mps: f64) {
        let (mean_mps, before) = self.last.map_or((0.0, 0), |last| (last.mean_mps, last.updates));
        let updates = (before + 1).min(AVERAGED);
        let mean_mps = mean_mps + (speed_mps - mean_mps) / f64::from(updates);
        self.last = Some(LastFix { at, x_m, mean_mps, updates });
        if let Some(gap) = self.gaps.pop_if(|gap| !gap.is_over)
            && gap.is_listed()
        {
            self.gaps.push(PositionGap { to_m: Some(x_m), is_over: true, ..gap });
        }
    }

    fn extend(&mut self, at: MonoNs, new: u64) {
        if self.gaps.last().is_none_or(|gap| gap.is_over) {
            self.join_oldest_if_full();
            let from_m = self.last.map(|last| last.x_m);
            self.gaps.push(PositionGap { span: [at; 2], pings: 0, from_m, to_m: None, is_over: false });
        }
        let Some(gap) = self.gaps.last_mut() else { return };
        gap.span[1] = at;
        gap.pings += new;
        gap.to_m = self.last.map(|last| last.x_m + last.mean_mps * at.since(last.at).as_secs_f64());
    }

    /// Makes room for a gap. The latest gaps are kept apart, because the pilot may have to go back there.
    fn join_oldest_if_full(&mut self) {
        if self.gaps.len() < MOST_GAPS {
            return;
        }
        let oldest = self.gaps.remove(0);
        if let Some(next) = self.gaps.first_mut() {
            next.span[0] = oldest.span[0];
            next.pings += oldest.pings;
            next.from_m = oldest.from_m;
        }
    }
}

impl PositionGap {
    /// Time between the first and the last advice update without a position.
    pub fn duration(&self) -> DurNs {
        let [from, to] = self.span;
        to.since(from)
    }

    fn is_listed(&self) -> bool {
        self.duration().0 >= SHORTEST.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::situation;

    fn at(seconds: f64) -> MonoNs {
        MonoNs(0) + DurNs::from_secs_f64(seconds)
    }

    /// Gaps after updates five times a second with ten pings each. `x_m` gives the chainage of the fix, if there is one.
    fn gaps(updates: u32, x_m: impl Fn(f64) -> Option<f64>) -> Vec<PositionGap> {
        let (mut gaps, mut pings) = (PositionGaps::with_room(), 0);
        for update in 0..updates {
            let seconds = 0.2 * f64::from(update);
            let here = Situation { speed_mps: 0.1, ..situation(x_m(seconds)) };
            pings += if here.pose.is_none() { 10 } else { 0 };
            gaps.note(at(seconds), &here, pings);
        }
        gaps.iter().copied().collect()
    }

    /// The vehicle drives at 0.1 m/s from chainage 5 m and has no position from 20 to 60 s.
    #[test]
    fn gap_ends_at_the_predicted_chainage_until_a_fix_measures_it() {
        let is_lost = |seconds: f64| (20.0..60.0).contains(&seconds);
        let found = |updates| gaps(updates, |s| (!is_lost(s)).then_some(5.0 + 0.1 * s));
        let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 0.05;
        let [open] = found(250)[..] else { panic!("one gap") };
        assert!(near(open.from_m, 7.0) && near(open.to_m, 10.0) && !open.is_over, "{open:?}");
        assert_eq!((open.span, open.pings), ([at(20.0), at(49.8)], 1500));
        let [over] = found(400)[..] else { panic!("one gap") };
        assert!(near(over.from_m, 7.0) && near(over.to_m, 11.0) && over.is_over, "{over:?}");
        assert_eq!((over.span, over.pings), ([at(20.0), at(59.8)], 2000));
    }

    #[test]
    fn short_gaps_and_times_without_pings_are_not_listed() {
        let short = |s: f64| (!(20.0..24.8).contains(&s)).then_some(5.0);
        assert_eq!(gaps(400, short), []);
        let mut silent = PositionGaps::with_room();
        (0..400_u32).for_each(|update| silent.note(at(0.2 * f64::from(update)), &situation(None), 7));
        assert_eq!(silent.iter().count(), 0, "{silent:?}");
    }

    #[test]
    fn gap_before_the_first_fix_has_no_chainages() {
        let first = gaps(100, |_| None);
        assert_eq!(first.iter().map(|gap| (gap.from_m, gap.to_m)).collect::<Vec<_>>(), [(None, None)]);
        let every_other = |s: f64| ((s / 6.0).floor() % 2.0 < 1.0).then_some(5.0);
        let many = gaps(3000, every_other);
        assert_eq!(many.len(), MOST_GAPS);
        let durations: Vec<_> = many.iter().map(|gap| gap.duration().as_secs_f64().round()).collect();
        assert!(
            durations[0] > 200.0 && durations[1..].iter().all(|s| (*s - 6.0).abs() < 0.1),
            "{durations:?}"
        );
        let pings: u64 = many.iter().map(|gap| gap.pings).sum();
        assert_eq!(pings, 15_000, "each ping is in a gap");
    }
}
