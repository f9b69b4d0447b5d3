//! Tables of the report. All numbers are those of [`Report`], rounded.

use headrace_coverage::{Unsure, Verdict};
use headrace_monitor::pilot_text::station;
use headrace_monitor::report::{NoVerdictReport, Report, RunReport, SourceReport};
use headrace_monitor::section_row::SectionRow;
use headrace_monitor::unsure_stretch::unsure_text;
use headrace_monitor::words::NOT_INSPECTED;

use super::figures::{section_word, word};
use crate::document::Table;

/// Text for a value that doesn't exist.
pub(super) const NONE: &str = "-";

/// A length with its unit.
pub(super) fn metres(value_m: f64) -> String {
    format!("{value_m:.2} m")
}

fn or_none(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| NONE.to_owned(), |value| format!("{value:.decimals$}"))
}

fn table<const N: usize>(columns: [&str; N], rows: impl Iterator<Item = [String; N]>) -> Table {
    Table { columns: columns.map(str::to_owned).to_vec(), rows: rows.map(Vec::from).collect() }
}

/// Smallest number that is at least `value` and is 1, 2 or 5 times a power of ten, from 0.01 to 50.
pub(super) fn verdicts(report: &Report) -> Table {
    let sum = &report.summary;
    let rows = [
        (word(Verdict::Pass), sum.pass_m, "no hole is larger than the target"),
        (word(Verdict::Fail), sum.fail_m, "a hole is larger than the target"),
        (word(Verdict::CannotSay), sum.cannot_say_m, "inspected, but the data don't permit a verdict"),
        (NOT_INSPECTED, sum.not_inspected_m, "not passed by all heads"),
        (word(Verdict::Open), sum.open_m, "the dive ended before the verdict"),
    ];
    let rows = rows.into_iter().filter(|(name, length_m, _)| *length_m > 0.0 || *name != word(Verdict::Open));
    let row = |(name, length_m, meaning): (&str, f64, &str)| {
        [name.to_owned(), format!("{length_m:.2}"), meaning.to_owned()]
    };
    let total =
        ["coverage extent".to_owned(), format!("{:.2}", report.coverage_extent.length_m), "sum".to_owned()];
    table(["verdict", "length, m", "meaning"], rows.map(row).chain([total]))
}

/// Deviation of crown, left wall, right wall and floor from the design along the tunnel.
pub(super) fn missed(report: &Report) -> Table {
    let row = |run: &RunReport| {
        let refilled = match (run.merged_into, run.cleared_s) {
            (Some(other), _) => format!("part of {other}"),
            (None, Some(at_s)) => format!("yes, at {at_s:.0} s"),
            (None, None) => "no".to_owned(),
        };
        [
            run.id.to_string(),
            station(run.start_m),
            station(run.end_m),
            format!("{:.2}", run.failed_m),
            format!("{:.2}", run.hole_m),
            run.hole_clock.clone(),
            causes(run),
            format!("{:.0}", run.raised_s),
            refilled,
        ]
    };
    let columns = [
        "no.",
        "from",
        "to",
        "still missed, m",
        "largest hole, m",
        "at clock",
        "cause",
        "found at, s",
        "refilled",
    ];
    table(columns, report.runs.iter().map(row))
}

/// Causes of a missed stretch in words, the main cause first.
pub(super) fn causes(run: &RunReport) -> String {
    let causes: Vec<String> = run.causes.iter().map(|cause| cause.as_str().replace('_', " ")).collect();
    let silent = run.silent_sources.join(", ");
    if silent.is_empty() { causes.join(", ") } else { format!("{} ({silent})", causes.join(", ")) }
}

/// Reason for which a stretch has no verdict.
pub(super) fn reason(stretch: &NoVerdictReport) -> String {
    match stretch.stretch.why {
        Unsure::Position => "the position is too uncertain for this hole".to_owned(),
        Unsure::NotInspected => "not passed by all heads".to_owned(),
        _ => unsure_text(&stretch.stretch),
    }
}

/// Stretches without a verdict.
pub(super) fn no_verdict(report: &Report) -> Table {
    let row = |stretch: &NoVerdictReport| {
        let metres = [stretch.no_verdict_m, stretch.hole_m, stretch.hole_sd_m];
        let [length, hole, sd] = metres.map(|value_m| format!("{value_m:.2}"));
        [station(stretch.start_m), station(stretch.end_m), length, hole, sd, reason(stretch)]
    };
    let columns = ["from", "to", "without verdict, m", "largest hole, m", "sd of hole, m", "reason"];
    table(columns, report.no_verdict.iter().map(row))
}

/// Neighbouring sections with the same verdict.
pub(super) fn by_chainage(report: &Report) -> Table {
    let runs = report.sections.chunk_by(|a, b| section_word(a) == section_word(b));
    let row = |run: &[SectionRow]| {
        let (first, last) = (run.first()?, run.last()?);
        let hole_m = run.iter().filter_map(|row| row.hole_m).max_by(f64::total_cmp);
        let least = run.iter().map(|row| row.density_perm2).min_by(f64::total_cmp);
        let verdict = section_word(first).to_owned();
        Some([station(first.start_m), station(last.end_m), verdict, or_none(hole_m, 2), or_none(least, 1)])
    };
    let columns = ["from", "to", "verdict", "largest hole, m", "least samples per m²"];
    table(columns, runs.filter_map(row))
}

/// Stretches of wall outside the design.
pub(super) fn off_design(report: &Report) -> Table {
    let rows = report.wall_stretches.iter().map(|stretch| {
        let metres =
            [stretch.mean_m, stretch.inmost_m, stretch.outmost_m].map(|value_m| format!("{value_m:.2}"));
        let [mean, inmost, outmost] = metres;
        [station(stretch.from_m), station(stretch.to_m), mean, inmost, outmost]
    });
    table(["from", "to", "mean deviation, m", "most inwards, m", "most outwards, m"], rows)
}

/// Declared openings.
pub(super) fn openings(report: &Report) -> Table {
    let rows = report.openings.iter().map(|opening| {
        let (from_m, length_m) = (opening.arc_from_m, opening.arc_length_m);
        let ends = [station(opening.from_m), station(opening.to_m)];
        let [from, to] = ends;
        [opening.name.clone(), from, to, or_none(from_m, 2), or_none(length_m, 2)]
    });
    table(["opening", "from", "to", "wall from floor, m", "length along the wall, m"], rows)
}

/// Sensors with their gaps and losses.
pub(super) fn sensors(report: &Report) -> Table {
    let row = |source: &SourceReport| {
        let dropped = source.line.as_ref().map(|line| line.dropped_packets);
        [
            source.id.clone(),
            source.plugin.clone(),
            source.readings.to_string(),
            format!("{:.1}", source.rate_hz),
            format!("{:.1}", source.longest_gap_s),
            or_none(source.silent_at_end_s, 1),
            source.bad_frames.to_string(),
            source.withheld.to_string(),
            dropped.map_or_else(|| NONE.to_owned(), |count| count.to_string()),
        ]
    };
    let columns = [
        "sensor",
        "kind",
        "readings",
        "packets per s",
        "longest gap, s",
        "silent at end, s",
        "bad frames",
        "withheld",
        "dropped packets",
    ];
    table(columns, report.sources.iter().map(row))
}

/// Pings that gave no sample, by reason.
pub(super) fn rejected(report: &Report) -> Table {
    let rejected = &report.dive.samples_rejected;
    let rows = [
        ("no return although the wall was in range", rejected.missing),
        ("wall beyond the range setting", rejected.out_of_range),
        ("beam blocked by the vehicle", rejected.occluded),
        ("no position", rejected.no_fix),
        ("beyond the ends of the tunnel", rejected.outside),
        ("return not accepted as wall", rejected.doubtful_returns),
        ("sample store full", rejected.not_stored),
    ];
    let rows = rows.into_iter().filter(|(_, count)| *count > 0);
    table(["reason", "pings"], rows.map(|(reason, count)| [reason.to_owned(), count.to_string()]))
}

/// Times without a position.
pub(super) fn position_gaps(report: &Report) -> Table {
    let place = |x_m: Option<f64>| x_m.map_or_else(|| NONE.to_owned(), station);
    let rows = report.position_gaps.iter().map(|gap| {
        let times = [format!("{:.0}", gap.from_s), format!("{:.0}", gap.to_s)];
        let [from_s, to_s] = times;
        [from_s, to_s, gap.pings.to_string(), place(gap.from_m), place(gap.to_m)]
    });
    table(["from, s", "to, s", "pings", "from", "to"], rows)
}

/// Notes of the crew.
pub(super) fn notes(report: &Report) -> Table {
    let rows = report.notes.iter().map(|note| {
        let place = note.station.clone().unwrap_or_else(|| NONE.to_owned());
        [note.number.to_string(), format!("{:.0}", note.at_s), place, note.by.clone(), note.words()]
    });
    table(["no.", "at, s", "station", "by", "note"], rows)
}
