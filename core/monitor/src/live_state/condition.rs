//! Condition and lamp: the most important fact for the pilot, and the colour for it.

use serde::Serialize;

use super::speed_band::SpeedBand;
use super::state::{LiveState, PositionDoubt, PositionState};
use headrace_fusion::NoFix;
use headrace_geometry::time::DurNs;
use headrace_sampling::advice::Reason;

/// Ratio of the speed to v_max below which the speed is clearly below v_max.
const UNDER: f64 = 0.97;

/// Present condition. If several conditions hold, the first one in this list counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// No sensor has delivered data.
    NoData,
    /// No data has arrived for this duration.
    Old(DurNs),
    /// There is no position, for this reason.
    NoPosition(NoFix),
    /// No head is inside the tunnel, whose nearer end is at this chainage (m). The position itself is
    /// reliable.
    Outside(f64),
    /// No profiling head delivers readings.
    NoSonar,
    /// All wall that the heads see here has the verdict pass, and the position is reliable: any speed is
    /// fine.
    Passed,
    /// The vehicle is going back to this chainage (m) too fast for coverage. From there it will pass a missed
    /// stretch again.
    GoingBack(f64),
    /// No speed meets the target.
    NoSpeed,
    /// The speed is well over v_max.
    TooFast,
    /// The present turn misses the target although the speed is within v_max.
    TurnFails,
    /// Samples placed at present can't be judged, because the position is doubtful.
    CannotSay(PositionDoubt),
    /// The speed is slightly over v_max.
    Over,
    /// Position errors may make the present turn miss the target. At a speed nearer to v_max, the turn would meet the
    /// target.
    TurnUnsure,
    /// The speed is within v_max.
    Good,
}

/// Colour of the lamp that shows how serious a condition is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lamp {
    /// Green: the pilot can continue, all is well.
    Green,
    /// Amber: the pilot should take care.
    Amber,
    /// Red: the pilot must act now.
    Red,
}

impl Condition {
    /// Word used for the condition in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::NoData => "no_data",
            Self::Old(_) => "old",
            Self::NoPosition(_) => "no_position",
            Self::Outside(_) => "outside",
            Self::NoSonar => "no_sonar",
            Self::Passed => "passed",
            Self::GoingBack(_) => "going_back",
            Self::NoSpeed => "no_speed",
            Self::TooFast => "too_fast",
            Self::TurnFails => "turn_fails",
            Self::CannotSay(_) => "cannot_say",
            Self::Over => "over",
            Self::TurnUnsure => "turn_unsure",
            Self::Good => "good",
        }
    }

    /// Colour of the lamp for the condition.
    pub fn lamp(self) -> Lamp {
        match self {
            Self::Good | Self::Passed | Self::GoingBack(_) => Lamp::Green,
            Self::Over
            | Self::TurnFails
            | Self::TurnUnsure
            | Self::CannotSay(_)
            | Self::NoData
            | Self::Outside(_) => Lamp::Amber,
            Self::Old(_) | Self::NoPosition(_) | Self::NoSonar | Self::NoSpeed | Self::TooFast => Lamp::Red,
        }
    }
}

impl LiveState {
    /// Whether the pilot is advised to stay stationary for the gyros' bias, rather than to keep a speed.
    pub fn asks_to_stand(&self) -> bool {
        self.condition() == Condition::CannotSay(PositionDoubt::Spread) && self.stand_s > 0
    }

    /// Whether the sample spacing T forecast for the present speed is unbounded or exceeds the limit, m.
    fn turn_exceeds(&self, limit_m: f64) -> bool {
        self.advice.and_then(|advice| advice.predicted_t_m).is_none_or(|t_m| t_m > limit_m)
    }

    /// Present condition. Conditions declared first in [`Condition`] take precedence.
    pub fn condition(&self) -> Condition {
        let Some(age) = self.age() else { return Condition::NoData };
        if self.is_old() {
            return Condition::Old(age);
        }
        if let PositionState::None(no_fix) = self.position {
            return Condition::NoPosition(no_fix);
        }
        if let Some(end_m) = self.outside_m().filter(|_| self.position == PositionState::Ok) {
            return Condition::Outside(end_m);
        }
        let Some(advice) = self.advice.as_ref().filter(|_| self.has_sonar()) else {
            return Condition::NoSonar;
        };
        if self.passed && self.position == PositionState::Ok && advice.reason != Reason::NoReturns {
            return Condition::Passed;
        }
        let going_back = self.back_to_m.filter(|_| self.position == PositionState::Ok);
        let Some(v_max_mps) = self.v_max_mps() else {
            return match advice.reason {
                // A head that isn't turning, or has only just begun to turn, counts as delivering no sonar data.
                Reason::NoReturns => Condition::NoSonar,
                Reason::NoHeadingOrFix => Condition::NoPosition(NoFix::Heading),
                Reason::AngularStep | Reason::HelixPitch => {
                    going_back.map_or(Condition::NoSpeed, Condition::GoingBack)
                }
            };
        };
        let (share, band) = (self.speed_mps.unwrap_or(0.0).abs() / v_max_mps, self.speed_band());
        let is_over = band != SpeedBand::Within;
        if let Some(to_m) = going_back.filter(|_| is_over) {
            return Condition::GoingBack(to_m);
        }
        match self.position {
            _ if band == SpeedBand::TooFast => Condition::TooFast,
            // Until the gyros' bias is known, the vehicle stays where it is.
            PositionState::Doubtful(PositionDoubt::Spread) if self.stand_s > 0 => {
                Condition::CannotSay(PositionDoubt::Spread)
            }
            // `will_exceed` stays set for a second, although the forecast for the present turn may be within
            // the target again.
            _ if advice.will_exceed && self.turn_exceeds(self.target.max_hole_m) && !is_over => {
                Condition::TurnFails
            }
            PositionState::Doubtful(doubt) => Condition::CannotSay(doubt),
            _ if is_over => Condition::Over,
            _ if advice.may_exceed && self.turn_exceeds(advice.sure_m) && share < UNDER => {
                Condition::TurnUnsure
            }
            _ => Condition::Good,
        }
    }
}

#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) use tests::state as test_state;
