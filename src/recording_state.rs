//! State of a dive's recordings, as shown on all screens.

use headrace_geometry::time::DurNs;

/// Age of the latest sync to disk from which screens show the age. From the age `ALARM_FROM` on, screens show it as an
/// alarm.
pub(crate) const SHOWN_FROM: DurNs = DurNs(2_000_000_000);
pub(crate) const ALARM_FROM: DurNs = DurNs(5_000_000_000);

/// State of all recordings together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct RecordingState {
    /// Whether a recording is failing at present; `None` if none has ever failed.
    pub(crate) fails: Option<bool>,
    /// Whole seconds of the dive that a power cut would lose, for the recording that is furthest behind.
    pub(crate) unsafe_s: u64,
    /// How much of an interrupted dive's log has been read again, percent; `None` if the dive's state is complete.
    pub(crate) rebuilt_pct: Option<u8>,
}

impl RecordingState {
    /// Text about failing or unsynced recordings, and whether the text is an alarm. `None` if all is well.
    pub(crate) fn words(&self) -> Option<(String, bool)> {
        let unsafe_for = DurNs::from_secs_f64(self.unsafe_s as f64);
        match self.fails {
            Some(true) => Some(("NOT RECORDED".to_owned(), true)),
            _ if unsafe_for >= ALARM_FROM => Some((format!("LAST {} s NOT ON DISK", self.unsafe_s), true)),
            _ if unsafe_for >= SHOWN_FROM => {
                Some((format!("last {} s not on disk yet", self.unsafe_s), false))
            }
            _ if let Some(pct) = self.rebuilt_pct => {
                Some((format!("reading the dive so far again: {pct} %; new data is recorded"), false))
            }
            Some(false) => Some(("recording had failed".to_owned(), false)),
            None => None,
        }
    }
}
