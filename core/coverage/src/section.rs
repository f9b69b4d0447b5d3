//! One section: what was measured in it, its hole, its verdict, and its flag.

use serde::{Deserialize, Serialize};

use super::deviation::Deviation;
use super::evidence::Evidence;
use super::hole::Hole;
use super::passage::{PassError, Passage};
use super::unsure::Unsure;
use super::visits::{Visit, Visits};
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_geometry::tunnel::Profile;

/// Coverage verdict of a section. Source: docs/why/coverage.md, "Verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Verdict {
    /// Undecided: samples may still land without the vehicle turning back, or not all heads have been there.
    #[default]
    Open,
    /// D + k sd <= T, k being the confidence.
    Pass,
    /// D - k sd > T.
    Fail,
    /// Neither holds within the error of D.
    CannotSay,
}

impl Verdict {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Open, Self::Pass, Self::Fail, Self::CannotSay];

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

/// Count, mean, deviation and extremes of a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Number of values.
    pub count: u32,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
    mean: f64,
    /// Sum of the squares of their distances from the mean.
    scatter: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, mean: 0.0, scatter: 0.0 }
    }
}

impl Spread {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.merge(&Self { count: 1, min: value, max: value, mean: value, scatter: 0.0 });
    }

    /// Merges another spread.
    ///
    /// Source: Chan, Golub, LeVeque 1983: sums of squares about the mean avoid the cancellation of plain ones.
    pub fn merge(&mut self, other: &Self) {
        if other.count == 0 {
            return;
        }
        let (a, b) = (f64::from(self.count), f64::from(other.count));
        let (off, share) = (other.mean - self.mean, b / (a + b));
        self.mean += off * share;
        self.scatter += other.scatter + off * off * a * share;
        self.count += other.count;
        self.min = self.min.min(other.min);
        self.max = self.max.max(other.max);
    }

    /// Mean; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean)
    }

    /// Standard deviation of the values themselves; `None` without values.
    pub fn sd(&self) -> Option<f64> {
        (self.count > 0).then(|| math::sqrt(self.scatter / f64::from(self.count)))
    }
}

/// Change made by judging a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Judgement {
    /// The verdict or the hole has a new value.
    Updated,
    /// A flag was raised.
    Raised,
    /// A flag was cleared.
    Cleared,
}

/// One section.
#[expect(clippy::struct_excessive_bools, reason = "they are independent of one another")]
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Section {
    /// The verdict so far.
    pub verdict: Verdict,
    /// The hole as last measured.
    pub hole: Option<Hole>,
    /// Standard deviation of the hole's diameter, m.
    pub hole_sd_m: f64,
    /// No further sample on the present course can change the verdict, nor the hole of a fail.
    pub settled: bool,
    /// Open, though no sample will change it without turning back: where the vehicle began, or turned back, not all heads have
    /// been.
    pub not_inspected: bool,
    /// When the fail was flagged.
    pub flagged: Option<MonoNs>,
    /// When a later pass filled the hole.
    pub cleared: Option<MonoNs>,
    /// Why it failed.
    pub evidence: Option<Evidence>,
    /// That was found when it was left in part only.
    pub(super) explained_in_part: bool,
    /// Ping statistics of its passage.
    pub passage: Passage,
    /// T_x of its samples, m.
    pub t_x_m: Spread,
    /// T_y of its samples, m.
    pub t_y_m: Spread,
    /// T of its samples, m.
    pub t_m: Spread,
    /// Samples on its wall.
    pub samples: u32,
    /// Deviation of its wall from the design profile.
    pub deviation: Deviation,
    /// Share of its wall that is a declared opening.
    pub masked_share: f64,
    /// Samples have landed within T of it since it was last judged.
    pub(super) stale: bool,
    /// Returns on its wall that weren't taken for wall.
    pub doubtful: u32,
    /// It holds samples of a head that wasn't believed soon after.
    pub suspect: bool,
    /// Number of the newest visit when that became known.
    suspected_in: u32,
    /// Visits with samples within T of it.
    pub(super) visits: Visits,
    /// Number of the visit whose passes' error is in `passage`.
    passed_in: u32,
}

/// Minimum samples for a section to contradict the profile.
const FEW: u32 = 20;
/// Masked share above which a section counts as having no wall.
const ALL_MASKED: f64 = 0.999;
/// Cross-section area over the design's that no tunnel of this design has: a tenth of the radius is 0.8 to 1.2.
const AREA_RATIO: core::ops::RangeInclusive<f64> = 0.6..=1.6;

impl Section {
    /// Whether it has a flag that no later pass has cleared.
    pub fn is_flagged(&self) -> bool {
        self.flagged.is_some() && self.cleared.is_none()
    }

    /// Whether its samples contradict the design profile, on which everything else is measured.
    pub fn contradicts(&self) -> bool {
        self.samples >= FEW && self.deviation.contradicts()
    }

    /// Notes a ping with a fix in the section: how far passes are off one another.
    pub fn note_pass(&mut self, visit: &Visit, profile: &Profile) {
        if self.passed_in != visit.number {
            self.visits.note_earlier(self.passage.pass_error.worst_m(profile));
            (self.passage.pass_error, self.passed_in) = (PassError::default(), visit.number);
        }
        let [pass, _] = visit.errors;
        self.passage.pass_error.add(&pass);
    }

    /// Whether there were visits before its newest one, which is free of what makes those doubtful.
    pub(super) fn is_visited_anew(&self) -> bool {
        self.visits.are_several() && !(self.suspect && self.visits.newest() <= self.suspected_in)
    }

    /// Dismisses the samples of all visits but the newest.
    pub(super) fn keep_newest_visit(&mut self) {
        self.visits.keep_newest();
        self.suspect = false;
    }

    /// Why a small hole is no evidence of coverage: what was taken for wall may be none, or samples may not lie beside one
    /// another; `None` where it is evidence.
    pub(super) fn doubt(&self) -> Option<Unsure> {
        let of_heads = self.suspect.then_some(Unsure::DistrustedHead);
        let of_places = self.visits.are_unrelated().then_some(Unsure::SeveralStretches);
        self.wall_doubt().or(of_heads).or(of_places)
    }

    /// Why most of what was taken for wall may be none.
    pub(super) fn wall_doubt(&self) -> Option<Unsure> {
        Some(match self {
            _ if self.contradicts() => Unsure::ContradictedProfile,
            _ if self.masked_share > ALL_MASKED => Unsure::NoWall,
            _ if self.doubtful > self.samples => Unsure::DoubtfulReturns,
            _ if self.is_of_another_size() => Unsure::OtherSize,
            _ => return None,
        })
    }

    /// Why neither a pass nor a fail can be told though nothing more will come; `None` elsewhere.
    pub fn unsure(&self) -> Option<Unsure> {
        match self.verdict {
            Verdict::Open if self.not_inspected => Some(Unsure::NotInspected),
            Verdict::CannotSay => Some(self.doubt().unwrap_or(Unsure::Position)),
            _ => None,
        }
    }

    /// Whether its cross-section can't be the design's.
    fn is_of_another_size(&self) -> bool {
        let ratio = self.deviation.area_ratio().filter(|_| self.samples >= FEW);
        ratio.is_some_and(|ratio| !AREA_RATIO.contains(&ratio))
    }

    /// Marks that it holds samples of a head that isn't believed any more: it can't pass, and is due for judging.
    pub fn suspect(&mut self) {
        (self.suspect, self.stale, self.settled) = (true, true, false);
        self.suspected_in = self.visits.newest();
    }

    /// Raises or clears its flag according to its verdict.
    pub(super) fn flag(&mut self, at: MonoNs) -> Judgement {
        match self.verdict {
            Verdict::Fail if !self.is_flagged() => {
                (self.flagged, self.cleared) = (Some(at), None);
                Judgement::Raised
            }
            Verdict::Pass if self.is_flagged() => {
                self.cleared = Some(at);
                Judgement::Cleared
            }
            _ => Judgement::Updated,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_flagged_from_its_flag_until_it_is_cleared() {
        let at = |seconds: u64| Some(MonoNs(seconds * 1_000_000_000));
        let flagged = |flagged, cleared| Section { flagged, cleared, ..Section::default() }.is_flagged();
        assert_eq!([flagged(None, None), flagged(at(3), None), flagged(at(3), at(9))], [false, true, false]);
    }

    #[test]
    fn a_flag_is_raised_by_a_fail_cleared_by_a_pass_and_raised_anew() {
        let mut section = Section::default();
        for (at, verdict, expected, is_flagged) in [
            (1, Verdict::Open, Judgement::Updated, false),
            (2, Verdict::Pass, Judgement::Updated, false),
            (3, Verdict::Fail, Judgement::Raised, true),
            (4, Verdict::Fail, Judgement::Updated, true),
            (5, Verdict::CannotSay, Judgement::Updated, true),
            (6, Verdict::Pass, Judgement::Cleared, false),
            (7, Verdict::Pass, Judgement::Updated, false),
            (8, Verdict::Fail, Judgement::Raised, true),
        ] {
            section.verdict = verdict;
            assert_eq!((section.flag(MonoNs(at)), section.is_flagged()), (expected, is_flagged), "at {at}");
            let since = section.flagged.map(|at| at.0);
            assert_eq!(
                since,
                if at < 3 {
                    None
                } else if at < 8 {
                    Some(3)
                } else {
                    Some(8)
                }
            );
        }
    }

    #[test]
    fn a_spread_keeps_its_digits_far_from_zero_and_whatever_is_merged() {
        let values = [1e8 + 1.0, 1e8 + 2.0, 1e8 + 4.0, 1e8 + 9.0];
        let (mut whole, mut first, mut second) = (Spread::default(), Spread::default(), Spread::default());
        for (k, value) in values.into_iter().enumerate() {
            whole.add(value);
            if k < 3 { first.add(value) } else { second.add(value) }
        }
        first.merge(&second);
        for spread in [whole, first] {
            assert!((spread.mean().unwrap() - 1e8 - 4.0).abs() < 1e-7);
            assert!((spread.sd().unwrap() - 9.5_f64.sqrt()).abs() < 1e-7, "{:?}", spread.sd());
        }
        assert_eq!((Spread::default().mean(), Spread::default().sd()), (None, None));
    }

    /// What isn't judged yet is unsure at an end of the way alone.
    #[test]
    fn an_open_section_is_unsure_at_an_end_of_the_way_alone() {
        let unsure = |not_inspected| Section { not_inspected, ..Section::default() }.unsure();
        assert_eq!([unsure(true), unsure(false)], [Some(Unsure::NotInspected), None]);
    }
}
