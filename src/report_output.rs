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
