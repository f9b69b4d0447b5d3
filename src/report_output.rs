//! A finished dive's report: its log's entry, output, and the exit code.

use std::path::Path;

use headrace_monitor::report::{LogReport, PartReport, Report};
use headrace_replay::log::{file_digest, files_digest};
use headrace_replay::player::Player;
use serde_json::json;

use crate::cli::Output;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, deliver_json, show};
use crate::screen::Screen;
use crate::summary::summary;

/// Adds the replayed log and its losses to the report.
pub(crate) fn note_losses(report: &mut Report, path: &Path, player: &Player) -> Result<(), Failure> {
    let recorded = report.log.take();
    let mut losses = player.losses();
    losses.extend(recorded.into_iter().flat_map(|log| log.losses));
    let files: Vec<_> = player.files().iter().map(|file| (file.path.as_path(), file.messages)).collect();
    let paths: Vec<&Path> = files.iter().map(|(path, _)| *path).collect();
    report.log = Some(LogReport {
        path: path.display().to_string(),
        sha256: files_digest(&paths)?,
        messages: player.played(),
        losses,
        notes: player.notes(),
        parts: parts(path, &files)?,
    });
    Ok(())
}

/// The files of a log; empty where it is only the file named.
pub(crate) fn parts(named: &Path, files: &[(&Path, u64)]) -> Result<Vec<PartReport>, Failure> {
    if matches!(files, [(only, _)] if *only == named) {
        return Ok(Vec::new());
    }
    let part = |&(path, messages): &(&Path, u64)| {
        let sha256 = file_digest(path)?;
        Ok(PartReport { path: path.display().to_string(), sha256, messages })
    };
    files.iter().map(part).collect()
}

pub(crate) fn finish(report: &Report, output: &Output) -> Result<u8, Failure> {
    if let Some(path) = &output.report {
        files::write_json(path, report)?;
    }
    if output.json_lines {
        let end = json!({"type": "end", "digest": report.digest, "way": report.way, "summary": report.summary,
            "not_inspected": report.not_inspected, "exit_code": exit_code(report)});
        deliver(&end.to_string())?;
    } else if output.json {
        deliver_json(report)?;
    } else {
        show(&summary(report, Screen::columns()));
    }
    Ok(exit_code(report))
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
