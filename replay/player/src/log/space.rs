//! Monitors the free disk space during a recording, and decides which messages to drop when little space is left.
//!
//! Small irreplaceable messages (position readings, ticks, judgements, advice) are recorded until the disk is full.
//! Echoes are by far the largest share of a log, and are dropped first. Without echoes, the space lasts for the rest of
//! the dive.
//!
//! The recorder can't decode device data, so it recognises echoes by source and length; the log header lists the
//! sonars. Heads that send only ranges have short packets, which are kept. A dive with such heads still replays to its
//! digest.

use std::time::Duration;

use headrace_geometry::time::MonoNs;

/// Free bytes below which the user is warned. This space lasts for some hours of a dive.
pub const WARN_BELOW_BYTES: u64 = 1 << 30;
/// Free bytes below which echoes are dropped. The messages that are still recorded take days to fill this space.
const SPARE_BELOW_BYTES: u64 = 128 << 20;
/// Maximum length of a sonar packet that is kept, bytes. Longer packets are echoes, shorter ones have only ranges.
pub(super) const LONGEST_KEPT_BYTES: usize = 128;
/// Interval between queries of the free disk space.
const ASK_EVERY: Duration = Duration::from_secs(2);

/// Messages that a recorder dropped because its disk was nearly full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Number of dropped messages. They are echoes, results per echo, and messages for viewers.
    pub messages: u64,
    /// Total length of the dropped messages, bytes.
    pub bytes: u64,
    /// Log times of the first and last dropped message.
    pub span: Option<(MonoNs, MonoNs)>,
}

impl LeftOut {
    /// Returns the log's text about the dropped messages, without the times.
    pub fn words(&self) -> String {
        let Self { messages, bytes, .. } = self;
        format!(
            "{messages} echo returns and their results ({bytes} bytes) left out by the recorder: the disk was nearly full"
        )
    }
}

/// Monitors the free space of a recording's disk.
#[derive(Debug, Default)]
pub(super) struct Space {
    asked: Option<Duration>,
    warned: bool,
    sparing: bool,
    /// Free bytes of the disk at the latest query.
    free: u64,
    left_out: LeftOut,
}

impl Space {
    /// Queries the free space if a query is due. `now` is the time since the recording began.
    pub(super) fn look(&mut self, now: Duration, ask: impl FnOnce() -> Option<u64>) {
        if self.asked.is_some_and(|asked| now.saturating_sub(asked) < ASK_EVERY) {
            return;
        }
        let first = self.asked.replace(now).is_none();
        let Some(free) = ask() else { return };
        if first {
            tracing::debug!(free_bytes = free, "disk of the recording");
        }
        self.free = free;
        let free_mb = free / 1_000_000;
        // This is a hysteresis: once echoes have been dropped, they are recorded again only when there is much more
        // free space.
        let sparing = free < SPARE_BELOW_BYTES || (self.sparing && free < WARN_BELOW_BYTES);
        if sparing && !self.sparing {
            tracing::warn!(
                "the recording's disk has {free_mb} MB left: echo returns aren't recorded any more"
            );
        } else if self.sparing && !sparing {
            tracing::warn!("the recording's disk has {free_mb} MB left: echo returns are recorded again");
        } else if free < WARN_BELOW_BYTES && !self.warned {
            let least_mb = SPARE_BELOW_BYTES / 1_000_000;
            tracing::warn!(
                "the recording's disk has {free_mb} MB left; below {least_mb} MB echo returns won't be recorded"
            );
        }
        self.warned = free < WARN_BELOW_BYTES;
        self.sparing = sparing;
    }

    /// Whether echoes must be dropped now to save disk space.
    pub(super) fn is_scarce(&self) -> bool {
        self.sparing
    }

    /// Counts a dropped message. For the first dropped message, returns a statement for the log.
    pub(super) fn leave_out(&mut self, at: MonoNs, bytes: usize) -> Option<String> {
        let first = self.left_out.span.map(|span| span.0);
        self.left_out.span = Some((first.unwrap_or(at), at));
        self.left_out.messages += 1;
        self.left_out.bytes += bytes as u64;
        let free = self.free;
        first
            .is_none()
            .then(|| format!("the recorder leaves echo returns out: the disk had {free} bytes free"))
    }

    /// Returns the counts of messages dropped so far.
    pub(super) fn left_out(&self) -> LeftOut {
        self.left_out
    }
}
