//! Why a section failed, from what was measured while it was passed.

use super::hole::Hole;
use super::sections::Section;
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
    /// Largest speed that would have met the target with the pass gap measured, m/s; zero where none.
    pub v_max_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes had they been spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// Share of pings without a return, beyond range or not.
    pub missing_share: f64,
    /// Largest distance between neighbours of one turn that geometry gives, m.
    pub t_y_m: f64,
}

/// Names the cause of a fail.
///
/// The order is that of certainty: what was never passed needs no other explanation; what could not be placed or did
/// not return is explained by that when the rest would have met the target; then what slower driving can't mend, then
/// phase, and last speed.
pub fn explain(section: &Section, hole: &Hole, swept: Option<Reach>, target_m: f64) -> Evidence {
    let passage = &section.passage;
    let mean = |sum: f64| if passage.pings == 0 { 0.0 } else { sum / f64::from(passage.pings) };
    let share = |count: u32| mean(f64::from(count));
    let (speed_mps, pass_gap_s) = (mean(passage.speed_sum_mps), mean(passage.pass_gap_sum_s));
    let (even_pass_gap_s, ping_s) = (mean(passage.even_gap_sum_s), mean(passage.ping_period_sum_s));
    let t_y_m = passage.t_y_m;
    let t_at = |gap_s: f64| spacing::t_max_m(speed_mps * gap_s, speed_mps * ping_s, t_y_m);
    let radius_m = hole.diameter_m / 2.0;
    let beyond = |swept: Reach| hole.x_m - radius_m < swept.from_m || hole.x_m + radius_m > swept.to_m;
    let missing_share = share(passage.missing + passage.out_of_range);
    let as_driven_meets = t_at(pass_gap_s) <= target_m;

    let cause = if passage.pings == 0 || swept.is_none_or(beyond) {
        Cause::NotPassed
    } else if share(passage.unplaced) > 0.02 && as_driven_meets {
        Cause::PositionLost
    } else if passage.out_of_range > passage.missing && as_driven_meets {
        Cause::OutOfRange
    } else if missing_share > 0.0 && as_driven_meets {
        Cause::MissingReturns
    } else if t_y_m >= target_m {
        Cause::AngularStep
    } else if !as_driven_meets && t_at(even_pass_gap_s) <= target_m {
        Cause::Phase
    } else {
        Cause::TooFast
    };
    let v_max_mps = spacing::speed_for_target_mps(target_m, t_y_m, pass_gap_s, ping_s).unwrap_or(0.0);
    Evidence { cause, speed_mps, v_max_mps, pass_gap_s, even_pass_gap_s, missing_share, t_y_m }
}
