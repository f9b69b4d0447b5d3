//! One section: what was measured in it, its hole, its verdict, and its flag.

use super::cause::Evidence;
use super::deviation::Deviation;
use super::hole::Hole;
use super::passage::Passage;
use crate::math;
use crate::time::MonoNs;

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
    /// How far its wall is from the design.
    pub deviation: Deviation,
    /// Share of its wall that is a declared opening.
    pub masked_share: f64,
    /// Samples have come within the target of it since it was last judged.
    pub(super) stale: bool,
}


/// Fewer samples than this don't contradict a profile.
const FEW: u32 = 20;
/// More of a section than this is an opening: there is no wall to speak of.
const ALL_MASKED: f64 = 0.999;

impl Section {
    /// Whether it has a flag that no later pass has cleared.
    pub fn is_flagged(&self) -> bool {
        self.flagged.is_some() && self.cleared.is_none()
    }

    /// Whether its samples contradict the design profile, on which everything else is measured.
    pub fn contradicts(&self) -> bool {
        self.samples >= FEW && self.deviation.contradicts()
    }

    /// Whether a small hole says nothing: the profile is wrong, or there is no wall.
    pub(super) fn is_doubtful(&self) -> bool {
        self.contradicts() || self.masked_share > ALL_MASKED
    }

    /// Raises or clears its flag as its verdict demands.
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
