//! `sections`, `holes` and `flags`: the results of the sections of the coverage extent.

use headrace_coverage::Evidence;
use headrace_monitor::report::SectionReport;

use crate::column::{Column, Get, Table, count};

fn evidence(row: &SectionReport) -> Option<&Evidence> {
    row.cause.as_ref()
}

fn cause(row: &SectionReport) -> Option<String> {
    evidence(row).map(|evidence| evidence.cause.as_str().to_owned())
}

fn causes(row: &SectionReport) -> Option<String> {
    evidence(row).map(|evidence| words(evidence.causes.iter()))
}

/// Names of causes, the main one first.
pub(super) fn words(causes: impl IntoIterator<Item = headrace_coverage::Cause>) -> String {
    causes.into_iter().map(headrace_coverage::Cause::as_str).collect::<Vec<_>>().join(",")
}

#[expect(clippy::too_many_lines, reason = "a line for each column")]
pub(crate) fn sections() -> Table<SectionReport> {
    Table {
        name: "sections",
        about: "A section of the way, in the order of chainage.",
        columns: vec![
            Column("chainage_m", "Where it begins, m from the portal", Get::Number(|row| Some(row.start_m))),
            Column("end_m", "Where it ends, m", Get::Number(|row| Some(row.end_m))),
            Column(
                "verdict",
                "`pass`, `fail`, `cannot_say` or `open`",
                Get::Text(|row| Some(row.verdict.to_owned())),
            ),
            Column("cannot_say", "Why it can't be said", Get::Text(|row| row.cannot_say.map(str::to_owned))),
            Column("cause", "Main cause, while the verdict is `fail`", Get::Text(cause)),
            Column(
                "causes",
                "All causes without which it would have passed, the main one first, with commas",
                Get::Text(causes),
            ),
            Column(
                "not_inspected",
                "Open, and going on won't change it: not all heads have been there",
                Get::Truth(|row| Some(row.not_inspected)),
            ),
            Column(
                "d_m",
                "Diameter D of its largest hole, m; null where it wasn't measured",
                Get::Number(|row| row.hole_m),
            ),
            Column(
                "d_sd_m",
                "Standard deviation of D, m",
                Get::Number(|row| row.hole_m.map(|_| row.hole_sd_m)),
            ),
            Column(
                "d_least_m",
                "Lower bound of D, m: thinned samples may have divided it",
                Get::Number(|row| row.hole_least_m),
            ),
            Column("d_most_m", "Upper bound of D, m; null if unbounded", Get::Number(|row| row.hole_most_m)),
            Column(
                "d_bounded",
                "False if there are no samples around the hole: D is then at least `d_m`",
                Get::Truth(|row| row.hole_m.map(|_| row.hole_bounded)),
            ),
            Column("t_x_mean_m", "Mean distance between passes, m", Get::Number(|row| row.t_x.mean_m)),
            Column("t_x_most_m", "Greatest distance between passes, m", Get::Number(|row| row.t_x.max_m)),
            Column(
                "t_y_mean_m",
                "Mean distance between neighbours of one sweep, m",
                Get::Number(|row| row.t_y.mean_m),
            ),
            Column(
                "t_y_most_m",
                "Greatest distance between neighbours of one sweep, m",
                Get::Number(|row| row.t_y.max_m),
            ),
            Column("t_mean_m", "Mean lattice diagonal, m", Get::Number(|row| row.t.mean_m)),
            Column("t_most_m", "Greatest lattice diagonal, m", Get::Number(|row| row.t.max_m)),
            Column("samples", "Samples on it", Get::Count(|row| count(row.samples))),
            Column(
                "density_perm2",
                "Samples per square metre of wall",
                Get::Number(|row| Some(row.density_perm2)),
            ),
            Column(
                "doubtful_returns",
                "Returns on it that weren't taken for wall",
                Get::Count(|row| count(row.doubtful_returns)),
            ),
            Column(
                "suspect",
                "It holds samples of a head that wasn't believed soon after; it can't pass",
                Get::Truth(|row| Some(row.suspect)),
            ),
            Column(
                "masked_share",
                "Share of its wall that is a declared opening",
                Get::Number(|row| Some(row.masked_share)),
            ),
            Column(
                "deviation_mean_m",
                "Mean deviation of its wall from the design, m, outward positive",
                Get::Number(|row| row.deviation.map(|of| of.mean_m)),
            ),
            Column(
                "deviation_inmost_m",
                "Greatest deviation inward, m, at most zero",
                Get::Number(|row| row.deviation.map(|of| of.inmost_m)),
            ),
            Column(
                "deviation_outmost_m",
                "Greatest deviation outward, m, at least zero",
                Get::Number(|row| row.deviation.map(|of| of.outmost_m)),
            ),
            Column(
                "area_ratio",
                "Its cross-section over the design's",
                Get::Number(|row| row.deviation.and_then(|of| of.area_ratio)),
            ),
            Column(
                "contradicts",
                "Most of its samples contradict the design profile",
                Get::Truth(|row| row.deviation.map(|of| of.contradicts)),
            ),
            Column(
                "flagged_s",
                "When it was flagged, s on the log's clock",
                Get::Number(|row| row.flagged_s),
            ),
            Column(
                "cleared_s",
                "When a later pass cleared the flag, s on the log's clock",
                Get::Number(|row| row.cleared_s),
            ),
        ],
    }
}

/// A hole, and the sections that have it as their largest.
pub(crate) struct Hole<'a> {
    section: &'a SectionReport,
    end_m: f64,
    sections: i64,
}

/// The holes of a dive. A hole shared by several adjacent sections occurs once.
pub(crate) fn holes(sections: &[SectionReport]) -> Vec<Hole<'_>> {
    let place = |section: &SectionReport| {
        [section.hole_m, section.hole_x_m, section.hole_arc_m].map(|number| number.map(f64::to_bits))
    };
    let mut holes: Vec<Hole<'_>> = Vec::new();
    for section in sections.iter().filter(|section| section.hole_m.is_some()) {
        match holes.last_mut().filter(|hole| place(hole.section) == place(section)) {
            Some(hole) => (hole.end_m, hole.sections) = (section.end_m, hole.sections + 1),
            None => holes.push(Hole { section, end_m: section.end_m, sections: 1 }),
        }
    }
    holes
}

pub(crate) fn holes_table<'a>() -> Table<Hole<'a>> {
    Table {
        name: "holes",
        about: "The largest hole of a section; one that neighbouring sections share is one row.",
        columns: vec![
            Column("chainage_m", "Chainage of its centre, m", Get::Number(|row| row.section.hole_x_m)),
            Column(
                "arc_m",
                "Arc length of its centre, m from the floor's centre via the left wall",
                Get::Number(|row| row.section.hole_arc_m),
            ),
            Column(
                "clock",
                "The same on a clock seen along the tunnel: 6 is the floor's centre, 9 the left wall",
                Get::Text(|row| row.section.hole_clock.clone()),
            ),
            Column("d_m", "Its diameter D, m", Get::Number(|row| row.section.hole_m)),
            Column("d_sd_m", "Standard deviation of D, m", Get::Number(|row| Some(row.section.hole_sd_m))),
            Column("d_least_m", "Lower bound of D, m", Get::Number(|row| row.section.hole_least_m)),
            Column(
                "d_most_m",
                "Upper bound of D, m; null if unbounded",
                Get::Number(|row| row.section.hole_most_m),
            ),
            Column(
                "d_bounded",
                "False if there are no samples around it: D is then at least `d_m`",
                Get::Truth(|row| Some(row.section.hole_bounded)),
            ),
            Column("sections", "Sections that share it", Get::Count(|row| Some(row.sections))),
            Column(
                "sections_from_m",
                "Where the first of them begins, m",
                Get::Number(|row| Some(row.section.start_m)),
            ),
            Column("sections_to_m", "Where the last of them ends, m", Get::Number(|row| Some(row.end_m))),
            Column(
                "verdict",
                "Verdict of the first of them",
                Get::Text(|row| Some(row.section.verdict.to_owned())),
            ),
        ],
    }
}

/// A flagged section, whether or not it was cleared.
pub(crate) struct Flag<'a>(&'a SectionReport);

pub(crate) fn flags(sections: &[SectionReport]) -> Vec<Flag<'_>> {
    sections.iter().filter(|section| section.flagged_s.is_some()).map(Flag).collect()
}

pub(crate) fn flags_table<'a>() -> Table<Flag<'a>> {
    Table {
        name: "flags",
        about: "A section that was flagged, cleared since or not.",
        columns: vec![
            Column("chainage_m", "Where the section begins, m", Get::Number(|row| Some(row.0.start_m))),
            Column("end_m", "Where it ends, m", Get::Number(|row| Some(row.0.end_m))),
            Column(
                "raised_s",
                "When it was flagged, s on the log's clock",
                Get::Number(|row| row.0.flagged_s),
            ),
            Column(
                "cleared_s",
                "When a later pass cleared it, s on the log's clock",
                Get::Number(|row| row.0.cleared_s),
            ),
            Column("cause", "Main cause, while the verdict is `fail`", Get::Text(|row| cause(row.0))),
            Column("causes", "All causes, the main one first, with commas", Get::Text(|row| causes(row.0))),
            Column("d_m", "Diameter D of its largest hole, m", Get::Number(|row| row.0.hole_m)),
            Column(
                "d_sd_m",
                "Standard deviation of D, m",
                Get::Number(|row| row.0.hole_m.map(|_| row.0.hole_sd_m)),
            ),
            Column(
                "speed_mps",
                "Speed along the tunnel, m/s",
                Get::Number(|row| evidence(row.0).map(|of| of.speed_mps)),
            ),
            Column(
                "fits_mps",
                "Greatest speed that would have met the target, m/s; zero if none",
                Get::Number(|row| evidence(row.0).map(|of| of.fits_mps)),
            ),
            Column(
                "with_losses_mps",
                "The same as returns were lost, m/s",
                Get::Number(|row| evidence(row.0).map(|of| of.with_losses_mps)),
            ),
            Column(
                "missing_share",
                "Share of pings without a return",
                Get::Number(|row| evidence(row.0).map(|of| of.missing_share)),
            ),
            Column(
                "occluded_share",
                "Share of pings occluded by the vehicle",
                Get::Number(|row| evidence(row.0).map(|of| of.occluded_share)),
            ),
            Column(
                "standing_share",
                "Share of pings of a stalled head",
                Get::Number(|row| evidence(row.0).map(|of| of.standing_share)),
            ),
            Column(
                "swing_m",
                "How far the beams swung along the tunnel between two passes, m",
                Get::Number(|row| evidence(row.0).map(|of| of.swing_m)),
            ),
        ],
    }
}
