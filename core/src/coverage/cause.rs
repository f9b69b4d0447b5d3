//! Why a section failed, from what was measured while it was passed.

use super::hole::Hole;
use super::sections::Passage;
use crate::coverage::Reach;
use crate::sampling::spacing;

/// The one cause that a fail is put down to. Source: metrics.md, "Sections and verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// The distance between passes was too large at the speed driven.
    TooFast,
    /// The angle between pings alone leaves such holes; slower won't help.
    AngularStep,
    /// Returns that should have come did not.
    MissingReturns,
    /// The wall was farther than the heads' range setting.
    OutOfRange,
    /// The heads' passes were unevenly spread; evenly spread they would have met the target.
    Phase,
    /// Returns came but could not be placed.
    PositionLost,
    /// The hole reaches beyond the stretch that was passed.
    NotPassed,
}

impl Cause {
    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TooFast => "too_fast",
            Self::AngularStep => "angular_step",
            Self::MissingReturns => "missing_returns",
            Self::OutOfRange => "out_of_range",
            Self::Phase => "phase",
            Self::PositionLost => "position_lost",
            Self::NotPassed => "not_passed",
        }
    }
}

/// The figures behind a cause; means over the pings made within the section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// The cause.
    pub cause: Cause,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target with the heads evenly spread, m/s; zero where none.
    pub even_v_max_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes had they been spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// Share of pings without a return, beyond range or not.
    pub missing_share: f64,
    /// Largest distance between neighbours of one turn that geometry gives, m.
    pub t_y_m: f64,
}

/// Names the cause of a hole from the passages of the sections that it touches.
///
/// The order is that of certainty: returns that could not be placed explain a hole when the rest would have met the
/// target, and what was never passed needs no other explanation; then returns that did not come, likewise; then what slower driving can't mend, then
/// phase, and last speed. The figures are those of the passage that was driven worst.
pub fn explain<'a>(
    passages: &(impl Iterator<Item = &'a Passage> + Clone),
    hole: &Hole,
    swept_by_all: Option<Reach>,
    target_m: f64,
) -> Evidence {
    let worst = passages
        .clone()
        .filter(|passage| passage.placed > 0)
        .map(Driven::of)
        .max_by(|a, b| a.t_m(a.pass_gap_s).total_cmp(&b.t_m(b.pass_gap_s)))
        .unwrap_or_default();
    let count = |of: fn(&Passage) -> u32| passages.clone().map(of).fold(0, u32::saturating_add);
    let pings = count(|passage| passage.pings);
    let (missing, beyond) = (count(|passage| passage.missing), count(|passage| passage.out_of_range));
    let unplaced = count(|passage| passage.unplaced);
    let missing_share = f64::from(missing + beyond) / f64::from(pings.max(1));
    // What makes it a fail is an empty circle of the target's size; the hole may still shrink from ahead.
    let radius_m = hole.diameter_m.min(target_m) / 2.0;
    let passed = swept_by_all
        .is_some_and(|swept| hole.x_m - radius_m >= swept.from_m && hole.x_m + radius_m <= swept.to_m);
    let as_driven_meets = worst.t_m(worst.pass_gap_s) <= target_m;

    let cause = if as_driven_meets && unplaced > missing + beyond {
        Cause::PositionLost
    } else if pings == 0 || (beyond == 0 && (!passed || !hole.bounded)) {
        Cause::NotPassed
    } else if as_driven_meets && beyond > missing {
        Cause::OutOfRange
    } else if as_driven_meets && missing > 0 {
        Cause::MissingReturns
    } else if worst.t_y_m >= target_m {
        Cause::AngularStep
    } else if !as_driven_meets && worst.t_m(worst.even_pass_gap_s) <= target_m {
        Cause::Phase
    } else {
        Cause::TooFast
    };
    let even_v_max =
        spacing::speed_for_target_mps(target_m, worst.t_y_m, worst.even_pass_gap_s, worst.ping_period_s);
    Evidence {
        cause,
        speed_mps: worst.speed_mps,
        even_v_max_mps: even_v_max.unwrap_or(0.0),
        pass_gap_s: worst.pass_gap_s,
        even_pass_gap_s: worst.even_pass_gap_s,
        missing_share,
        t_y_m: worst.t_y_m,
    }
}

/// How a section was driven: means over its pings.
#[derive(Debug, Clone, Copy, Default)]
struct Driven {
    speed_mps: f64,
    pass_gap_s: f64,
    even_pass_gap_s: f64,
    ping_period_s: f64,
    t_y_m: f64,
}

impl Driven {
    fn of(passage: &Passage) -> Self {
        let mean = |sum: f64| sum / f64::from(passage.placed.max(1));
        Self {
            speed_mps: mean(passage.speed_sum_mps),
            pass_gap_s: mean(passage.pass_gap_sum_s),
            even_pass_gap_s: mean(passage.even_gap_sum_s),
            ping_period_s: mean(passage.ping_period_sum_s),
            t_y_m: passage.t_y_m,
        }
    }

    /// T_max at this speed with that time between passes.
    fn t_m(&self, pass_gap_s: f64) -> f64 {
        spacing::t_max_m(self.speed_mps * pass_gap_s, self.speed_mps * self.ping_period_s, self.t_y_m)
    }
}
