//! The table `dives`: one row for each log, readable or not.

use headrace_monitor::report::Report;

use crate::column::{Column, Get, Table, count};
use crate::replay::Dive;

/// A log with its replayed dive, from which a row of the table is made.
pub(crate) struct Row<'a> {
    pub(crate) log: &'a str,
    pub(crate) sha256: &'a str,
    pub(crate) parameters: &'a str,
    pub(crate) version: &'a str,
    /// The dive, or the reason why the log couldn't be replayed.
    pub(crate) dive: Result<&'a Dive, &'a str>,
}

impl Row<'_> {
    fn report(&self) -> Option<&Report> {
        self.dive.ok().map(|dive| &dive.report)
    }

    fn losses(&self) -> &[String] {
        self.report().and_then(|report| report.log.as_ref()).map_or(&[], |log| log.losses.as_slice())
    }
}

/// The exit code that `headrace replay` returns for the same log.
fn exit_code(row: &Row<'_>) -> i64 {
    match row.report() {
        None => 2,
        Some(report) if report.lost_data() => 3,
        Some(report) => i64::from(report.not_inspected.is_some()),
    }
}

/// Converts the dive's start from the log's clock to UTC, microseconds.
fn utc_us(row: &Row<'_>) -> Option<i64> {
    let dive = row.dive.ok()?;
    #[expect(clippy::cast_possible_truncation, reason = "a start in seconds is far below 2^63 nanoseconds")]
    let start_ns = (dive.report.dive.start_s * 1e9) as i64;
    Some(dive.about.utc_of_zero_ns?.checked_add(start_ns)? / 1000)
}

/// A column whose value is taken from the report.
macro_rules! of_report {
    (number $name:literal, $about:literal, $get:expr) => {
        Column(
            $name,
            $about,
            Get::Number(|row| {
                let get: fn(&Report) -> Option<f64> = $get;
                get(row.report()?)
            }),
        )
    };
    (count $name:literal, $about:literal, $get:expr) => {
        Column(
            $name,
            $about,
            Get::Count(|row| {
                let get: fn(&Report) -> Option<i64> = $get;
                get(row.report()?)
            }),
        )
    };
}

#[expect(clippy::too_many_lines, reason = "a line for each column")]
pub(crate) fn dives<'a>() -> Table<Row<'a>> {
    Table {
        name: "dives",
        about: "A log of the campaign. An unreadable log has a row with its error only.",
        columns: vec![
            Column(
                "log",
                "Path of the log, or of the first part of a recording",
                Get::Text(|row| Some(row.log.to_owned())),
            ),
            Column(
                "log_sha256",
                "SHA-256 of the log, or of all parts of a recording in order",
                Get::Text(|row| Some(row.sha256.to_owned())),
            ),
            Column(
                "parameters",
                "Digest of the replay's parameters",
                Get::Text(|row| Some(row.parameters.to_owned())),
            ),
            Column(
                "program_version",
                "Program of the replay: version, and digest of the sources that decide results",
                Get::Text(|row| Some(row.version.to_owned())),
            ),
            Column("error", "Error of the replay", Get::Text(|row| row.dive.err().map(str::to_owned))),
            Column(
                "exit_code",
                "Exit code of `headrace replay`: 0 success, 1 no inspection, 2 not replayed, 3 data was lost",
                Get::Count(|row| Some(exit_code(row))),
            ),
            Column(
                "losses",
                "Number of losses of data: damage, messages of unknown sources or clocks",
                Get::Count(|row| count(row.losses().len())),
            ),
            Column(
                "lost",
                "The losses as text, one per line",
                Get::Text(|row| Some(row.losses().join("\n")).filter(|text| !text.is_empty())),
            ),
            Column(
                "not_inspected",
                "Reason why the dive is no inspection: `no_sonar`, `no_position`, `outside_tunnel`, `mostly_no_position`; null for an inspection",
                Get::Text(|row| row.report()?.not_inspected.as_ref().map(|why| why.reason.to_owned())),
            ),
            Column(
                "digest",
                "Digest of all results, as `headrace replay` prints it",
                Get::Text(|row| row.report().map(|report| report.digest.clone())),
            ),
            Column(
                "vehicle",
                "Name of the vehicle",
                Get::Text(|row| row.dive.ok().map(|dive| dive.vehicle.clone())),
            ),
            Column(
                "recorded_version",
                "Program that wrote the log",
                Get::Text(|row| row.dive.ok()?.about.recorded_version.clone()),
            ),
            Column(
                "scene",
                "Scene of a simulation; null for a real dive",
                Get::Text(|row| row.dive.ok()?.about.scene.clone()),
            ),
            Column(
                "started_utc",
                "Start of the dive; null if the log has no clock time",
                Get::Moment(utc_us),
            ),
            of_report!(number "start_s", "Time of the first packet, s on the log's clock", |report| Some(report.dive.start_s)),
            of_report!(number "duration_s", "Time from the first to the last packet, s", |report| Some(report.dive.duration_s)),
            of_report!(number "target_m", "Target T: largest hole that passes, m", |report| Some(report.target_m)),
            of_report!(number "section_m", "Length of a section, m", |report| Some(report.section_m)),
            of_report!(count "confidence_sd", "Standard deviations of D by which a verdict clears the target", |report| count(report.confidence_sd)),
            of_report!(number "way_from_m", "Chainage at which the coverage extent begins, m", |report| report.coverage_extent.from_m),
            of_report!(number "way_to_m", "Chainage at which the coverage extent ends, m", |report| report.coverage_extent.to_m),
            of_report!(number "way_m", "Length of the coverage extent, m: the sum of the five following columns", |report| Some(report.coverage_extent.length_m)),
            of_report!(number "pass_m", "Metres that pass", |report| Some(report.summary.pass_m)),
            of_report!(number "fail_m", "Metres that fail", |report| Some(report.summary.fail_m)),
            of_report!(number "cannot_say_m", "Metres without a verdict of pass or fail (`cannot_say`)", |report| Some(report.summary.cannot_say_m)),
            of_report!(number "open_m", "Metres that are open, without `not_inspected_m`", |report| Some(report.summary.open_m)),
            of_report!(number "not_inspected_m", "Metres at an end or turning point that some heads have not passed", |report| Some(report.summary.not_inspected_m)),
            of_report!(count "flags_raised", "Flags raised", |report| count(report.summary.flags_raised)),
            of_report!(count "flags_cleared", "Flags cleared by a later pass", |report| count(report.summary.flags_cleared)),
            of_report!(number "d_most_m", "Diameter D of the largest hole of all sections, m", |report| report.summary.hole.max_m),
            of_report!(number "d_mean_m", "Mean D of the sections, m", |report| report.summary.hole.mean_m),
            of_report!(number "t_x_mean_m", "Mean distance between passes, m", |report| report.summary.t_x.mean_m),
            of_report!(number "t_y_mean_m", "Mean distance between neighbours of one sweep, m", |report| report.summary.t_y.mean_m),
            of_report!(number "sound_speed_least_mps", "Lowest speed of sound used, m/s", |report| Some(report.dive.sound_speed_least_mps)),
            of_report!(number "sound_speed_most_mps", "Highest speed of sound used, m/s", |report| Some(report.dive.sound_speed_most_mps)),
            of_report!(count "messages", "Messages of sources in the replay", |report| count(report.log.as_ref()?.messages)),
            of_report!(count "samples", "Samples on the wall", |report| count(report.dive.samples_valid)),
            of_report!(count "samples_thinned", "Samples dropped by thinning of full cells", |report| count(report.dive.samples_thinned)),
            of_report!(count "missing_returns", "Pings without a return although the wall was in range", |report| count(report.dive.samples_rejected.missing)),
            of_report!(count "out_of_range", "Pings without a return, with the wall out of range", |report| count(report.dive.samples_rejected.out_of_range)),
            of_report!(count "occluded", "Pings occluded by the vehicle", |report| count(report.dive.samples_rejected.occluded)),
            of_report!(count "without_fix", "Returns without a fix", |report| count(report.dive.samples_rejected.no_fix)),
            of_report!(count "outside", "Samples beyond the ends of the tunnel", |report| count(report.dive.samples_rejected.outside)),
            of_report!(count "not_stored", "Samples lost for want of memory", |report| count(report.dive.samples_rejected.not_stored)),
            of_report!(count "doubtful_returns", "Doubtful returns: not counted as wall", |report| count(report.dive.samples_rejected.doubtful_returns)),
            of_report!(count "alerts_dropped", "Cleared alerts that are missing in `alerts`, which is full", |report| count(report.alerts_dropped)),
        ],
    }
}
