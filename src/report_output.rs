//! Completes and writes the report of a finished dive, and gives the exit code.

use std::path::Path;

use headrace_monitor::report::{LogReport, PartReport, Report};
use headrace_replay::log::{LogError, file_digest, files_digest};
use headrace_replay::player::Player;
use serde_json::json;

use crate::cli::Output;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, deliver_json, show};
use crate::screen::Screen;
use crate::summary::summary;

/// Adds the replayed log and the log's losses to the report.
pub(crate) fn note_losses(report: &mut Report, path: &Path, player: &Player) {
    let recorded = report.log.take();
    let files: Vec<_> = player.files().iter().map(|file| (file.path.as_path(), file.messages)).collect();
    let mut log = files_report(path, &files);
    log.messages = player.played();
    log.losses.splice(0..0, player.losses());
    log.losses.extend(recorded.into_iter().flat_map(|log| log.losses));
    log.notes = player.notes();
    report.log = Some(log);
}

/// States the date and time of the dive in the report. `utc_of_zero_s` is the UTC of the clock's zero, s.
pub(crate) fn state_utc(report: &mut Report, utc_of_zero_s: Option<f64>) {
    report.begun_utc = utc_of_zero_s.map(|zero_s| utc_text(zero_s + report.dive.start_s));
}

/// A UTC time in seconds since 1970 as text, to whole seconds.
pub(crate) fn utc_text(utc_s: f64) -> String {
    let seconds = headrace_geometry::math::floor_to_i64(utc_s);
    let (mut days, of_day) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    let is_leap = |year: i64| year % 4 == 0 && (year % 100 != 0 || year % 400 == 0);
    // 400 years of the Gregorian calendar have 146,097 days. Skipping whole periods of 400 years keeps the loops below
    // short.
    let mut year = 1970 + 400 * days.div_euclid(146_097);
    days = days.rem_euclid(146_097);
    while days >= 365 + i64::from(is_leap(year)) {
        days -= 365 + i64::from(is_leap(year));
        year += 1;
    }
    let mut month = 1;
    for length in [31, 28 + i64::from(is_leap(year)), 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if days < length {
            break;
        }
        (days, month) = (days - length, month + 1);
    }
    let (day, h, min, s) = (days + 1, of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year:04}-{month:02}-{day:02}T{h:02}:{min:02}:{s:02}Z")
}

/// Entry of the report for a log's files.
///
/// A file that can't be read back counts as a loss, and its digest is missing.
pub(crate) fn files_report(named: &Path, files: &[(&Path, u64)]) -> LogReport {
    let paths: Vec<&Path> =
        if files.is_empty() { vec![named] } else { files.iter().map(|(path, _)| *path).collect() };
    let mut losses = Vec::new();
    let mut digest = |of: Result<String, LogError>| {
        of.unwrap_or_else(|error| {
            losses.push(format!("the log can't be read back: {error}"));
            String::new()
        })
    };
    let sha256 = digest(files_digest(&paths));
    // A log of a single file has no parts to list.
    let named_alone = matches!(files, [(only, _)] if *only == named);
    let parts = files.iter().filter(|_| !named_alone).map(|(path, messages)| PartReport {
        path: path.display().to_string(),
        sha256: if sha256.is_empty() {
            file_digest(path).unwrap_or_default()
        } else {
            digest(file_digest(path))
        },
        messages: *messages,
    });
    let parts = parts.collect();
    LogReport { path: named.display().to_string(), sha256, messages: 0, losses, notes: Vec::new(), parts }
}

pub(crate) fn finish(report: &Report, output: &Output) -> Result<u8, Failure> {
    // If the report can't be written, the summary is still printed.
    let written = output.report.as_ref().map_or(Ok(()), |path| files::write_json(path, report));
    if output.json_lines {
        let end = json!({"type": "end", "digest": report.digest, "way": report.coverage_extent, "summary": report.summary,
            "not_inspected": report.not_inspected, "exit_code": exit_code(report)});
        deliver(&end.to_string())?;
    } else if output.json {
        deliver_json(report)?;
    } else {
        show(&summary(report, Screen::columns()));
    }
    written.map(|()| exit_code(report))
}

/// Exit code of a finished dive.
pub(crate) fn exit_code(report: &Report) -> u8 {
    if report.lost_data() {
        failure::DATA_LOST
    } else if report.not_inspected.is_none() {
        failure::OK
    } else {
        failure::FAILED
    }
}

#[cfg(test)]
mod tests {
    use super::utc_text;

    /// Expected texts by `date -u -d @SECONDS +%FT%TZ`.
    #[test]
    fn utc_is_stated_as_date_and_time() {
        for (utc_s, text) in [
            (0.0, "1970-01-01T00:00:00Z"),
            (951_782_399.9, "2000-02-28T23:59:59Z"),
            (951_868_800.0, "2000-03-01T00:00:00Z"),
            (1_709_164_800.0, "2024-02-29T00:00:00Z"),
            (1_796_015_553.2, "2026-11-30T05:12:33Z"),
            (4_107_542_400.0, "2100-03-01T00:00:00Z"),
            (-1.0, "1969-12-31T23:59:59Z"),
        ] {
            assert_eq!(utc_text(utc_s), text, "{utc_s}");
        }
    }
}
