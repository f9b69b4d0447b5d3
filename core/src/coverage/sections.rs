//! Sections of the tunnel: what was measured in each, its hole, its verdict, and its flag.

use core::ops::Range;

use super::cause::{Evidence, explain};
use super::frontier::{Frontier, Moved, Reach};
use super::hole::{FARTHEST_M, Hole, HoleFinder};
use super::store::{SampleIndex, SampleStore};
use crate::frames::Vec3;
use crate::fusion::relative::Relative;
use crate::math;
use crate::time::MonoNs;
use crate::tunnel::Profile;

/// What is said of a section. Source: metrics.md, "Sections and verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Verdict {
    /// Samples may still come without turning back.
    #[default]
    Open,
    /// D + 2 sigma_D <= T.
    Pass,
    /// D - 2 sigma_D > T.
    Fail,
    /// Neither can be said for sure.
    CannotSay,
}

impl Verdict {
    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::CannotSay => "cannot_say",
        }
    }
}

/// Count, mean and extremes of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Values.
    pub count: u32,
    /// Their sum.
    pub sum: f64,
    /// The sum of their squares.
    pub sum_of_squares: f64,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { count: 0, sum: 0.0, sum_of_squares: 0.0, min: f64::INFINITY, max: f64::NEG_INFINITY }
    }
}

impl Spread {
    /// Takes a value in.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        self.sum += value;
        self.sum_of_squares += value * value;
        self.min = self.min.min(value);
        self.max = self.max.max(value);
    }

    /// Takes in all that another has seen.
    pub fn merge(&mut self, other: &Self) {
        self.count += other.count;
        self.sum += other.sum;
        self.sum_of_squares += other.sum_of_squares;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Mean; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }

    /// Standard deviation of the values themselves; `None` without values.
    pub fn sd(&self) -> Option<f64> {
        let mean = self.mean()?;
        Some(math::sqrt((self.sum_of_squares / f64::from(self.count) - mean * mean).max(0.0)))
    }
}

/// What the pings made within a section say of how it was passed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Passage {
    /// All pings, whatever came of them.
    pub pings: u32,
    /// Pings made where the vehicle's place was known.
    pub placed: u32,
    /// Pings without a return where the wall was within range, or its place not known.
    pub missing: u32,
    /// Pings without a return where the wall was farther than the range setting.
    pub out_of_range: u32,
    /// Returns that could not be placed.
    pub unplaced: u32,
    /// Sum of the speeds at the pings, m/s.
    pub speed_sum_mps: f64,
    /// Sum of the times between passes, seconds.
    pub pass_gap_sum_s: f64,
    /// Sum of what those times would have been, spread evenly, seconds.
    pub even_gap_sum_s: f64,
    /// Sum of the times between pings, seconds.
    pub ping_period_sum_s: f64,
    /// The largest T_y that geometry predicted, m.
    pub t_y_m: f64,
    /// How far one pass may be off against another.
    pub doubt: Doubt,
}

/// The largest hole of a section is looked for where errors have made it large: so much more is it off than the distance of
/// two passes at one place. Measured over the field dives of `tests/fusion.rs`.
const LARGEST_OF_MANY: f64 = 1.2;

/// How far the samples of a pass may be off along the tunnel against those of the pass before.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Doubt {
    /// The errors that move them.
    pub relative: Relative,
    /// Where the vehicle was in the cross-section, m.
    pub from_m: [f64; 2],
}

impl Doubt {
    /// Keeps the larger of the two.
    pub fn add(&mut self, other: &Self) {
        if other.relative.sigma_m(Vec3::zero()) >= self.relative.sigma_m(Vec3::zero()) {
            *self = *other;
        }
    }

    /// Standard deviation of the diameter of a hole there on the wall, m: one edge of it is a pass, the other edge the next.
    pub fn sigma_m(&self, wall_m: [f64; 2]) -> f64 {
        LARGEST_OF_MANY
            * self.relative.sigma_m(Vec3::new(0.0, wall_m[0] - self.from_m[0], wall_m[1] - self.from_m[1]))
    }
}

/// One section.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Section {
    /// The verdict so far.
    pub verdict: Verdict,
    /// The hole as last measured.
    pub hole: Option<Hole>,
    /// Standard deviation of the hole's diameter, m.
    pub hole_sigma_m: f64,
    /// Whether no later sample on the way forward can change the verdict, nor the hole of a fail.
    pub settled: bool,
    /// When the fail was flagged.
    pub flagged: Option<MonoNs>,
    /// When a later pass filled the hole.
    pub cleared: Option<MonoNs>,
    /// Why it failed.
    pub evidence: Option<Evidence>,
    /// How it was passed.
    pub passage: Passage,
    /// T_x of its samples, m.
    pub t_x_m: Spread,
    /// T_y of its samples, m.
    pub t_y_m: Spread,
    /// T of its samples, m.
    pub t_m: Spread,
    /// Samples on its wall.
    pub samples: u32,
    /// Samples have come within the target of it since it was last judged.
    stale: bool,
}

/// Asks for a section to be judged as of a moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// Index of the section, from chainage zero.
    pub section: i64,
    /// The samples that count.
    pub as_of: SampleIndex,
    /// The moment.
    pub at: MonoNs,
    /// The stretch that every head had swept by then.
    pub swept_by_all: Option<Reach>,
    /// Whether the section's surroundings are complete.
    pub settles: bool,
}

/// What judging a section has changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Judgement {
    /// The verdict or the hole has a new value.
    Updated,
    /// A flag was raised.
    Raised,
    /// A flag was cleared.
    Cleared,
}

/// All sections of the stretch of tunnel that the store covers.
#[derive(Debug, Clone)]
pub struct Sections {
    section_m: f64,
    target_m: f64,
    first: i64,
    sections: Vec<Section>,
}

impl Sections {
    /// Sections of `section_m` over [`from_m`, `to_m`].
    ///
    /// Allocates: startup only; all that it will ever use.
    pub fn new(section_m: f64, target_m: f64, from_m: f64, to_m: f64) -> Self {
        let first = math::floor_to_i64(from_m / section_m);
        let end = -math::floor_to_i64(-to_m / section_m);
        let count = usize::try_from(end - first).unwrap_or(0);
        Self { section_m, target_m, first, sections: vec![Section::default(); count] }
    }

    /// How many sections there are.
    pub fn len(&self) -> usize {
        self.sections.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.sections.is_empty()
    }

    /// Length of a section, m.
    pub fn section_m(&self) -> f64 {
        self.section_m
    }

    /// Target T, m.
    pub fn target_m(&self) -> f64 {
        self.target_m
    }

    /// How far from a sample it may change a verdict of pass or fail, m.
    pub fn margin_m(&self, relative_sigma_m: f64) -> f64 {
        self.target_m / 2.0 + relative_sigma_m
    }

    /// Index of the section at a chainage.
    pub fn index_of(&self, x_m: f64) -> i64 {
        math::floor_to_i64(x_m / self.section_m)
    }

    /// Chainages at which a section begins and ends, m.
    pub fn bounds_m(&self, index: i64) -> (f64, f64) {
        (index as f64 * self.section_m, (index + 1) as f64 * self.section_m)
    }

    /// A section by its index from chainage zero.
    pub fn get(&self, index: i64) -> Option<&Section> {
        self.sections.get(usize::try_from(index - self.first).ok()?)
    }

    /// The same, to be changed.
    pub fn get_mut(&mut self, index: i64) -> Option<&mut Section> {
        self.sections.get_mut(usize::try_from(index - self.first).ok()?)
    }

    /// Notes that a sample fell at `x_m`: every section within the target of it is open to judgement again.
    pub fn touch(&mut self, x_m: f64) {
        let (from, to) = (self.index_of(x_m - self.target_m), self.index_of(x_m + self.target_m));
        for index in from..=to {
            if let Some(section) = self.get_mut(index) {
                section.stale = true;
            }
        }
    }

    /// Calls `ask` for every section that is to be judged after the heads have moved: those that were left, and failed
    /// ones whose hole is now wholly behind or ahead.
    ///
    /// Allocates: never.
    pub fn due(
        &mut self,
        moved: &Moved,
        frontier: &Frontier,
        as_of: SampleIndex,
        at: MonoNs,
        ask: &mut impl FnMut(Request),
    ) {
        if moved.left_behind.is_empty() && moved.left_ahead.is_empty() {
            return;
        }
        let Some(reach) = moved.reach else { return };
        let passed = self.passed(frontier.swept());
        let swept_by_all = frontier.swept_by_all(at);
        let ask_for = |section, settles| Request { section, as_of, at, swept_by_all, settles };
        for range in [&moved.left_behind, &moved.left_ahead] {
            for index in clamp(range.clone(), &passed) {
                let Some(section) = self.get_mut(index) else { continue };
                if section.stale || section.hole.is_none() {
                    section.stale = false;
                    section.settled = false;
                    ask(ask_for(index, false));
                }
            }
        }
        let far = math::floor_to_i64(FARTHEST_M / self.section_m) + 1;
        let behind = moved.left_behind.end - far..moved.left_behind.end;
        let ahead = moved.left_ahead.start..moved.left_ahead.start + far;
        for range in [behind, ahead] {
            for index in clamp(range, &passed) {
                let (from_m, to_m) = self.bounds_m(index);
                let Some(section) = self.get_mut(index) else { continue };
                let Some(hole) = section.hole.filter(|_| !section.settled) else { continue };
                let radius_m = hole.diameter_m / 2.0;
                if to_m + radius_m <= reach.from_m || from_m - radius_m >= reach.to_m {
                    section.settled = true;
                    ask(ask_for(index, true));
                }
            }
        }
    }

    /// Measures a section's hole and says what it means.
    ///
    /// Allocates: never.
    pub fn judge(
        &mut self,
        request: &Request,
        store: &SampleStore,
        finder: &mut HoleFinder,
        profile: &Profile,
    ) -> Option<Judgement> {
        let (from_m, to_m) = self.bounds_m(request.section);
        let target_m = self.target_m;
        let section = self.get_mut(request.section)?;
        let hole = finder.largest(store, from_m, to_m, request.as_of);
        let sigma_m = section.passage.doubt.sigma_m(profile.point_at(hole.sigma_m));
        section.hole = Some(hole);
        section.hole_sigma_m = sigma_m;
        section.verdict = verdict(&hole, sigma_m, target_m);
        // Of a hole no larger than the target, nothing can come nearer than its own edge.
        section.settled = request.settles || section.verdict == Verdict::Pass;
        let flagged = section.flagged.is_some() && section.cleared.is_none();
        if section.verdict == Verdict::Fail {
            let evidence = self.explain(&hole, request.swept_by_all);
            let section = self.get_mut(request.section)?;
            section.evidence = Some(evidence);
            if !flagged {
                section.flagged = Some(request.at);
                section.cleared = None;
                return Some(Judgement::Raised);
            }
        } else if flagged && section.verdict == Verdict::Pass {
            section.cleared = Some(request.at);
            return Some(Judgement::Cleared);
        }
        Some(Judgement::Updated)
    }

    /// The cause of a hole: that of the worst passage among the sections that it touches.
    fn explain(&self, hole: &Hole, swept_by_all: Option<Reach>) -> Evidence {
        let radius_m = hole.diameter_m / 2.0;
        let touched = self.index_of(hole.x_m - radius_m)..self.index_of(hole.x_m + radius_m) + 1;
        let passages = touched.filter_map(|index| self.get(index)).map(|section| &section.passage);
        explain(&passages, hole, swept_by_all, self.target_m)
    }

    /// Calls `ask` for every section that was passed and isn't settled, at the end of a dive.
    pub fn unsettled(
        &mut self,
        frontier: &Frontier,
        as_of: SampleIndex,
        at: MonoNs,
        ask: &mut impl FnMut(Request),
    ) {
        let swept_by_all = frontier.swept_by_all(at);
        for index in self.passed(frontier.swept()) {
            let Some(section) = self.get_mut(index) else { continue };
            // The hole of a fail may have been narrowed from farther away than a pass depends on.
            if section.stale || !section.settled || section.verdict != Verdict::Pass {
                section.stale = false;
                section.settled = true;
                ask(Request { section: index, as_of, at, swept_by_all, settles: true });
            }
        }
    }

    /// Indexes of the sections that a swept stretch touches and the table holds.
    pub fn passed(&self, swept: Option<Reach>) -> Range<i64> {
        let Some(reach) = swept else { return 0..0 };
        let end = self.first + i64::try_from(self.sections.len()).unwrap_or(i64::MAX);
        clamp(self.index_of(reach.from_m)..self.index_of(reach.to_m) + 1, &(self.first..end))
    }
}

/// `pass` when D + 2 sigma <= T, `fail` when D - 2 sigma > T, else `cannot_say`. Wall without samples around it fails.
fn verdict(hole: &Hole, sigma_m: f64, target_m: f64) -> Verdict {
    if !hole.bounded || hole.diameter_m - 2.0 * sigma_m > target_m {
        Verdict::Fail
    } else if hole.diameter_m + 2.0 * sigma_m <= target_m {
        Verdict::Pass
    } else {
        Verdict::CannotSay
    }
}

fn clamp(range: Range<i64>, within: &Range<i64>) -> Range<i64> {
    range.start.max(within.start)..range.end.min(within.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wall_without_samples_never_passes() {
        let hole = Hole { diameter_m: 2.0 * FARTHEST_M, x_m: 0.0, sigma_m: 0.0, bounded: false };
        assert_eq!(verdict(&hole, 0.0, 100.0), Verdict::Fail);
    }

    #[test]
    fn the_verdict_needs_two_standard_deviations() {
        let hole = |diameter_m| Hole { diameter_m, x_m: 0.0, sigma_m: 0.0, bounded: true };
        for (diameter_m, expected) in [
            (0.47, Verdict::Pass),
            (0.49, Verdict::CannotSay),
            (0.52, Verdict::CannotSay),
            (0.53, Verdict::Fail),
        ] {
            assert_eq!(verdict(&hole(diameter_m), 0.0125, 0.5), expected, "{diameter_m}");
        }
    }
}
