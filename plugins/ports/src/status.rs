//! Status of a device and its line, for display.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crossbeam::queue::ArrayQueue;
use headrace_geometry::time::MonoNs;

/// Phase of a device's connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// The line isn't open.
    Closed,
    /// The line is open, but no data has arrived yet, or none within the silence timeout.
    Silent,
    /// Bytes arrive, but no valid frame can be found in them.
    Babbling,
    /// The device on the line isn't the expected one, or refuses its settings.
    Wrong,
    /// Good frames arrive.
    Running,
}

impl Phase {
    /// Name of the phase.
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

/// Status of a device from a given time on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// Sensor index, in the order of the vehicle file.
    pub source: usize,
    /// Time at which the status began.
    pub since: MonoNs,
    /// Phase of the device.
    pub phase: Phase,
    /// Text about the phase: reason and fix; for a running device, its identity.
    pub words: String,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.phase.as_str())?;
        if self.words.is_empty() { Ok(()) } else { write!(f, ": {}", self.words) }
    }
}

/// History of a device's line during a dive.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LineHistory {
    /// Number of times the line was opened.
    pub opened: u64,
    /// Number of times the line was lost, or reopened because of silence.
    pub lost: u64,
    /// Number of packets dropped because the loop's ring was full, or because the carrier discarded them unread.
    pub dropped: u64,
    /// Number of messages from rejected senders.
    pub strangers: u64,
    /// Latest status of the device, as text.
    pub last: String,
}

/// Bounded queue of statuses. When it is full, the oldest status is dropped and counted.
#[derive(Clone)]
pub struct StatusQueue {
    shared: Arc<Shared>,
}

struct Shared {
    statuses: ArrayQueue<Status>,
    dropped: AtomicU64,
}

impl StatusQueue {
    /// Creates a queue that holds `capacity` statuses.
    pub fn new(capacity: usize) -> Self {
        let statuses = ArrayQueue::new(capacity.max(1));
        Self { shared: Arc::new(Shared { statuses, dropped: AtomicU64::new(0) }) }
    }

    pub(crate) fn put(&self, status: Status) {
        if self.shared.statuses.force_push(status).is_some() {
            self.shared.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Takes the oldest status from the queue.
    pub fn next(&self) -> Option<Status> {
        self.shared.statuses.pop()
    }

    /// Returns the number of statuses dropped unread.
    pub fn dropped(&self) -> u64 {
        self.shared.dropped.load(Ordering::Relaxed)
    }
}
