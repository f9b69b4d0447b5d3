//! Verdicts of a dive's sections for other targets and section lengths.

use headrace_coverage::Verdict;
use serde::Serialize;

use super::run::Loop;

/// Length of tunnel by verdict, for another target or another section length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OtherTargetReport {
    /// Coverage target T, m.
    pub target_m: f64,
    /// Length of a section, m.
    pub section_m: f64,
    /// Length of the sections that pass for this target, m.
    pub pass_m: f64,
    /// Length of the sections that fail for this target, m.
    pub fail_m: f64,
    /// Length of the sections that neither pass nor fail for this target, although no more samples will land, m.
    pub cannot_say_m: f64,
    /// Length of the sections that are still open for this target, m.
    pub open_m: f64,
    /// Length of the sections of this length where some heads have not been, m.
    pub not_inspected_m: f64,
}

impl Loop {
    /// Returns the sections' present verdicts for another target, as section index and verdict.
    ///
    /// Only sections whose hole has been measured are included.
    pub fn verdicts_at(&self, target_m: f64) -> Vec<(i64, Verdict)> {
        self.view().coverage().sections.verdicts_at(target_m, &self.outlook()).collect()
    }
}
