//! How a device's line is doing, for people.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::MonoNs;

/// How it is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Its line isn't open.
    Closed,
    /// The line is open, and nothing has come for longer than the device should be silent.
    Silent,
    /// Bytes come, and none of them make sense.
    Babbling,
    /// It says something that isn't right: another device, refused settings.
    Wrong,
    /// All is well.
    Running,
}

impl Phase {
    /// A word for it.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Closed => "closed",
            Self::Silent => "silent",
            Self::Babbling => "babbling",
            Self::Wrong => "wrong",
            Self::Running => "running",
        }
    }
}

/// How a device is doing from a moment on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// The sensor's number, in the order of the vehicle file.
    pub source: usize,
    /// Since when.
    pub since: MonoNs,
    /// How.
    pub phase: Phase,
    /// Why, and what would mend it; what the device says that it is while it runs.
    pub words: String,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.phase.as_str())?;
        if self.words.is_empty() { Ok(()) } else { write!(f, ": {}", self.words) }
    }
}

/// What a line has been through during a dive.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LineHistory {
    /// How often it was opened.
    pub opened: u64,
    /// How often it was lost, or given up for silence.
    pub lost: u64,
    /// Packets for which the loop's ring had no room.
    pub dropped: u64,
    /// The last status, in words.
    pub last: String,
}

/// A bounded board for statuses. When nobody reads it the oldest are dropped, and counted.
#[derive(Clone)]
pub struct Board {
    shared: Arc<Shared>,
}

struct Shared {
    statuses: ArrayQueue<Status>,
    dropped: AtomicU64,
}

impl Board {
    /// With room for so many statuses.
    pub fn new(capacity: usize) -> Self {
        let statuses = ArrayQueue::new(capacity.max(1));
        Self { shared: Arc::new(Shared { statuses, dropped: AtomicU64::new(0) }) }
    }

    pub(crate) fn put(&self, status: Status) {
        if self.shared.statuses.force_push(status).is_some() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// The oldest status that hasn't been taken.
    pub fn next(&self) -> Option<Status> {
        self.shared.statuses.pop()
    }

    /// How many were dropped because nobody took them.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}
