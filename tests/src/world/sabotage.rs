//! What breaks an invariant on purpose, to see that it is found.

/// What breaks an invariant on purpose, to see that it is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sabotage {
    /// Every hundredth frame of a sound device is lost on its way.
    CableLoses,
    /// When one connection breaks another does.
    NeighbourBreaks,
    /// Every fortieth write is forgotten, and reported as done.
    DiskForgets,
    /// Syncs are reported and not done.
    SyncLies,
    /// What lines drop isn't recorded.
    DropsUntold,
}

impl Sabotage {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::CableLoses, Self::NeighbourBreaks, Self::DiskForgets, Self::SyncLies, Self::DropsUntold];
}
