//! Unsure stretches in the report: neighbouring sections that neither pass nor fail.

use serde::Serialize;

use crate::live_messages::UnsureStretch;
use crate::resources::Coverage;

/// Neighbouring sections that neither pass nor fail, all for the same reason, although no more samples will come.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoVerdictReport {
    /// Reason for the missing verdict: `not_inspected`, `position`, `several_stretches`, `doubtful_returns`,
    /// `distrusted_head`, `contradicted_profile`, `other_size` or `no_wall`.
    pub why: &'static str,
    /// Beginning of the stretch, m.
    pub start_m: f64,
    /// End of the stretch, m.
    pub end_m: f64,
    /// Length of the stretch's sections that neither pass nor fail, m.
    pub no_verdict_m: f64,
    /// Diameter of the stretch's largest hole, m.
    pub hole_m: f64,
    /// Standard deviation of the largest hole's diameter, m.
    pub hole_sd_m: f64,
    /// The stretch without a verdict, for the report as text.
    #[serde(skip)]
    pub stretch: UnsureStretch,
}

pub(super) fn unsure_reports(coverage: &Coverage) -> Vec<NoVerdictReport> {
    let sections = &coverage.sections;
    let stretches = sections.unsure_stretches(coverage.frontier.way());
    let report = |stretch: UnsureStretch| {
        let UnsureStretch { why, from_m, to_m, metres_m, hole_m, hole_sd_m, .. } = stretch;
        NoVerdictReport {
            why: why.as_str(),
            start_m: from_m,
            end_m: to_m,
            no_verdict_m: metres_m,
            hole_m,
            hole_sd_m,
            stretch,
        }
    };
    stretches.iter().map(|stretch| report(UnsureStretch::of(stretch, sections))).collect()
}
