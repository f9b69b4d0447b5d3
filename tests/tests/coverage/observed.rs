//! Observations in a report, for the tests of coverage.

use headrace_monitor::alert_list::ListedAlertJson;
use headrace_monitor::report::Report;

/// Alerts about observations, such as an impossible wall, that the report lists with their number of occurrences.
pub(crate) fn observed(report: &Report) -> Vec<&ListedAlertJson> {
    report.alert_list.iter().filter(|alert| alert.occurrences.is_some()).collect()
}
