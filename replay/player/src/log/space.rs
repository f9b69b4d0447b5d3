//! The room that is left on the disk of a recording, and what is left out when it gets scarce.
//!
//! A dive outlives its disk: what is small and can't be had again (readings of position, ticks, judgements, advice) is kept to the
//! last byte; echoes, by far the most of a log, go first. Which packets are echoes is told by their source and their length: the
//! header says which sources are sonars, since the recorder knows no device. Heads that send ranges alone have short packets, which are kept: such a dive still replays to its digest.

use std::fs::File;
use std::time::{Duration, Instant};

use headrace_geometry::time::MonoNs;

/// Below so many free bytes a person is warned: some hours of a dive.
const WARN_BELOW_BYTES: u64 = 1 << 30;
/// Below so many free bytes echoes are left out: what is kept has room for days in them.
const SPARE_BELOW_BYTES: u64 = 128 << 20;
/// Longer packets of sonars are echoes; ranges alone are shorter.
pub(super) const LONGEST_KEPT_BYTES: usize = 128;
/// How often the system is asked.
const ASK_EVERY: Duration = Duration::from_secs(2);

/// What a recorder has left out since its disk was nearly full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LeftOut {
    /// Echoes, results that follow them one by one, and what viewers are shown.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Log times of the first and the last.
    pub span: Option<(MonoNs, MonoNs)>,
}

impl LeftOut {
    /// In words, without the times.
    pub fn words(&self) -> String {
        let Self { messages, bytes, .. } = self;
        format!(
            "{messages} echo returns and their results ({bytes} bytes) left out by the recorder: the disk was nearly full"
        )
    }
}

/// Watches the room.
pub(super) struct Space {
    ask: Box<dyn FnMut() -> Option<u64> + Send>,
    asked: Option<Instant>,
    warned: bool,
    sparing: bool,
    /// Free bytes, as last told.
    free: u64,
    left_out: LeftOut,
}

impl Space {
    /// With a way to ask how many bytes are free; `None` where nobody can tell.
    pub(super) fn new(ask: impl FnMut() -> Option<u64> + Send + 'static) -> Self {
        let ask = Box::new(ask);
        Self { ask, asked: None, warned: false, sparing: false, free: u64::MAX, left_out: LeftOut::default() }
    }

    /// Room without an end.
    pub(super) fn endless() -> Self {
        Self::new(|| None)
    }

    /// What the disk of a file has free for those who aren't root.
    pub(super) fn of(file: File) -> Self {
        Self::new(move || {
            let disk = rustix::fs::fstatvfs(&file).ok()?;
            Some(disk.f_bavail.saturating_mul(disk.f_frsize))
        })
    }

    /// Asks, when it is time to.
    pub(super) fn look(&mut self, now: Instant) {
        if self.asked.is_some_and(|asked| now.duration_since(asked) < ASK_EVERY) {
            return;
        }
        let first = self.asked.replace(now).is_none();
        let Some(free) = (self.ask)() else { return };
        if first {
            tracing::debug!(free_bytes = free, "disk of the recording");
        }
        self.free = free;
        let free_mb = free / 1_000_000;
        // Once echoes are left out they stay so until there is much more room.
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

    /// Whether echoes are to be left out.
    pub(super) fn is_scarce(&self) -> bool {
        self.sparing
    }

    /// Counts a message that is left out. Gives what the log is to say at the first.
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

    /// What was left out in all.
    pub(super) fn left_out(&self) -> LeftOut {
        self.left_out
    }
}
