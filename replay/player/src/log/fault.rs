//! Faults of a recording while it is being made.

use std::path::PathBuf;

use headrace_geometry::time::{DurNs, MonoNs};

/// Maximum number of faults in the list. Later faults extend the last entry.
const MAX_FAULTS: usize = 100;

/// A fault after which a part of a recording could no longer be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordingFault {
    /// Path of the part that could no longer be written.
    pub path: PathBuf,
    /// The failed action, and the operating system's error.
    pub error: String,
    /// Number of messages that were lost, because no part contains them.
    pub lost: u64,
    /// Log time of the last synced message before the fault, if any.
    pub from: Option<MonoNs>,
    /// Log time of the first message after the fault, if any.
    pub to: Option<MonoNs>,
    /// The part in which the recording continues; `None` if the recording has ended.
    pub continued: Option<PathBuf>,
}

impl RecordingFault {
    /// Returns the fault as text, without the times.
    pub fn words(&self) -> String {
        let Self { path, error, lost, continued, .. } = self;
        let lost = match lost {
            0 => "no message is missing".to_owned(),
            1 => "1 message is missing".to_owned(),
            lost => format!("{lost} messages are missing"),
        };
        let path = path.display();
        match continued {
            Some(next) => {
                format!(
                    "recording failed in {path}: {error}; {lost}; recording continues in {}",
                    next.display()
                )
            }
            None => format!("recording failed in {path}: {error}; {lost}; nothing was recorded after that"),
        }
    }
}

/// A change in the state of a recording, for display to people who watch the dive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecordingEvent {
    /// A part can't be written any more. The recorder keeps trying to begin another part, and records nothing until it
    /// succeeds.
    Failed {
        /// Path of the part that can't be written.
        path: PathBuf,
        /// The failed action, and the operating system's error.
        error: String,
    },
    /// The recording continues in another part after a fault.
    Resumed(RecordingFault),
    /// The medium accepts no data, but reports no error. The recorder's queue is full, so new data isn't recorded.
    Behind,
    /// The medium, which blocked the recording, accepts data again.
    CaughtUp {
        /// Number of packets that were not recorded while the medium was blocked.
        packets: u64,
    },
    /// The medium is slow, so a power cut now loses the last seconds.
    Late {
        /// Path of the recording.
        path: PathBuf,
        /// Amount of dive time that isn't on the medium yet.
        by: DurNs,
    },
    /// The medium is no longer slow.
    InTime {
        /// Path of the recording.
        path: PathBuf,
    },
}

impl RecordingEvent {
    /// Whether new data is being lost now, or will be lost if the power fails.
    pub fn fails(&self) -> bool {
        matches!(self, Self::Failed { .. } | Self::Behind | Self::Late { .. })
    }

    /// Returns the event as text for display.
    pub fn words(&self) -> String {
        match self {
            Self::Failed { path, error } => {
                format!("NOT RECORDED to {}: {error}; retrying in another part", path.display())
            }
            Self::Resumed(fault) => fault.words(),
            Self::Behind => "NOT RECORDED: the medium accepts no data and reports no error".to_owned(),
            Self::CaughtUp { packets } => {
                format!("recorded again; {packets} earlier packets are missing")
            }
            Self::Late { path, by } => format!(
                "the last {:.0} s are not on the disk yet: a power cut would lose them; {} is too slow",
                by.as_secs_f64(),
                path.display()
            ),
            Self::InTime { path } => {
                format!("{} has caught up: all but the last moment is on the disk", path.display())
            }
        }
    }
}

/// State of a recording, from its events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RecordingHealth {
    has_failed: bool,
    is_behind: bool,
    is_late: bool,
}

impl RecordingHealth {
    /// Updates the state from the recording's next event. The end of one fault doesn't clear another fault.
    pub fn take(&mut self, event: &RecordingEvent) {
        match event {
            RecordingEvent::Failed { .. } => self.has_failed = true,
            RecordingEvent::Resumed(_) => self.has_failed = false,
            RecordingEvent::Behind => self.is_behind = true,
            RecordingEvent::CaughtUp { .. } => self.is_behind = false,
            RecordingEvent::Late { .. } => self.is_late = true,
            RecordingEvent::InTime { .. } => self.is_late = false,
        }
    }

    /// Whether new data is being lost now, or will be lost if the power fails.
    pub fn fails(&self) -> bool {
        self.has_failed || self.is_behind || self.is_late
    }
}

/// Adds a fault to a list of limited length.
pub(super) fn add(faults: &mut Vec<RecordingFault>, fault: RecordingFault) {
    if faults.len() < MAX_FAULTS {
        faults.push(fault);
    } else if let Some(last) = faults.last_mut() {
        last.lost += fault.lost;
        (last.to, last.continued) = (fault.to, fault.continued);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn end_of_one_fault_does_not_end_another() {
        let failed = RecordingEvent::Failed { path: PathBuf::new(), error: String::new() };
        let (path, error) = (PathBuf::new(), String::new());
        let resumed = RecordingFault { path, error, lost: 0, from: None, to: None, continued: None };
        let mut health = RecordingHealth::default();
        let fails = [RecordingEvent::Behind, failed, RecordingEvent::CaughtUp { packets: 7 }].map(|event| {
            health.take(&event);
            health.fails()
        });
        assert_eq!(fails, [true, true, true], "the medium still fails when the queue is empty again");
        health.take(&RecordingEvent::Resumed(resumed));
        assert!(!health.fails());
    }
}
