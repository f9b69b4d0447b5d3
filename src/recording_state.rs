//! What all screens show of the recordings of a dive.

use headrace_geometry::time::DurNs;

/// Time that isn't on the medium yet from which screens show it, and from which it is an alarm.
pub(crate) const SHOWN_FROM: DurNs = DurNs(2_000_000_000);
pub(crate) const ALARM_FROM: DurNs = DurNs(5_000_000_000);

/// What screens show of all recordings together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RecordingState {
    /// Whether nothing goes into one at present; `None` as long as none has failed.
    pub(crate) fails: Option<bool>,
    /// Whole seconds of the dive that a power cut would lose, of the recording that is furthest behind.
    pub(crate) unsafe_s: u64,
}

impl RecordingState {
    /// What to show, and whether it is an alarm; `None` while all is well.
    pub(crate) fn words(&self) -> Option<(String, bool)> {
        let unsafe_for = DurNs::from_secs_f64(self.unsafe_s as f64);
        match self.fails {
            Some(true) => Some(("NOT RECORDED".to_owned(), true)),
            _ if unsafe_for >= ALARM_FROM => Some((format!("LAST {} s NOT ON DISK", self.unsafe_s), true)),
            _ if unsafe_for >= SHOWN_FROM => {
                Some((format!("last {} s not on disk yet", self.unsafe_s), false))
            }
            Some(false) => Some(("recording had failed".to_owned(), false)),
            None => None,
        }
    }
}
