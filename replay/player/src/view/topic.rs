//! Topics for viewers.

/// The topics, in the order of their channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    Transforms,
    Pose,
    Vehicle,
    Points,
    Wall,
    Sections,
    Missed,
    Advice,
    Alerts,
}

impl Topic {
    /// All topics, in the order of their channels.
    pub(super) const ALL: [Self; 9] = [
        Self::Transforms,
        Self::Pose,
        Self::Vehicle,
        Self::Points,
        Self::Wall,
        Self::Sections,
        Self::Missed,
        Self::Advice,
        Self::Alerts,
    ];
}
