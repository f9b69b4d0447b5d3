//! An interruption of a dive, and the parts that were recorded before it.

use std::path::Path;

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::report::LogReport;
use headrace_replay::log::PartFile;

use crate::feeds::share;
use crate::report_output::files_report;

/// An interruption after which the dive goes on.
pub(crate) struct Interruption {
    /// Time without data.
    pub(crate) gap: DurNs,
    /// First and last time of the interrupted dive's log.
    pub(crate) span: Option<(MonoNs, MonoNs)>,
    /// Text that tells how the dive goes on.
    pub(crate) words: String,
    /// Losses that the interruption caused, as text.
    pub(crate) losses: Vec<String>,
}

impl Interruption {
    /// Part of the interrupted dive's log before the time `at`, percent.
    pub(crate) fn read_pct(&self, at: MonoNs) -> u8 {
        let share = share(self.span, at).unwrap_or(0.0);
        headrace_geometry::math::floor_to_i64(share * 100.0).try_into().unwrap_or(0)
    }
}

/// The parts of a dive that were recorded before the dive was interrupted.
#[derive(Default)]
pub(crate) struct Earlier {
    pub(crate) files: Vec<PartFile>,
    pub(crate) losses: Vec<String>,
}

impl Earlier {
    /// Adds the earlier parts to the report about the recording that continues them.
    pub(crate) fn complete(self, log: &mut LogReport) {
        log.losses.splice(0..0, self.losses);
        if self.files.is_empty() {
            return;
        }
        let earlier = self.files.iter().map(|file| (file.path.as_path(), file.messages));
        let later = log.parts.iter().map(|part| (Path::new(&part.path), part.messages));
        let whole = files_report(Path::new(&log.path), &earlier.chain(later).collect::<Vec<_>>());
        log.losses.extend(whole.losses);
        (log.sha256, log.parts) = (whole.sha256, whole.parts);
    }
}
