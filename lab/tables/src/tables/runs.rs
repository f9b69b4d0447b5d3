//! The table `runs`: missed stretches, and the advice for passing them again.

use headrace_monitor::report::{Report, ReturnReport, RunReport};

use super::sections::words;
use crate::column::{Column, Get, Table, count};

/// A missed stretch and, until it is cleared, the advice for returning to it.
pub(crate) struct Run<'a> {
    run: &'a RunReport,
    back: Option<&'a ReturnReport>,
}

pub(crate) fn runs(report: &Report) -> Vec<Run<'_>> {
    let back = |run: &RunReport| report.go_back.iter().find(|back| back.run == run.id);
    report.runs.iter().map(|run| Run { run, back: back(run) }).collect()
}

pub(crate) fn runs_table<'a>() -> Table<Run<'a>> {
    Table {
        name: "runs",
        about: "A missed stretch: neighbouring flagged sections.",
        columns: vec![
            Column("run", "Its permanent number within the dive", Get::Count(|row| count(row.run.id))),
            Column(
                "cause",
                "Most frequent cause of its sections",
                Get::Text(|row| Some(row.run.cause.as_str().to_owned())),
            ),
            Column(
                "causes",
                "All causes in order of frequency, the main one first, separated by commas",
                Get::Text(|row| Some(words(row.run.causes.iter().copied()))),
            ),
            Column(
                "silent_sources",
                "Heads that were silent in the section with its largest hole, or that caused a fail by silence, separated by commas",
                Get::Text(|row| Some(row.run.silent_sources.join(",")).filter(|text| !text.is_empty())),
            ),
            Column("chainage_m", "Chainage of its start, m", Get::Number(|row| Some(row.run.start_m))),
            Column("end_m", "Chainage of its end, m", Get::Number(|row| Some(row.run.end_m))),
            Column("failed_m", "Metres of it that fail", Get::Number(|row| Some(row.run.failed_m))),
            Column(
                "d_m",
                "Diameter D of its largest hole, m; if cleared, the last one before",
                Get::Number(|row| Some(row.run.hole_m)),
            ),
            Column("d_x_m", "Chainage of that hole's centre, m", Get::Number(|row| Some(row.run.hole_x_m))),
            Column(
                "d_clock",
                "Clock position of that hole's centre, looking along the tunnel",
                Get::Text(|row| Some(row.run.hole_clock.clone())),
            ),
            Column(
                "raised_s",
                "Time of its first flag, s of dive time",
                Get::Number(|row| Some(row.run.raised_s)),
            ),
            Column(
                "cleared_s",
                "Time since which none of its sections fails, s of dive time",
                Get::Number(|row| row.run.cleared_s),
            ),
            Column(
                "merged_into",
                "The run into which it was merged",
                Get::Count(|row| row.run.merged_into.map(i64::from)),
            ),
            Column(
                "action",
                "Change to make on the next pass; null if none is needed",
                Get::Text(|row| row.back.map(|back| back.action.as_str().to_owned())),
            ),
            Column(
                "at_most_mps",
                "Highest speed on the next pass, m/s; zero if none meets the target in this mode",
                Get::Number(|row| row.back.map(|back| back.at_most_mps)),
            ),
            Column(
                "takes_s",
                "Duration of the next pass at that speed, s",
                Get::Number(|row| row.back.and_then(|back| back.takes_s)),
            ),
        ],
    }
}
