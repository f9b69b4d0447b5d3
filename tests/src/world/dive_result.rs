//! Results of a dive in the simulated world.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::LineHistory;
use headrace_replay::log::Summary;

use super::disk::LeftFile;
use super::plan::Plan;

/// Result of a dive.
pub struct DiveResult {
    /// Planned faults.
    pub plan: Plan,
    /// Packets that the loop took, in order.
    pub consumed: Vec<Consumed>,
    /// Digest of the results.
    pub digest: u64,
    /// Results of the lines, one for each device.
    pub lines: Vec<Line>,
    /// Summary of the recorder; `None` if it was killed.
    pub summary: Option<Summary>,
    /// Number of failed disk operations.
    pub disk_failures: usize,
    /// Files of the recording.
    pub left: Vec<LeftFile>,
    /// Number of consumed packets that must be in the log, whichever way the dive ends.
    pub certain: usize,
    /// Longest time for which packets waited although the loop ran.
    pub longest_wait: DurNs,
}

/// Result of a replay of the remaining files.
pub struct Replayed {
    /// Packets that the loop took.
    pub consumed: Vec<Consumed>,
    /// Digest of the results.
    pub digest: u64,
    /// Losses that the player reported.
    pub losses: Vec<String>,
}

/// Result of a device's line.
#[derive(Debug)]
pub struct Line {
    /// Whether the plan has no fault for the device.
    pub untouched: bool,
    /// Whether the cable only splits and delays frames.
    pub lossless: bool,
    /// Number of frames sent whole.
    pub whole: u64,
    /// Number of good frames that the loop found.
    pub good: u64,
    /// History of the line.
    pub history: LineHistory,
}

/// A packet that the loop has taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consumed {
    /// Source of the packet.
    pub source: u16,
    /// Receive time.
    pub received: MonoNs,
    /// Content.
    pub bytes: Vec<u8>,
}
