//! Causes of a failed section, and the figures behind them.

use serde::{Deserialize, Serialize};

use super::causes::Causes;
use super::passage::Loss;
use headrace_sampling::head::HeadSet;

/// Cause assigned to a fail. Source: metrics.md, "Sections and verdicts".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The distance between passes was too large at the speed driven.
    TooFast,
    /// The angular step alone leaves such holes; lower speed does not help.
    AngularStep,
    /// The wall was farther than the heads' range setting.
    OutOfRange,
    /// The vehicle was off-centre, or turned so that its beams swung along the tunnel.
    OffAxis,
    /// The heads' passes were unevenly spread; as scheduled they would have met the target.
    Phase,
    /// The hole reaches beyond the stretch that was passed.
    NotPassed,
    /// A head went by without a ping.
    HeadSilent,
    /// A head was stalled, or has been out of step since.
    HeadStalled,
    /// Returns came without a valid position.
    PositionLost,
    /// No returns although the wall was within range.
    MissingReturns,
    /// The vehicle occluded the beams.
    Occluded,
    /// None of these explains the hole.
    Unknown,
}

impl Cause {
    /// All of them, what the pilot can change first: of two that explain a hole alike, the first is named.
    pub const ALL: [Self; 12] = [
        Self::TooFast,
        Self::AngularStep,
        Self::OutOfRange,
        Self::OffAxis,
        Self::Phase,
        Self::NotPassed,
        Self::HeadSilent,
        Self::HeadStalled,
        Self::PositionLost,
        Self::MissingReturns,
        Self::Occluded,
        Self::Unknown,
    ];

    /// The word used in reports and logs.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::TooFast => "too_fast",
            Self::AngularStep => "angular_step",
            Self::MissingReturns => "missing_returns",
            Self::OutOfRange => "out_of_range",
            Self::Occluded => "occluded",
            Self::OffAxis => "off_axis",
            Self::Phase => "phase",
            Self::HeadStalled => "head_stalled",
            Self::HeadSilent => "head_silent",
            Self::PositionLost => "position_lost",
            Self::NotPassed => "not_passed",
            Self::Unknown => "unknown",
        }
    }

    /// The cause that a lost ping is put down to.
    pub fn of_loss(loss: Loss) -> Self {
        match loss {
            Loss::Missing => Self::MissingReturns,
            Loss::OutOfRange => Self::OutOfRange,
            Loss::Occluded => Self::Occluded,
        }
    }
}

/// Causes of a fail and the figures behind them: those of driving are of the moment with the largest T as driven, in the
/// sections within T; counts are over these sections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The main cause: the first of `causes`.
    pub cause: Cause,
    /// The smallest set of causes without which the section would have passed, the main one first.
    pub causes: Causes,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target in the middle, all heads turning as scheduled, m/s; the planned one
    /// where that does; zero where none.
    pub fits_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes had they been spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The same if all heads had been turning, seconds.
    pub all_pass_gap_s: f64,
    /// Share of pings without a return, beyond range or not.
    pub missing_share: f64,
    /// Share of pings occluded by the vehicle.
    pub occluded_share: f64,
    /// Share of pings of a stalled head.
    pub standing_share: f64,
    /// Samples lacking in the hole, whatever the reason: pings lost, or never made.
    pub lost_in_hole: u32,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// The same predicted for a level vehicle in the middle of the tunnel, m.
    pub middle_t_y_m: f64,
    /// How far the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Heads that went by without a ping, by number.
    #[serde(with = "head_numbers")]
    pub silent_heads: HeadSet,
}

mod head_numbers;
