//! `dives`: one row for each log, readable or not.

use headrace_monitor::report::Report;

use crate::column::{Column, Get, Table, count};
use crate::replay::Dive;

/// Facts about a log.
pub(crate) struct Row<'a> {
    pub(crate) log: &'a str,
    pub(crate) sha256: &'a str,
    pub(crate) parameters: &'a str,
    pub(crate) version: &'a str,
    /// The dive, or the reason why there is none.
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

/// The exit code that `headrace replay` would have returned.
fn exit_code(row: &Row<'_>) -> i64 {
    match row.report() {
        None => 2,
        Some(report) if report.lost_data() => 3,
        Some(report) => i64::from(report.not_inspected.is_some()),
    }
}

/// UTC of a time on the log's clock, microseconds.
fn utc_us(row: &Row<'_>) -> Option<i64> {
    let dive = row.dive.ok()?;
    #[expect(clippy::cast_possible_truncation, reason = "a start in seconds is far below 2^63 nanoseconds")]
    let start_ns = (dive.report.dive.start_s * 1e9) as i64;
    Some(dive.about.utc_of_zero_ns?.checked_add(start_ns)? / 1000)
}

/// A column of the report.
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
        about: "A log of the campaign. One that can't be read has a row as well, with its error and nothing else.",
        columns: vec![
            Column(
                "log",
                "Path of the log; of a recording in parts, of the first",
                Get::Text(|row| Some(row.log.to_owned())),
            ),
            Column(
                "log_sha256",
                "SHA-256 of the log; of a recording in parts, of the parts one after the other",
                Get::Text(|row| Some(row.sha256.to_owned())),
            ),
            Column(
                "parameters",
                "Digest of the replay's parameters",
                Get::Text(|row| Some(row.parameters.to_owned())),
            ),
            Column(
                "program_version",
                "The program that replayed it: version, and digest of the sources that decide results",
                Get::Text(|row| Some(row.version.to_owned())),
            ),
            Column(
                "error",
                "Why it couldn't be replayed",
                Get::Text(|row| row.dive.err().map(str::to_owned)),
            ),
            Column(
                "exit_code",
                "What `headrace replay` would have exited with: 0 inspected on all data, 1 no inspection, 2 not replayed, 3 data was lost",
                Get::Count(|row| Some(exit_code(row))),
            ),
            Column(
                "losses",
                "Losses of data: damage, messages of unknown sources or clocks. Each is a line of `lost`",
                Get::Count(|row| count(row.losses().len())),
            ),
            Column(
                "lost",
                "The losses in plain text, one a line",
                Get::Text(|row| Some(row.losses().join("\n")).filter(|text| !text.is_empty())),
            ),
            Column(
                "not_inspected",
                "Why the dive is no inspection: `no_sonar`, `no_position`, `outside_tunnel`, `mostly_no_position`; null where it is one",
                Get::Text(|row| row.report()?.not_inspected.as_ref().map(|why| why.reason.to_owned())),
            ),
            Column(
                "digest",
                "Digest of all results, as `headrace replay` prints it",
                Get::Text(|row| row.report().map(|report| report.digest.clone())),
            ),
            Column(
                "vehicle",
                "The vehicle's name",
                Get::Text(|row| row.dive.ok().map(|dive| dive.vehicle.clone())),
            ),
            Column(
                "recorded_version",
                "The program that wrote the log",
                Get::Text(|row| row.dive.ok()?.about.recorded_version.clone()),
            ),
            Column(
                "scene",
                "The scene that it is a simulation of; null for a dive",
                Get::Text(|row| row.dive.ok()?.about.scene.clone()),
            ),
            Column("started_utc", "When it began; null where the log doesn't say", Get::Moment(utc_us)),
            of_report!(number "start_s", "First packet, on the log's clock, s", |report| Some(report.dive.start_s)),
            of_report!(number "duration_s", "First to last packet, s", |report| Some(report.dive.duration_s)),
            of_report!(number "target_m", "Target T: the largest hole that passes, m", |report| Some(report.target_m)),
            of_report!(number "section_m", "Length of a section, m", |report| Some(report.section_m)),
            of_report!(count "confidence_sd", "Standard deviations of the hole that a verdict keeps clear of the target", |report| count(report.confidence_sd)),
            of_report!(number "way_from_m", "Chainage at which the way begins, m", |report| report.way.from_m),
            of_report!(number "way_to_m", "Chainage at which the way ends, m", |report| report.way.to_m),
            of_report!(number "way_m", "Length of the way, m: the sum of the metres by verdict", |report| Some(report.way.length_m)),
            of_report!(number "pass_m", "Metres that pass", |report| Some(report.summary.pass_m)),
            of_report!(number "fail_m", "Metres that fail", |report| Some(report.summary.fail_m)),
            of_report!(number "cannot_say_m", "Metres of which neither can be said", |report| Some(report.summary.cannot_say_m)),
            of_report!(number "open_m", "Metres still open", |report| Some(report.summary.open_m)),
            of_report!(number "not_inspected_m", "Metres where the way begins or turns back that not all heads have passed", |report| Some(report.summary.not_inspected_m)),
            of_report!(count "flags_raised", "Flags raised", |report| count(report.summary.flags_raised)),
            of_report!(count "flags_cleared", "Of these, cleared by a later pass", |report| count(report.summary.flags_cleared)),
            of_report!(number "d_most_m", "Diameter D of the largest hole of all sections, m", |report| report.summary.hole.max_m),
            of_report!(number "d_mean_m", "Mean of D over the sections, m", |report| report.summary.hole.mean_m),
            of_report!(number "t_x_mean_m", "Mean distance between passes, m", |report| report.summary.t_x.mean_m),
            of_report!(number "t_y_mean_m", "Mean distance between neighbours of one sweep, m", |report| report.summary.t_y.mean_m),
            of_report!(number "sound_speed_least_mps", "Least speed of sound used, m/s", |report| Some(report.dive.sound_speed_least_mps)),
            of_report!(number "sound_speed_most_mps", "Greatest speed of sound used, m/s", |report| Some(report.dive.sound_speed_most_mps)),
            of_report!(count "messages", "Messages of sources played", |report| count(report.log.as_ref()?.messages)),
            of_report!(count "samples", "Samples on the wall", |report| count(report.dive.samples_valid)),
            of_report!(count "samples_thinned", "Of these, dropped by thinning of full cells", |report| count(report.dive.samples_thinned)),
            of_report!(count "missing_returns", "Pings without a return though the wall was within range", |report| count(report.dive.samples_rejected.missing)),
            of_report!(count "out_of_range", "Pings without a return, the wall out of range", |report| count(report.dive.samples_rejected.out_of_range)),
            of_report!(count "occluded", "Pings occluded by the vehicle", |report| count(report.dive.samples_rejected.occluded)),
            of_report!(count "without_fix", "Returns without a position", |report| count(report.dive.samples_rejected.no_fix)),
            of_report!(count "outside", "Samples beyond the ends of the tunnel", |report| count(report.dive.samples_rejected.outside)),
            of_report!(count "not_stored", "Samples for which there was no room: lost data", |report| count(report.dive.samples_rejected.not_stored)),
            of_report!(count "doubtful_returns", "Returns that weren't taken for wall", |report| count(report.dive.samples_rejected.doubtful_returns)),
            of_report!(count "alerts_dropped", "Cleared alerts that `alerts` leaves out for lack of room", |report| count(report.alerts_dropped)),
        ],
    }
}
