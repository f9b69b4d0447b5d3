//! What the pilot is to know first: one condition, and one lamp.

use serde::Serialize;

use super::{LiveState, PositionDoubt, PositionState};
use headrace_fusion::NoFix;
use headrace_geometry::time::DurNs;
use headrace_sampling::advice::Reason;

/// Share of v_max beyond which a speed is over it: that of the advice's margin and of the error of its measurement.
const OVER: f64 = 1.02;
/// Share below which a speed is another one than v_max.
const UNDER: f64 = 0.97;
/// Share beyond which it is too fast: what a pilot who follows the advice keeps.
const TOO_FAST: f64 = 1.05;

/// What holds now; where several do, the first of this list.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// Nothing has come from any sensor.
    NoData,
    /// Nothing has come for so long.
    Old(DurNs),
    /// There is no position, for want of this.
    NoPosition(NoFix),
    /// No head is over the tunnel, which ends or begins at this chainage (m), the position sure.
    Outside(f64),
    /// No profiling head gives readings.
    NoSonar,
    /// All wall here has passed, and the position is sure: any speed will do.
    Passed,
    /// On the way back for a missed stretch, to this chainage (m), faster than what counts: it is passed again from there.
    GoingBack(f64),
    /// Slower won't help.
    NoSpeed,
    /// The speed is well over v_max.
    TooFast,
    /// At this speed the present turn misses the target, though the speed is within v_max.
    TurnFails,
    /// What is placed now can't be judged.
    CannotSay(PositionDoubt),
    /// The speed is a little over v_max.
    Over,
    /// At this speed the present turn may miss the target for what errors of position take of it, though v_max is faster.
    TurnUnsure,
    /// The speed is within v_max.
    Good,
}

/// Colour of a condition.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Lamp {
    /// Go on.
    Green,
    /// Take care.
    Amber,
    /// Do something.
    Red,
}

impl Condition {
    /// The word used in JSON.
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

    /// Its colour.
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
    /// Whether the T forecast at the present speed is over this, m, or unbounded.
    fn turn_exceeds(&self, limit_m: f64) -> bool {
        self.advice.and_then(|advice| advice.predicted_t_m).is_none_or(|t_m| t_m > limit_m)
    }

    /// What holds now.
    pub fn condition(&self) -> Condition {
        let Some(age) = self.age() else { return Condition::NoData };
        if self.is_old() {
            return Condition::Old(age);
        }
        if let PositionState::None(lacking) = self.position {
            return Condition::NoPosition(lacking);
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
                // Of a head that doesn't turn, or not long enough yet, nothing is known.
                Reason::NoReturns => Condition::NoSonar,
                Reason::NoHeadingOrFix => Condition::NoPosition(NoFix::Heading),
                Reason::AngularStep | Reason::HelixPitch => {
                    going_back.map_or(Condition::NoSpeed, Condition::GoingBack)
                }
            };
        };
        let share = self.speed_mps.unwrap_or(0.0).abs() / v_max_mps;
        if let Some(to_m) = going_back.filter(|_| share > OVER) {
            return Condition::GoingBack(to_m);
        }
        match self.position {
            _ if share > TOO_FAST => Condition::TooFast,
            // The forecast is held for a second; the turn itself may have been mended.
            _ if advice.will_exceed && self.turn_exceeds(self.target_m) && share <= OVER => {
                Condition::TurnFails
            }
            PositionState::Doubtful(doubt) => Condition::CannotSay(doubt),
            _ if share > OVER => Condition::Over,
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
