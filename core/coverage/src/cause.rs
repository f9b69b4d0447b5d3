//! Causes of a failed section.

use serde::{Deserialize, Serialize};

use super::passage::Loss;

/// Cause assigned to a fail. Source: docs/why/coverage.md, "Causes".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The distance between passes was too large at the speed driven.
    TooFast,
    /// The angular step alone leaves holes that are too large. Lower speed does not help.
    AngularStep,
    /// The wall was farther than the heads' range setting.
    OutOfRange,
    /// The vehicle was off-centre, or it turned and its beams swung along the tunnel.
    OffAxis,
    /// The heads' passes were unevenly spread. At the scheduled angles, they would have met the target.
    Phase,
    /// The hole extends beyond the stretch that all live heads have swept.
    NotPassed,
    /// A head passed without pinging.
    HeadSilent,
    /// A head was stalled, or has been out of phase since a stall.
    HeadStalled,
    /// Returns came without a valid position.
    PositionLost,
    /// No returns although the wall was within range.
    MissingReturns,
    /// The vehicle occluded the beams.
    Occluded,
    /// No cause explains the hole.
    Unknown,
}

impl Cause {
    /// All causes, with the causes that the pilot can change first.
    ///
    /// If two causes explain a hole equally well, the first in this order is named.
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

    /// Word used in reports and logs.
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

    /// Cause that corresponds to the reason for a missing sample.
    pub fn of_loss(loss: Loss) -> Self {
        match loss {
            Loss::Missing => Self::MissingReturns,
            Loss::OutOfRange => Self::OutOfRange,
            Loss::Occluded => Self::Occluded,
        }
    }
}
