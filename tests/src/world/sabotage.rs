//! Deliberate violations of an invariant, to test that they are found.

/// A deliberate violation of an invariant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sabotage {
    /// Every hundredth frame of a sound device is lost on the way.
    CableLoses,
    /// When one connection breaks, another breaks too.
    NeighbourBreaks,
    /// Every fortieth write is dropped but reported as done.
    DiskForgets,
    /// Syncs are reported as done but aren't done.
    SyncLies,
    /// Drops on a line aren't recorded.
    DropsUntold,
}

impl Sabotage {
    /// All sabotages.
    pub const ALL: [Self; 5] =
        [Self::CableLoses, Self::NeighbourBreaks, Self::DiskForgets, Self::SyncLies, Self::DropsUntold];
}
