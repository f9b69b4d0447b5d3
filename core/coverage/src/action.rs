//! What to do about a failed stretch.

use serde::{Serialize, Serializer};

use super::cause::Cause;

/// What must be other than it was when a stretch is passed again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Slower.
    Slower,
    /// A finer mode: slower won't help.
    FinerMode,
    /// A longer range setting.
    LongerRange,
    /// The other way round or rolled, so that the vehicle hides another part of the wall.
    OtherSide,
    /// In the middle and steady.
    Middle,
    /// The heads put in phase.
    InPhase,
    /// The head that stood mended, or slower without it.
    Head,
    /// The position found again.
    Position,
    /// Nothing but once more, from end to end.
    Again,
}

impl Action {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Slower,
        Self::FinerMode,
        Self::LongerRange,
        Self::OtherSide,
        Self::Middle,
        Self::InPhase,
        Self::Head,
        Self::Position,
        Self::Again,
    ];

    /// What helps against a cause.
    pub fn of(cause: Cause) -> Self {
        match cause {
            Cause::TooFast => Self::Slower,
            Cause::AngularStep => Self::FinerMode,
            Cause::OutOfRange => Self::LongerRange,
            Cause::Occluded => Self::OtherSide,
            Cause::OffAxis => Self::Middle,
            Cause::Phase => Self::InPhase,
            Cause::HeadStalled => Self::Head,
            Cause::PositionLost => Self::Position,
            Cause::MissingReturns | Cause::NotPassed => Self::Again,
        }
    }

    /// The word used in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Slower => "slower",
            Self::FinerMode => "finer_mode",
            Self::LongerRange => "longer_range",
            Self::OtherSide => "other_side",
            Self::Middle => "middle",
            Self::InPhase => "in_phase",
            Self::Head => "head",
            Self::Position => "position",
            Self::Again => "again",
        }
    }
}

impl Serialize for Action {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}
