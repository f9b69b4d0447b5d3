//! The tables `sections`, `holes` and `flags`: results for each section of the coverage extent.

use headrace_coverage::{Evidence, Unsure};
use headrace_monitor::section_row::SectionRow;

use crate::column::{Column, Get, Table, count};

fn evidence(row: &SectionRow) -> Option<&Evidence> {
    row.cause.as_ref()
}

fn cause(row: &SectionRow) -> Option<String> {
    evidence(row).map(|evidence| evidence.cause.as_str().to_owned())
}

fn causes(row: &SectionRow) -> Option<String> {
    evidence(row).map(|evidence| words(evidence.causes.iter()))
}

/// Joins the names of causes, the main cause first.
pub(super) fn words(causes: impl IntoIterator<Item = headrace_coverage::Cause>) -> String {
    causes.into_iter().map(headrace_coverage::Cause::as_str).collect::<Vec<_>>().join(",")
}

#[expect(clippy::too_many_lines, reason = "a line for each column")]
pub(crate) fn sections() -> Table<SectionRow> {
    Table {
        name: "sections",
        about: "A section of the coverage extent, in the order of chainage.",
        columns: vec![
            Column("chainage_m", "Chainage of its start, m", Get::Number(|row| Some(row.start_m))),
            Column("end_m", "Chainage of its end, m", Get::Number(|row| Some(row.end_m))),
            Column(
                "verdict",
                "`pass`, `fail`, `cannot_say` or `open`",
                Get::Text(|row| Some(row.verdict.as_str().to_owned())),
            ),
            Column(
                "cannot_say",
                "Reason for `cannot_say`",
                Get::Text(|row| {
                    row.cannot_say
                        .filter(|why| *why != Unsure::NotInspected)
                        .map(|why| why.as_str().to_owned())
                }),
            ),
            Column("cause", "Main cause, if the verdict is `fail`", Get::Text(cause)),
            Column("causes", "All causes, the main one first, separated by commas", Get::Text(causes)),
            Column(
                "not_inspected",
                "Open at an end or turning point that some heads have not passed",
                Get::Truth(|row| Some(row.not_inspected)),
            ),
            Column(
                "d_m",
                "Diameter D of its largest hole, m; null if not measured",
                Get::Number(|row| row.hole_m),
            ),
            Column(
                "d_sd_m",
                "Standard deviation of D, m",
                Get::Number(|row| row.hole_m.map(|_| row.hole_sd_m)),
            ),
            Column(
                "d_least_m",
                "Lower bound of D, m: thinned samples may have lain in the hole",
                Get::Number(|row| row.hole_least_m),
            ),
            Column("d_most_m", "Upper bound of D, m; null if unbounded", Get::Number(|row| row.hole_most_m)),
            Column(
                "d_bounded",
                "False if there are no samples around the hole: D is then at least `d_m`",
                Get::Truth(|row| row.hole_m.map(|_| row.hole_bounded)),
            ),
            Column("t_x_mean_m", "Mean distance between passes, m", Get::Number(|row| row.t_x.mean_m)),
            Column("t_x_most_m", "Largest distance between passes, m", Get::Number(|row| row.t_x.max_m)),
            Column(
                "t_y_mean_m",
                "Mean distance between neighbours of one sweep, m",
                Get::Number(|row| row.t_y.mean_m),
            ),
            Column(
                "t_y_most_m",
                "Largest distance between neighbours of one sweep, m",
                Get::Number(|row| row.t_y.max_m),
            ),
            Column("t_mean_m", "Mean lattice diagonal, m", Get::Number(|row| row.t.mean_m)),
            Column("t_most_m", "Largest lattice diagonal, m", Get::Number(|row| row.t.max_m)),
            Column("samples", "Number of samples", Get::Count(|row| count(row.samples))),
            Column(
                "density_perm2",
                "Samples per square metre of wall",
                Get::Number(|row| Some(row.density_perm2)),
            ),
            Column(
                "doubtful_returns",
                "Number of doubtful returns",
                Get::Count(|row| count(row.doubtful_returns)),
            ),
            Column(
                "suspect",
                "It has samples of a head that was distrusted soon after, and cannot pass",
                Get::Truth(|row| Some(row.suspect)),
            ),
            Column(
                "masked_share",
                "Share of its wall that is a declared opening",
                Get::Number(|row| Some(row.masked_share)),
            ),
            Column(
                "deviation_mean_m",
                "Mean deviation of its wall from the design, m, outwards positive",
                Get::Number(|row| row.deviation.map(|of| of.mean_m)),
            ),
            Column(
                "deviation_inmost_m",
                "Largest deviation inwards, m, at most zero",
                Get::Number(|row| row.deviation.map(|of| of.inmost_m)),
            ),
            Column(
                "deviation_outmost_m",
                "Largest deviation outwards, m, at least zero",
                Get::Number(|row| row.deviation.map(|of| of.outmost_m)),
            ),
            Column(
                "area_ratio",
                "Area of its cross-section, divided by the design's",
                Get::Number(|row| row.deviation.and_then(|of| of.area_ratio)),
            ),
            Column(
                "contradicts",
                "Most of its samples contradict the design profile",
                Get::Truth(|row| row.deviation.map(|of| of.contradicts)),
            ),
            Column("flagged_s", "Time of its flag, s of dive time", Get::Number(|row| row.flagged_s)),
            Column(
                "cleared_s",
                "Time at which a later pass cleared the flag, s of dive time",
                Get::Number(|row| row.cleared_s),
            ),
        ],
    }
}

/// A hole, and the adjacent sections that share it as their largest hole.
pub(crate) struct Hole<'a> {
    section: &'a SectionRow,
    end_m: f64,
    sections: i64,
}

/// The holes of a dive. A hole shared by several adjacent sections is listed once.
pub(crate) fn holes(sections: &[SectionRow]) -> Vec<Hole<'_>> {
    let place = |section: &SectionRow| {
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
        about: "The largest hole of a section. A hole shared by several neighbouring sections has one row.",
        columns: vec![
            Column("chainage_m", "Chainage of its centre, m", Get::Number(|row| row.section.hole_x_m)),
            Column(
                "arc_m",
                "Arc length of its centre, m from the floor's centre via the left wall",
                Get::Number(|row| row.section.hole_arc_m),
            ),
            Column(
                "clock",
                "Clock position of its centre, looking along the tunnel: 6 is the floor's centre, 9 the left wall",
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
                "Chainage of the start of the first of them, m",
                Get::Number(|row| Some(row.section.start_m)),
            ),
            Column(
                "sections_to_m",
                "Chainage of the end of the last of them, m",
                Get::Number(|row| Some(row.end_m)),
            ),
            Column(
                "verdict",
                "Verdict of the first of them",
                Get::Text(|row| Some(row.section.verdict.as_str().to_owned())),
            ),
        ],
    }
}

/// A flagged section, whether or not it was cleared.
pub(crate) struct Flag<'a>(&'a SectionRow);

pub(crate) fn flags(sections: &[SectionRow]) -> Vec<Flag<'_>> {
    sections.iter().filter(|section| section.flagged_s.is_some()).map(Flag).collect()
}

pub(crate) fn flags_table<'a>() -> Table<Flag<'a>> {
    Table {
        name: "flags",
        about: "A flagged section, cleared or not.",
        columns: vec![
            Column(
                "chainage_m",
                "Chainage of the section's start, m",
                Get::Number(|row| Some(row.0.start_m)),
            ),
            Column("end_m", "Chainage of its end, m", Get::Number(|row| Some(row.0.end_m))),
            Column("raised_s", "Time of its flag, s of dive time", Get::Number(|row| row.0.flagged_s)),
            Column(
                "cleared_s",
                "Time at which a later pass cleared it, s of dive time",
                Get::Number(|row| row.0.cleared_s),
            ),
            Column("cause", "Main cause, if the verdict is `fail`", Get::Text(|row| cause(row.0))),
            Column(
                "causes",
                "All causes, the main one first, separated by commas",
                Get::Text(|row| causes(row.0)),
            ),
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
                "Highest speed that would have met the target, m/s; zero if none",
                Get::Number(|row| evidence(row.0).map(|of| of.fits_mps)),
            ),
            Column(
                "with_losses_mps",
                "The same with the returns that were lost, m/s",
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
                "Swing of the beams along the tunnel between two passes, m",
                Get::Number(|row| evidence(row.0).map(|of| of.swing_m)),
            ),
        ],
    }
}
