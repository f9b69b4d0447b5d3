//! Recommended action for a failed stretch.

use serde::{Serialize, Serializer};

use super::cause::Cause;

/// Change to make when a failed stretch is passed again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Slower.
    Slower,
    /// A mode with a finer angular step: lower speed does not help.
    FinerMode,
    /// A longer range setting.
    LongerRange,
    /// Rolled, so that the vehicle occludes another part of the wall: turned round it hides the same.
    OtherSide,
    /// Centred in the tunnel and steady.
    Middle,
    /// Heads in phase.
    InPhase,
    /// The stalled head repaired, or slower without it.
    Head,
    /// The silent heads pinging again.
    HeadBack,
    /// With the position fix restored.
    Position,
    /// A higher gain: so much is lost, or always of the same wall, that lower speed does not help.
    HigherGain,
    /// No change: pass again, from end to end.
    Again,
}

impl Action {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Slower,
        Self::FinerMode,
        Self::LongerRange,
        Self::OtherSide,
        Self::Middle,
        Self::InPhase,
        Self::Head,
        Self::HeadBack,
        Self::Position,
        Self::HigherGain,
        Self::Again,
    ];

    /// The actions against several causes, in their order; `is_beyond_speed`: no speed makes up for the returns that are missing.
    pub fn against(causes: impl IntoIterator<Item = Cause>, is_beyond_speed: bool) -> Vec<Self> {
        let mut actions: Vec<Self> = Vec::new();
        for cause in causes {
            let action = match cause {
                Cause::MissingReturns if is_beyond_speed => Self::HigherGain,
                cause => Self::of(cause),
            };
            if !actions.contains(&action) {
                actions.push(action);
            }
        }
        actions
    }

    /// The action against a cause.
    fn of(cause: Cause) -> Self {
        match cause {
            Cause::TooFast => Self::Slower,
            Cause::AngularStep => Self::FinerMode,
            Cause::OutOfRange => Self::LongerRange,
            Cause::Occluded => Self::OtherSide,
            Cause::OffAxis => Self::Middle,
            Cause::Phase => Self::InPhase,
            Cause::HeadStalled => Self::Head,
            Cause::HeadSilent => Self::HeadBack,
            Cause::PositionLost => Self::Position,
            Cause::MissingReturns | Cause::NotPassed | Cause::Unknown => Self::Again,
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
            Self::HeadBack => "head_back",
            Self::Position => "position",
            Self::HigherGain => "higher_gain",
            Self::Again => "again",
        }
    }
}

impl Serialize for Action {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}
