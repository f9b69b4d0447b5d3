//! Recommended action for a missed stretch.

use serde::{Serialize, Serializer};

use super::cause::Cause;

/// Change to make when the vehicle passes a missed stretch again.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// Drive slower.
    Slower,
    /// Use a scan mode with a finer angular step, because a lower speed does not help.
    FinerMode,
    /// Set a longer range on the heads.
    LongerRange,
    /// Roll the vehicle so that it occludes another part of the wall.
    ///
    /// Turning the vehicle round does not help, because it then occludes the same part.
    OtherSide,
    /// Stay centred in the tunnel, with a steady heading.
    Middle,
    /// Restart the heads in phase.
    InPhase,
    /// Repair the stalled head, or drive slower without it.
    Head,
    /// Make the silent heads ping again.
    HeadBack,
    /// Restore the position fix first.
    Position,
    /// Raise the sonar gain.
    ///
    /// A lower speed does not help, because too many returns are lost or the same wall loses its returns again and
    /// again.
    HigherGain,
    /// Change nothing. Pass the stretch again from end to end.
    Again,
}

impl Action {
    /// All actions, in the order of their declaration.
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

    /// Actions against several causes, in the order of the causes and without duplicates.
    ///
    /// `is_beyond_speed` means that too many returns are missing for any speed to make up for them.
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

    /// Action against one cause of a fail.
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

    /// Word used for the action in reports.
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
