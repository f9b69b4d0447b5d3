//! Deliberate violations of invariants, which prove that the checks find violations.

/// A deliberate violation of an invariant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sabotage {
    /// Every hundredth frame of a device without planned faults is lost on its way.
    CableLoses,
    /// When the connection of one device breaks, the connection of another device breaks, too.
    NeighbourBreaks,
    /// Every fortieth write to the disk is dropped but reported as done.
    DiskForgets,
    /// Disk syncs are reported as done although nothing is synced.
    SyncLies,
    /// The log doesn't state the packets that a line dropped.
    DropsUntold,
    /// The recorder writes every sector by a separate operation, which makes it too slow for a disk with limited
    /// operations.
    WritesSectors,
    /// Parts and copies of a log are replayed one after the other in the given order, without a check.
    PartsReadApart,
}

impl Sabotage {
    /// All kinds of sabotage.
    pub const ALL: [Self; 7] = [
        Self::CableLoses,
        Self::NeighbourBreaks,
        Self::DiskForgets,
        Self::SyncLies,
        Self::DropsUntold,
        Self::WritesSectors,
        Self::PartsReadApart,
    ];
}
