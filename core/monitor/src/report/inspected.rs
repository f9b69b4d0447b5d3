//! Whether a dive is an inspection at all, and the coverage extent.

use serde::Serialize;

use crate::resources::{Coverage, Tally};
use crate::run::Loop;
use headrace_fusion::NoFix;

/// A dive with a larger share of pings without a position counts as no inspection, because its verdicts mean nothing.
const MOST: f64 = 0.5;

/// Coverage extent: whole sections of tunnel in which the vehicle or its heads have been, whether the heads
/// pinged or not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CoverageExtentReport {
    /// Beginning of the extent's first section, m; `None` without a position.
    pub from_m: Option<f64>,
    /// End of the extent's last section, m.
    pub to_m: Option<f64>,
    /// Length of the extent, m: the sum over all verdicts.
    pub length_m: f64,
}

/// Reason for which a dive is no inspection.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotInspectedReport {
    /// Reason: `no_sonar`, `no_position`, `outside_tunnel` or `mostly_no_position`.
    pub reason: &'static str,
    /// Requirement for a position that was missing most often when a return had no position.
    ///
    /// One of `no_heading`, `no_chainage` and `no_place_in_section`.
    pub missing: Option<&'static str>,
    /// Share of pings that have no position.
    pub without_position_share: f64,
    /// Sources that never delivered a reading.
    pub silent_sources: Vec<String>,
}

pub(super) fn way_report(coverage: &Coverage) -> CoverageExtentReport {
    let sections = &coverage.sections;
    let way = sections.sections_of(coverage.frontier.way());
    if way.is_empty() {
        return CoverageExtentReport { from_m: None, to_m: None, length_m: 0.0 };
    }
    let (from_m, to_m) = (sections.bounds_m(way.start).0, sections.bounds_m(way.end).0);
    CoverageExtentReport { from_m: Some(from_m), to_m: Some(to_m), length_m: to_m - from_m }
}

pub(super) fn not_inspected(dive: &Loop) -> Option<NotInspectedReport> {
    let tally = dive.view().tally();
    let pings = pings(tally);
    let share = if pings > 0 { tally.without_fix as f64 / pings as f64 } else { 0.0 };
    let reason = match share {
        _ if pings == 0 => "no_sonar",
        share if share >= 1.0 => "no_position",
        _ if way_report(dive.view().coverage()).from_m.is_none() => "outside_tunnel",
        share if share > MOST => "mostly_no_position",
        _ => return None,
    };
    let most = NoFix::ALL.into_iter().zip(tally.no_fix).filter(|(_, count)| *count > 0);
    let most = most.max_by_key(|(_, count)| *count).map(|(no_fix, _)| no_fix.as_str());
    let silent = dive.sources().iter().zip(dive.view().health()).filter(|(_, health)| health.readings == 0);
    Some(NotInspectedReport {
        reason,
        missing: most,
        without_position_share: share,
        silent_sources: silent.map(|(source, _)| source.id.clone()).collect(),
    })
}

/// Number of pings of profiling heads, whatever their outcome.
pub(super) fn pings(tally: &Tally) -> u64 {
    tally.samples + tally.missing + tally.out_of_range + tally.occluded + tally.unplaced
}
