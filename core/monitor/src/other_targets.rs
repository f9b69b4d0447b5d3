//! Verdicts that the samples of a dive would have for other targets and section lengths.

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
    /// Length of the sections that would pass.
    pub pass_m: f64,
    /// Length of the sections that would fail.
    pub fail_m: f64,
    /// Length of the sections that would neither pass nor fail, although no more samples will land.
    pub cannot_say_m: f64,
    /// Length of the sections that would still be open.
    pub open_m: f64,
    /// Length of the sections where some heads would not have been.
    pub not_inspected_m: f64,
}

impl Loop {
    /// Verdicts that the sections would have at present for another target, as section index and verdict.
    ///
    /// Only sections whose hole has been measured are included.
    pub fn verdicts_at(&self, target_m: f64) -> Vec<(i64, Verdict)> {
        self.view().coverage().sections.verdicts_at(target_m, &self.outlook()).collect()
    }
}
