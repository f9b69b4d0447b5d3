//! Wall that differs from the vehicle file, in the report: stretches off the design profile, undeclared openings.

use serde::Serialize;

use crate::resources::Coverage;
use headrace_coverage::openings::Opening;
use headrace_coverage::{Run, WallStretch};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

/// A stretch of wall that differs from the design profile, on average by at least 4 % of the equivalent radius.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WallStretchReport {
    /// Beginning of the stretch, m.
    pub from_m: f64,
    /// End of the stretch, m.
    pub to_m: f64,
    /// Mean deviation of the stretch's samples from the design, m; positive is outside.
    pub mean_m: f64,
    /// Largest inward deviation, m; never above zero.
    pub inmost_m: f64,
    /// Largest outward deviation, m; never below zero.
    pub outmost_m: f64,
}

/// An opening that the vehicle file doesn't declare but that explains a missed stretch. The fields are keys of the
/// vehicle file's `openings`, rounded outward.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SuggestedOpeningReport {
    /// Display name of the opening.
    pub name: String,
    /// Chainage of the opening's beginning, m.
    pub from_m: f64,
    /// Chainage of the opening's end, m.
    pub to_m: f64,
    /// Clock position at which the opening begins, hours.
    pub clock_from: f64,
    /// Clock position at which the opening ends, hours.
    pub clock_to: f64,
}

pub(super) fn wall_stretches(coverage: &Coverage, profile: &Profile) -> Vec<WallStretchReport> {
    let Coverage { sections, frontier, .. } = coverage;
    let report = |stretch: WallStretch| {
        let WallStretch { from, to, mean_m, inmost_m, outmost_m } = stretch;
        let [from_m, to_m] = [sections.bounds_m(from).0, sections.bounds_m(to - 1).1];
        WallStretchReport { from_m, to_m, mean_m, inmost_m, outmost_m }
    };
    sections.wall_stretches(frontier.way(), profile.perimeter_m()).into_iter().map(report).collect()
}

pub(super) fn suggested_openings(
    coverage: &Coverage,
    profile: &Profile,
    end_m: f64,
) -> Vec<SuggestedOpeningReport> {
    let sections = &coverage.sections;
    let open = sections.runs().all().iter().filter(|run| run.is_open());
    let suggested = open.filter_map(|run: &Run| sections.suggested_opening(run, profile));
    suggested.filter_map(|opening| suggestion(&opening, profile, end_m)).collect()
}

/// The opening in the vehicle file's keys, rounded outward to decimetres and tenths of an hour, but within the
/// tunnel.
fn suggestion(opening: &Opening, profile: &Profile, end_m: f64) -> Option<SuggestedOpeningReport> {
    let (arc_m, length_m) = opening.arc_m?;
    let below = |value: f64| math::floor_to_i64(value * 10.0) as f64 / 10.0;
    let above = |value: f64| -below(-value);
    let hour = |arc_m: f64| profile.hour(math::wrap(arc_m, profile.perimeter_m()));
    Some(SuggestedOpeningReport {
        name: opening.name.clone(),
        from_m: below(opening.from_m).max(0.0),
        to_m: above(opening.to_m).min(end_m),
        clock_from: below(hour(arc_m)),
        clock_to: above(hour(arc_m + length_m)),
    })
}
