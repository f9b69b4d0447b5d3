//! Observations in a report, for the tests of coverage.

use headrace_monitor::alert_list::ListedAlertJson;
use headrace_monitor::report::Report;

/// Alerts that report observations about the dive as a whole.
pub(crate) fn observed(report: &Report) -> Vec<&ListedAlertJson> {
    report.alert_list.iter().filter(|alert| alert.occurrences.is_some()).collect()
}
