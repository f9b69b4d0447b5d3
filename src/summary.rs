//! Summary of a report as text.

use headrace_config::plain::one_line;
use headrace_coverage::{Action, Metres, Unsure, Verdict};
use headrace_monitor::live_messages::UnsureStretch;
use headrace_monitor::live_text::{helps_text, metres_text, of_it_text, unsure_text};
use headrace_monitor::other_targets::OtherTargetReport;
use headrace_monitor::pilot_text::{actions_text, cause_text, station};
use headrace_monitor::report::{ChangeReport, JudgedReport, SmoothingReport};
use headrace_monitor::report::{
    DiveReport, NotInspectedReport, PositionGapReport, Report, RunReport, SourceReport,
    SuggestedOpeningReport, WallStretchReport,
};

use crate::terminal;

/// A sensor's period without data is reported if it is at least this long, s.
const SILENT_S: f64 = 5.0;
/// Maximum number of notes that the summary lists.
const MOST_NOTES: usize = 20;

/// Summary of a report as text. Lines are broken to at most `columns` columns, if given.
pub(crate) fn summary(report: &Report, columns: Option<usize>) -> String {
    let mut text = String::new();
    let mut line = |words: String| {
        for part in broken(&one_line(&words), columns) {
            text.push_str(&part);
            text.push('\n');
        }
    };
    let dive = &report.dive;
    if let Some(why) = &report.not_inspected {
        line(not_inspected_text(why, dive));
    }
    if let (Some(from_m), Some(to_m)) = (report.coverage_extent.from_m, report.coverage_extent.to_m) {
        line(format!(
            "{} to {}: {:.2} m in {:.0} s, {} samples, target {} m",
            station(from_m),
            station(to_m),
            report.coverage_extent.length_m,
            dive.duration_s,
            dive.samples_valid,
            report.target_m,
        ));
        line(format!("  {}", metres(&report.metres())));
        for stretch in stretches(report) {
            line(stretch);
        }
        report.suggested_openings.iter().flat_map(declaration).for_each(&mut line);
        for other in &report.other_targets {
            let OtherTargetReport { target_m, section_m, .. } = other;
            line(format!("  with target {target_m} m in sections of {section_m} m: {}", metres(other)));
        }
        if terminal::is_verbose() {
            line(spacing(report));
        }
    }
    for change in report.smoothing.iter().flat_map(smoothing) {
        line(change);
    }
    let rejected = &dive.samples_rejected;
    let lost = [
        (rejected.missing, "pings without a return"),
        (rejected.out_of_range, "pings beyond the range setting"),
        (rejected.occluded, "pings blocked by the vehicle itself"),
        (rejected.no_fix, "returns without a position"),
        (rejected.outside, "returns beyond the ends of the tunnel"),
        (rejected.not_stored, "returns not stored: the sample store was full"),
    ];
    for (count, what) in lost.iter().filter(|(count, _)| *count > 0) {
        line(format!("  {count} {what}"));
    }
    for silent in report.sources.iter().filter_map(silence) {
        line(silent);
    }
    for source in &report.sources {
        let strangers = source.line.as_ref().map_or(0, |line| line.ignored);
        if strangers > 0 {
            line(format!(
                "  {strangers} messages on the line of {} came from other devices and were ignored",
                source.id
            ));
        }
    }
    for source in report.sources.iter().filter_map(dropped) {
        line(source);
    }
    for note in report.notes.iter().take(MOST_NOTES) {
        let place = note.station.clone().unwrap_or_else(|| "-+---.--".to_owned());
        let by = if note.by.is_empty() { String::new() } else { format!(" ({})", note.by) };
        line(format!("  {} at {place}: {}{by}", note.number, note.words()));
    }
    if report.notes.len() > MOST_NOTES {
        line(format!("  and {} further notes in the report", report.notes.len() - MOST_NOTES));
    }
    if report.notes_dropped > 0 {
        line(format!("  {} more notes are in the log only", report.notes_dropped));
    }
    for loss in report.log.iter().flat_map(|log| &log.losses) {
        line(format!("  LOST: {loss}"));
    }
    for note in report.log.iter().flat_map(|log| &log.notes) {
        line(format!("  note: {note}"));
    }
    if terminal::is_verbose() {
        line(format!("digest {}", report.digest));
    }
    text
}

/// Text for engineers: the confidence, the largest hole of the inspected sections and the spacing of samples.
fn spacing(report: &Report) -> String {
    let metres = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
    let sum = &report.summary;
    let inspected = report.sections.iter().filter(|section| section.verdict != Verdict::Open);
    let largest_m = inspected.filter_map(|section| section.hole_m).max_by(f64::total_cmp);
    format!(
        "  confidence {} sd   largest hole {} m   T_x mean {} m   T_y max {} m",
        report.confidence_sd,
        metres(largest_m),
        metres(sum.t_x.mean_m),
        metres(sum.t_y.max_m)
    )
}

/// Text about a sensor's packets that were dropped before they were read.
fn dropped(source: &SourceReport) -> Option<String> {
    let count = source.line.as_ref()?.dropped_packets;
    let line = format!(
        "  LOST: {count} messages on the line of {} were dropped unread: the computer stalled",
        source.id
    );
    (count > 0).then_some(line)
}

/// Text about a sensor's periods without data, if they are long enough to be reported.
///
/// If a dive has no position or no sonar, another line names the silent sensors.
fn silence(source: &SourceReport) -> Option<String> {
    let id = &source.id;
    if let Some(why) = &source.no_reading {
        return Some(format!("  {id}: {why}"));
    }
    match source.silent_at_end_s {
        None => Some(format!("  {id} sent nothing")),
        Some(end_s) if end_s > SILENT_S => Some(format!("  {id} silent for the last {end_s:.0} s")),
        Some(_) if source.longest_gap_s > SILENT_S => {
            Some(format!("  {id} silent for up to {:.0} s", source.longest_gap_s))
        }
        Some(_) => None,
    }
}

/// Text that explains why a dive is no inspection.
fn not_inspected_text(why: &NotInspectedReport, dive: &DiveReport) -> String {
    let missing = why
        .missing
        .map_or_else(|| "position".to_owned(), |missing| missing.trim_start_matches("no_").replace('_', " "));
    let text = match why.reason {
        "no_sonar" => {
            return "NO COVERAGE: no profiling sonar returns in this dive; nothing was inspected".to_owned();
        }
        "outside_tunnel" => return outside_text(dive),
        "no_position" => {
            format!("NO VERDICTS: the vehicle never had a position, because the {missing} was unknown")
        }
        _ => format!(
            "NO INSPECTION: {:.0} % of the pings had no position, mostly because of missing {missing}",
            why.without_position_share * 100.0
        ),
    };
    match why.silent_sources.as_slice() {
        [] => text,
        silent => format!("{text}; {} sent nothing", silent.join(", ")),
    }
}

/// Text about a dive that was never within the tunnel. It states the positions of the heads, and the settings
/// to check.
fn outside_text(dive: &DiveReport) -> String {
    let place = match (dive.from_m, dive.to_m) {
        (Some(from_m), Some(to_m)) => format!(" from {} to {}", station(from_m), station(to_m)),
        _ => String::new(),
    };
    format!("NO VERDICTS: the heads were outside the tunnel{place}: check the tether's zero and length_m")
}

/// Length of tunnel with each verdict, as text.
fn metres(judged: &OtherTargetReport) -> String {
    let OtherTargetReport { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m, .. } = *judged;
    metres_text(&Metres { pass_m, fail_m, cannot_say_m, open_m, not_inspected_m })
}

/// Lines about the missed and the unsure stretches, in the order of chainage. Each line gives place, problem and
/// action.
fn stretches(report: &Report) -> Vec<String> {
    let fails = |run: &&RunReport| {
        let mut within =
            report.sections.iter().filter(|section| (run.start_m..run.end_m).contains(&section.start_m));
        within.any(|section| section.verdict == Verdict::Fail)
    };
    // Missed sections that were passed again and then have no verdict are listed as unsure, not here.
    let open = report.runs.iter().filter(|run| run.cleared_s.is_none()).filter(fails);
    let mut all: Vec<(f64, String)> = open.map(|run| (run.start_m, missed(run, report))).collect();
    all.extend(report.no_verdict.iter().map(|stretch| (stretch.start_m, unsure(&stretch.stretch))));
    all.extend(report.wall_stretches.iter().map(|stretch| (stretch.from_m, off_design(stretch))));
    all.extend(report.position_gaps.iter().filter_map(|gap| without_position(gap, report)));
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, text)| text).collect()
}

fn missed(run: &RunReport, report: &Report) -> String {
    let heads = &report.heads;
    let figures = run.figures.as_ref();
    let cause = figures.map_or_else(|| run.cause.as_str().to_owned(), |figures| cause_text(figures, heads));
    let back = report.go_back.iter().find(|back| back.run == run.id);
    let action = back
        .map(|back| format!("  -> {}", actions_text(&back.actions, back.back_to_m, back.at_most_mps, heads)));
    // The other sections of the missed stretch pass or no longer have a verdict, so the failed length is stated.
    let of_it = of_it_text(run.failed_m, run.end_m - run.start_m);
    format!(
        "  {} to {}{of_it}  MISSED: {cause}, holes up to {:.2} m{}",
        station(run.start_m),
        station(run.end_m),
        run.hole_m,
        action.unwrap_or_default()
    )
}

fn unsure(stretch: &UnsureStretch) -> String {
    let what = if stretch.why == Unsure::NotInspected { "NOT INSPECTED" } else { "CAN'T SAY" };
    let (from, to) = (station(stretch.from_m), station(stretch.to_m));
    let mut helps = helps_text(stretch);
    if !helps.is_empty() {
        helps.insert_str(0, "  -> ");
    }
    let of_it = of_it_text(stretch.metres_m, stretch.to_m - stretch.from_m);
    format!("  {from} to {to}{of_it}  {what}: {}{helps}", unsure_text(stretch))
}

fn off_design(stretch: &WallStretchReport) -> String {
    let WallStretchReport { from_m, to_m, mean_m, inmost_m, outmost_m } = *stretch;
    let (side, most_m) = if mean_m > 0.0 { ("outside", outmost_m) } else { ("inside", inmost_m) };
    let (from, to) = (station(from_m), station(to_m));
    format!("  {from} to {to}  WALL: {:.2} m {side} the design, up to {:.2} m", mean_m.abs(), most_m.abs())
}

/// Lines that declare a suggested opening in the vehicle file.
fn declaration(opening: &SuggestedOpeningReport) -> Vec<String> {
    let SuggestedOpeningReport { name, from_m, to_m, clock_from, clock_to } = opening;
    let place = format!("{} to {}", station(*from_m), station(*to_m));
    vec![
        format!("  If the wall has an opening at {place}, append to the vehicle file:"),
        "    [[openings]]".to_owned(),
        format!("    name = \"{name}\""),
        format!("    from_m = {from_m}"),
        format!("    to_m = {to_m}"),
        format!("    clock_from = {clock_from}"),
        format!("    clock_to = {clock_to}"),
    ]
}

/// Line about a position gap that no fix has ended, and the gap's lower chainage. Sections in all other gaps have
/// verdicts.
fn without_position(gap: &PositionGapReport, report: &Report) -> Option<(f64, String)> {
    let (from_m, to_m, back_to_m) = (gap.from_m?, gap.to_m?, gap.back_to_m?);
    if gap.is_over {
        return None;
    }
    let action = actions_text(&[Action::Position], back_to_m, 0.0, &report.heads);
    // As in all lines, the lower chainage comes first, also if the vehicle was on its way back.
    let place = if from_m <= to_m {
        format!("{} to about {}", station(from_m), station(to_m))
    } else {
        format!("about {} to {}", station(to_m), station(from_m))
    };
    let text = format!("  {place}  NO POSITION: scanned for {:.0} s  -> {action}", gap.to_s - gap.from_s);
    Some((from_m.min(to_m), text))
}

/// A line broken to `columns` columns, if given. Continuation lines are indented.
pub(crate) fn broken(line: &str, columns: Option<usize>) -> Vec<String> {
    let Some(columns) = columns.filter(|columns| line.chars().count() > *columns) else {
        return vec![line.to_owned()];
    };
    let indent = line.len() - line.trim_start().len();
    let mut lines = vec![" ".repeat(indent)];
    for word in line.split(' ').skip(indent) {
        let Some(last) = lines.last_mut() else { continue };
        if last.chars().count() + 1 + word.chars().count() > columns && !last.trim().is_empty() {
            last.truncate(last.trim_end().len());
            lines.push(format!("{}{word}", " ".repeat(indent + 4)));
        } else {
            if !last.trim().is_empty() {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines
}

/// Lines about the effect of smoothing: the length with each verdict, and a line for each series of neighbouring
/// sections with the same change.
fn smoothing(report: &SmoothingReport) -> Vec<String> {
    let was = &report.before;
    let mut lines = vec![format!(
        "  smoothed {} estimates; with the filter alone: passed {:.2} m   missed {:.2} m   can't say {:.2} m   open {:.2} m   not inspected {:.2} m",
        report.estimates, was.pass_m, was.fail_m, was.cannot_say_m, was.open_m, was.not_inspected_m
    )];
    if report.changed.is_empty() {
        lines.push("  no verdict has changed".to_owned());
    }
    let mut rest = report.changed.as_slice();
    while let Some(first) = rest.first() {
        let mut end_m = first.start_m;
        let len = rest.iter().take_while(|next| follows(first, next, &mut end_m)).count();
        let (run, after) = rest.split_at(len);
        rest = after;
        lines.push(format!(
            "  {} to {}  changed: {} to {}, holes {} to {} m",
            station(first.start_m),
            station(end_m),
            verdict_text(first.before),
            verdict_text(first.after),
            holes(run.iter().filter_map(|change| change.before)),
            holes(run.iter().filter_map(|change| change.after)),
        ));
    }
    lines
}

/// Whether a section's change of verdict continues a series of equal changes that ends at chainage `end_m`, m. If so,
/// `end_m` becomes the end of this section.
fn follows(first: &ChangeReport, next: &ChangeReport, end_m: &mut f64) -> bool {
    let verdicts = |change: &ChangeReport| [change.before, change.after].map(verdict_text);
    let goes_on = (next.start_m - *end_m).abs() < 1e-6 && verdicts(first) == verdicts(next);
    if goes_on {
        *end_m = next.end_m;
    }
    goes_on
}

fn verdict_text(judged: Option<JudgedReport>) -> &'static str {
    match judged.map(|judged| judged.verdict) {
        None => "not passed",
        Some("cannot_say") => "can't say",
        Some(verdict) => verdict,
    }
}

/// Largest hole of a series of sections with its standard deviation, m, as text.
fn holes(run: impl Iterator<Item = JudgedReport>) -> String {
    let measured = run.filter_map(|judged| Some((judged.hole_m?, judged.hole_sd_m)));
    let largest = measured.max_by(|a, b| a.0.total_cmp(&b.0));
    largest.map_or_else(|| "-".to_owned(), |(hole_m, sd_m)| format!("{hole_m:.3}±{sd_m:.3}"))
}
