//! One section with its statistics, hole, verdict and flag. Also the lengths of tunnel by verdict.

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
use headrace_sampling::Target;

/// Coverage verdict on a section. Source: docs/why/coverage.md, "Verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Verdict {
    /// Undecided. More samples may land if the vehicle does not turn back, or some heads have not been in the section.
    #[default]
    Open,
    /// Pass: D + k sd <= T, with hole diameter D, its standard deviation sd, target T and confidence k.
    Pass,
    /// Fail: D - k sd > T, with the symbols of [`Verdict::Pass`].
    Fail,
    /// Can't say: the section neither passes nor fails, although no more samples will land.
    CannotSay,
}

impl Verdict {
    /// All verdicts, in order.
    pub const ALL: [Self; 4] = [Self::Open, Self::Pass, Self::Fail, Self::CannotSay];

    /// Word used for the verdict in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::CannotSay => "cannot_say",
        }
    }
}

/// Count, mean, standard deviation and extremes of a quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Number of values in the statistics.
    pub count: u32,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    mean: f64,
    /// Sum of the squared differences from the mean.
    scatter: f64,
}

impl Default for Spread {
    fn default() -> Self {
        Self { count: 0, min: f64::INFINITY, max: f64::NEG_INFINITY, mean: 0.0, scatter: 0.0 }
    }
}

impl Spread {
    /// Adds a value to the statistics.
    pub fn add(&mut self, value: f64) {
        self.merge(&Self { count: 1, min: value, max: value, mean: value, scatter: 0.0 });
    }

    /// Adds all values of another spread.
    ///
    /// Sums of squares about the mean avoid the cancellation of plain sums of squares. Source: Chan, Golub, LeVeque
    /// 1983.
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
        debug_assert!(self.scatter >= 0.0 && self.min <= self.max, "squares have a sum: {self:?}");
    }

    /// Mean of the values; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        (self.count > 0).then_some(self.mean)
    }

    /// Standard deviation of the values (not of their mean); `None` without values.
    pub fn sd(&self) -> Option<f64> {
        (self.count > 0).then(|| math::sqrt(self.scatter / f64::from(self.count)))
    }
}

/// Change made by judging a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Judgement {
    /// The section's verdict or hole has a new value.
    Updated,
    /// The section was flagged as missed.
    Raised,
    /// The section's flag was cleared.
    Cleared,
}

impl Judgement {
    /// All changes that judging can make.
    pub const ALL: [Self; 3] = [Self::Updated, Self::Raised, Self::Cleared];
}

/// One section of the tunnel.
#[expect(clippy::struct_excessive_bools, reason = "the flags are independent of one another")]
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Section {
    /// Current verdict on the section.
    pub verdict: Verdict,
    /// Largest hole of the section as last measured.
    pub hole: Option<Hole>,
    /// Standard deviation of the hole's diameter, m.
    pub hole_sd_m: f64,
    /// Whether the verdict is final unless the vehicle turns back. More samples can then change neither the verdict nor
    /// a failed section's hole.
    pub settled: bool,
    /// Whether the section is open, and stays open unless the vehicle turns back.
    ///
    /// The vehicle began or turned back here, so some heads have not been in the section.
    pub not_inspected: bool,
    /// Time at which the fail was flagged.
    pub flagged: Option<MonoNs>,
    /// Time at which a later pass filled the hole of the flagged section.
    pub cleared: Option<MonoNs>,
    /// Evidence for the causes of the fail.
    pub evidence: Option<Evidence>,
    /// Whether the causes were determined before the heads had passed all of the section.
    pub(super) explained_in_part: bool,
    /// Ping statistics of the passage through the section.
    pub passage: Passage,
    /// T_x of the section's samples: distance between passes, m.
    pub t_x_m: Spread,
    /// T_y of the section's samples: distance between neighbouring samples of one sweep, m.
    pub t_y_m: Spread,
    /// Diagonal T of the lattice formed by the section's samples, from T_x and T_y, m.
    pub t_m: Spread,
    /// Number of samples on the section's wall.
    pub samples: u32,
    /// Deviation of the section's wall from the design profile.
    pub deviation: Deviation,
    /// Share of the section's wall that is a declared opening.
    pub masked_share: f64,
    /// Whether the section must be judged again. Since the last judgement, a sample has landed within the target T of
    /// it, or the section has become suspect.
    pub(super) stale: bool,
    /// Number of returns on the section's wall that were not accepted as wall.
    pub doubtful: u32,
    /// Whether the section's doubtful returns, if they were wall, would fill every hole over the target.
    pub(super) filled_by_doubtful: bool,
    /// Whether the section has samples of a head that became distrusted soon after.
    pub suspect: bool,
    /// Number of the vehicle's newest visit when a head with samples in the section became distrusted.
    suspected_in: u32,
    /// Visits of the vehicle with samples within the target T of the section.
    pub(super) visits: Visits,
    /// Number of the visit to which the pass error in `passage` belongs.
    passed_in: u32,
}

/// Minimum number of samples with which a section can contradict the profile.
const FEW: u32 = 20;
/// Share of the wall covered by openings above which the section counts as having no wall.
const ALL_MASKED: f64 = 0.999;
/// Plausible ratios of the measured cross-section area to the design's area. With another ratio, the section cannot
/// pass.
///
/// A wall that deviates by a tenth of the radius has a ratio between 0.8 and 1.2.
const AREA_RATIO: core::ops::RangeInclusive<f64> = 0.6..=1.6;

impl Section {
    /// Whether the section has a flag that no later pass has cleared.
    pub fn is_flagged(&self) -> bool {
        self.flagged.is_some() && self.cleared.is_none()
    }

    /// Whether verdict, hole, flag and evidence of a section agree just after it was judged.
    ///
    /// A pass needs a hole diameter D with D + k sd <= T. A fail needs evidence and a flag. Only open sections are
    /// `not_inspected`.
    pub(super) fn is_consistent(&self, target: Target) -> bool {
        let error_m = target.error_m(self.hole_sd_m);
        let is_judged = self.hole.is_some_and(|hole| hole.is_consistent()) && error_m >= 0.0;
        let is_small = |hole: Hole| hole.bounded && hole.most_m + error_m <= target.max_hole_m;
        is_judged
            && match self.verdict {
                Verdict::Pass => self.settled && !self.is_flagged() && self.hole.is_some_and(is_small),
                Verdict::Fail => self.evidence.is_some() && self.is_flagged(),
                Verdict::Open | Verdict::CannotSay => true,
            }
            && (self.verdict == Verdict::Open || !self.not_inspected)
    }

    /// Whether the section's samples contradict the design profile, on which all other measurements rely.
    pub fn contradicts(&self) -> bool {
        self.samples >= FEW && self.deviation.contradicts()
    }

    /// Whether the section can't pass because its samples or its area contradict the design profile.
    pub fn is_of_another_wall(&self) -> bool {
        matches!(self.wall_doubt(), Some(Unsure::ContradictedProfile | Unsure::OtherSize))
    }

    /// Records the position error between two passes, for a ping with a fix in the section.
    pub fn note_pass(&mut self, visit: &Visit, profile: &Profile) {
        if self.passed_in != visit.number {
            self.visits.note_earlier(self.passage.pass_error.worst_m(profile));
            (self.passage.pass_error, self.passed_in) = (PassError::default(), visit.number);
        }
        let [pass, _] = visit.errors;
        self.passage.pass_error.add(&pass);
    }

    /// Whether the section had earlier visits, and its newest visit contains no samples of a head distrusted since.
    pub(super) fn is_visited_anew(&self) -> bool {
        self.visits.are_several() && !(self.suspect && self.visits.newest() <= self.suspected_in)
    }

    /// Keeps only the samples of the newest visit to the section, and discards those of all others.
    pub(super) fn keep_newest_visit(&mut self) {
        self.visits.keep_newest();
        self.suspect = false;
    }

    /// Returns the reason why even a small hole does not prove coverage; `None` if it does.
    ///
    /// The returns accepted as wall may come from something else. Or the positions of the samples relative to each
    /// other may be uncertain.
    pub(super) fn doubt(&self) -> Option<Unsure> {
        let of_heads = self.suspect.then_some(Unsure::DistrustedHead);
        let of_places = self.visits.are_unrelated().then_some(Unsure::SeveralStretches);
        let of_returns = self.filled_by_doubtful.then_some(Unsure::DoubtfulReturns);
        self.wall_doubt().or(of_returns).or(of_heads).or(of_places)
    }

    /// Returns the reason why most returns accepted as wall may come from something else; `None` if there is none.
    pub(super) fn wall_doubt(&self) -> Option<Unsure> {
        Some(match self {
            _ if self.contradicts() => Unsure::ContradictedProfile,
            _ if self.masked_share > ALL_MASKED => Unsure::NoWall,
            _ if self.doubtful > self.samples => Unsure::DoubtfulReturns,
            _ if self.is_of_another_size() => Unsure::OtherSize,
            _ => return None,
        })
    }

    /// Returns the reason why the section neither passes nor fails although no more samples will come.
    ///
    /// `None` if it passes or fails, or if samples may still come.
    pub fn unsure(&self) -> Option<Unsure> {
        match self.verdict {
            Verdict::Open if self.not_inspected => Some(Unsure::NotInspected),
            Verdict::CannotSay => Some(self.doubt().unwrap_or(Unsure::Position)),
            _ => None,
        }
    }

    /// Whether the section's cross-section area is implausible for the design.
    fn is_of_another_size(&self) -> bool {
        let ratio = self.deviation.area_ratio().filter(|_| self.samples >= FEW);
        ratio.is_some_and(|ratio| !AREA_RATIO.contains(&ratio))
    }

    /// Records that the section has samples of a distrusted head.
    ///
    /// Then it cannot pass, and is due for judging. Returns false if its newest visit was already recorded as suspect.
    pub fn suspect(&mut self) -> bool {
        let is_new = !self.suspect || self.suspected_in != self.visits.newest();
        if is_new {
            (self.suspect, self.stale, self.settled) = (true, true, false);
            self.suspected_in = self.visits.newest();
        }
        is_new
    }

    /// Raises or clears the section's flag according to the verdict.
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

/// Length of tunnel by verdict, m. Each metre counts for only one verdict.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Metres {
    /// Length of the sections that passed.
    pub pass_m: f64,
    /// Length of the sections that failed.
    pub fail_m: f64,
    /// Length of the sections that neither pass nor fail, although no more samples will land.
    pub cannot_say_m: f64,
    /// Length of the sections that are still open, because driving on may fill their holes.
    pub open_m: f64,
    /// Length of the sections at the ends of the coverage extent where some heads have not been.
    ///
    /// Driving on does not change this length.
    pub not_inspected_m: f64,
}

impl Metres {
    /// Total length over all verdicts, m.
    pub fn way_m(&self) -> f64 {
        self.pass_m + self.fail_m + self.cannot_say_m + self.open_m + self.not_inspected_m
    }

    /// Adds a length of tunnel that has this verdict.
    pub fn add(&mut self, verdict: Verdict, metres_m: f64) {
        *match verdict {
            Verdict::Pass => &mut self.pass_m,
            Verdict::Fail => &mut self.fail_m,
            Verdict::CannotSay => &mut self.cannot_say_m,
            Verdict::Open => &mut self.open_m,
        } += metres_m;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn section_is_flagged_until_the_flag_is_cleared() {
        let at = |seconds: u64| Some(MonoNs(seconds * 1_000_000_000));
        let flagged = |flagged, cleared| Section { flagged, cleared, ..Section::default() }.is_flagged();
        assert_eq!([flagged(None, None), flagged(at(3), None), flagged(at(3), at(9))], [false, true, false]);
    }

    #[test]
    fn flag_is_raised_by_a_fail_cleared_by_a_pass_and_raised_by_the_next_fail() {
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
    fn mean_and_sd_are_accurate_far_from_zero_and_after_merging() {
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

    /// An open section is unsure only if it is at an end of the coverage extent.
    #[test]
    fn open_section_is_unsure_only_at_an_end_of_the_coverage_extent() {
        let unsure = |not_inspected| Section { not_inspected, ..Section::default() }.unsure();
        assert_eq!([unsure(true), unsure(false)], [Some(Unsure::NotInspected), None]);
    }
}
