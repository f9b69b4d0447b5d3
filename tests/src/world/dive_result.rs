//! Results of a dive in the simulated world.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_ports::LineHistory;
use headrace_replay::log::Summary;

use super::disk::LeftFile;
use super::plan::Plan;

/// Result of a dive in a simulated world.
pub struct DiveResult {
    /// Faults planned for the dive.
    pub plan: Plan,
    /// Packets that the loop took during the dive, in order.
    pub consumed: Vec<Consumed>,
    /// After each tick, the position at the latest advice update.
    pub positions: Vec<Position>,
    /// Kinds of all alerts of the dive, and causes of missed stretches.
    pub alerts: Vec<&'static str>,
    /// Digest of the results.
    pub digest: u64,
    /// Results of the lines between devices and loop, one for each device.
    pub lines: Vec<Line>,
    /// Summary of the recorder; `None` if it was killed.
    pub summary: Option<Summary>,
    /// Number of failed disk operations.
    pub disk_failures: usize,
    /// Files of the recording that are left on the disk.
    pub left: Vec<LeftFile>,
    /// Number of consumed packets, from the first on, that must be in the log, whichever way the dive ends.
    pub certain: usize,
    /// Whether the recorder left packets out because its queue was full.
    pub has_left_out: bool,
    /// Longest time for which packets waited for the loop while it was running.
    pub longest_wait: DurNs,
}

/// Result of a replay of the files that are left on the disk.
#[derive(Default)]
pub struct Replayed {
    /// Packets that the loop took.
    pub consumed: Vec<Consumed>,
    /// Digest of the results.
    pub digest: u64,
    /// Losses that the replay reported.
    pub losses: Vec<String>,
    /// Result of another replay, after the files were changed as planned; or the reason why the changed files can't be
    /// read as a log. `None` if no change is planned.
    pub changed: Option<Result<Box<Self>, String>>,
}

/// Result of the line of one device.
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
    /// Last status of the line, and its numbers of openings, losses and dropped packets.
    pub history: LineHistory,
}

/// A packet that the loop has taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Consumed {
    /// Source of the packet.
    pub source: u16,
    /// Receive time of the packet.
    pub received: MonoNs,
    /// Content of the packet.
    pub bytes: Vec<u8>,
}

/// Position at an advice update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// Time of the advice update.
    pub at: MonoNs,
    /// Estimated chainage and its standard deviation, m.
    pub chainage_m: f64,
    /// Standard deviation of the chainage, m.
    pub sd_m: f64,
    /// Estimated speed, m/s.
    pub speed_mps: f64,
    /// Whether the position counts as reliable.
    pub is_sure: bool,
}
