//! `headrace dives`: lists the dives that are recorded in a folder. Logs are not replayed.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use headrace_config::plain::one_line;
use headrace_monitor::pilot_text::station;
use headrace_replay::log::{DiveLog, LogError, Unfinished, files_of, named_part};
use serde_json::{Value, json};

use crate::cli::Dives;
use crate::failure::{self, Failure};
use crate::files;
use crate::output::{deliver, say};
use crate::page::utc_of_zero_s;
use crate::report_output::utc_text;
use crate::vehicle_file;

/// Titles of the columns.
const TITLES: [&str; 8] = [
    "recording",
    "begun",
    "vehicle, tunnel",
    "minutes",
    "chainage",
    "passed, m",
    "missed, m",
    "no verdict, m",
];

/// A recorded dive.
struct Dive {
    recording: PathBuf,
    /// Files of the recording.
    files: Vec<PathBuf>,
    begun_utc: Option<String>,
    /// Names of vehicle and tunnel profile; `None` if the log has no valid vehicle file.
    place: Option<String>,
    duration_s: Option<f64>,
    /// Path and content of the dive's report beside the recording.
    report: Option<(PathBuf, Value)>,
    /// Whether `run --resume` can continue the dive.
    is_interrupted: bool,
    /// Missing and unreadable parts.
    losses: Vec<String>,
}

/// Runs `headrace dives`. The exit code is 3 if a log can't be read, or if a part of it is missing.
pub(crate) fn dives(args: &Dives) -> Result<u8, Failure> {
    // Names in the working folder are shown without "./".
    let plain = |path: PathBuf| path.strip_prefix(".").map_or_else(|_| path.clone(), Path::to_owned);
    let mut logs: Vec<PathBuf> =
        files_of(std::slice::from_ref(&args.folder))?.into_iter().map(plain).collect();
    let recordings: BTreeSet<PathBuf> = logs.iter().map(|log| recording_of(log)).collect();
    let reports = reports_in(&args.folder)?;
    let (mut dives, mut unreadable) = (Vec::new(), Vec::new());
    for recording in recordings {
        match Dive::read(&recording, &reports) {
            Ok(dive) => {
                logs.retain(|log| !dive.files.contains(log));
                dives.push(dive);
            }
            Err(error) => {
                logs.retain(|log| recording_of(log) != recording);
                unreadable.push((recording, error.to_string()));
            }
        }
    }
    let foreign = "the recording of this name belongs to another dive; rename one of them".to_owned();
    unreadable.extend(logs.into_iter().map(|log| (log, foreign.clone())));
    dives.sort_by(|a, b| a.begun_utc.cmp(&b.begun_utc));
    if args.json {
        let unreadable: Vec<Value> =
            unreadable.iter().map(|(log, error)| json!({"log": text_of(log), "error": error})).collect();
        let dives: Vec<Value> = dives.iter().map(Dive::json).collect();
        deliver(&json!({"dives": dives, "unreadable": unreadable}).to_string())?;
    } else {
        let advice = dives.iter().flat_map(Dive::advice);
        for line in table(dives.iter().map(Dive::row)).into_iter().chain(advice) {
            say(&one_line(&line));
        }
        for (log, error) in &unreadable {
            say(&one_line(&format!("{}: {error}", log.display())));
        }
    }
    let is_whole = unreadable.is_empty() && dives.iter().all(|dive| dive.losses.is_empty());
    Ok(if is_whole { failure::OK } else { failure::DATA_LOST })
}

/// Reads the reports in a folder, in the order of their names. Other JSON files are skipped.
///
/// Errors: the folder can't be read.
fn reports_in(folder: &Path) -> Result<Vec<(PathBuf, Value)>, Failure> {
    let read = |source| Failure::Read { path: folder.to_owned(), source };
    let mut reports = Vec::new();
    for entry in folder.read_dir().map_err(read)? {
        let path = entry.map_err(read)?.path();
        if path.extension().is_some_and(|extension| extension == "json")
            && let Ok(text) = files::read_report(&path)
            && let Ok(report) = serde_json::from_str::<Value>(&text)
            && report["log"]["path"].is_string()
        {
            reports.push((path, report));
        }
    }
    reports.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(reports)
}

/// Returns the report of a log with the recording's file name. If there are several, the report that is named like the
/// recording comes first, and then the first by name.
fn report_of(recording: &Path, reports: &[(PathBuf, Value)]) -> Option<(PathBuf, Value)> {
    let is_of = |report: &Value| {
        let log = report["log"]["path"].as_str().map(Path::new);
        log.is_some_and(|log| log.file_name() == recording.file_name())
    };
    let fitting = || reports.iter().filter(|(_, report)| is_of(report));
    let named = fitting().find(|(path, _)| path.file_stem() == recording.file_stem());
    named.or_else(|| fitting().next()).cloned()
}

/// Name of the recording to which a log belongs by its own name.
fn recording_of(log: &Path) -> PathBuf {
    named_part(log).map_or_else(|| log.to_owned(), |(recording, _)| recording)
}

fn text_of(path: &Path) -> String {
    path.display().to_string()
}

/// Lines of a table. Each column is as wide as its widest cell.
fn table(rows: impl Iterator<Item = [String; 8]>) -> Vec<String> {
    let rows: Vec<[String; 8]> = std::iter::once(TITLES.map(str::to_owned)).chain(rows).collect();
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; 8] = std::array::from_fn(width);
    let line = |row: &[String; 8]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect()
}

impl Dive {
    /// Reads the header and the times of a recording.
    ///
    /// Errors: a log can't be read.
    fn read(recording: &Path, reports: &[(PathBuf, Value)]) -> Result<Self, LogError> {
        let files = files_of(&[recording.to_owned()])?;
        let log = DiveLog::open(&files)?;
        let (info, times) = (log.header(), log.times());
        let begun_s =
            utc_of_zero_s(&info.metadata).zip(times).map(|(zero_s, (first, _))| zero_s + first.as_secs_f64());
        let vehicle = vehicle_file::attached(info, &[], recording).ok();
        Ok(Self {
            recording: recording.to_owned(),
            files,
            begun_utc: begun_s.map(utc_text),
            place: vehicle.map(|(_, vehicle)| format!("{}, {}", vehicle.name, vehicle.tunnel.name)),
            duration_s: times.map(|(first, last)| last.since(first).as_secs_f64()),
            report: report_of(recording, reports),
            is_interrupted: Unfinished::is_at(recording)?,
            losses: log.losses().iter().map(ToString::to_string).collect(),
        })
    }

    /// A number of the report.
    fn number(&self, table: &str, key: &str) -> Option<f64> {
        self.report.as_ref()?.1[table][key].as_f64()
    }

    /// Metres that neither passed nor were missed.
    fn without_verdict_m(&self) -> Option<f64> {
        ["cannot_say_m", "open_m", "not_inspected_m"].iter().map(|key| self.number("summary", key)).sum()
    }

    fn row(&self) -> [String; 8] {
        let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
        let metres = |length_m: Option<f64>| or_dash(length_m.map(|length_m| format!("{length_m:.2}")));
        let end = |key| self.number("coverage_extent", key);
        let extent = end("from_m").zip(end("to_m"));
        let row = [
            self.recording.file_name().unwrap_or_default().to_string_lossy().into_owned(),
            or_dash(self.begun_utc.clone()),
            or_dash(self.place.clone()),
            or_dash(self.duration_s.map(|duration_s| format!("{:.1}", duration_s / 60.0))),
            or_dash(extent.map(|(from_m, to_m)| format!("{} to {}", station(from_m), station(to_m)))),
            metres(self.number("summary", "pass_m")),
            metres(self.number("summary", "fail_m")),
            metres(self.without_verdict_m()),
        ];
        row.map(|cell| one_line(&cell).into_owned())
    }

    /// Texts about an interrupted dive and a missing report, with the commands that help.
    fn advice(&self) -> Vec<String> {
        let name = self.recording.display();
        let mut advice = Vec::new();
        if self.is_interrupted {
            advice.push(format!(
                "{name}: the dive was interrupted; to continue it, give headrace run --resume={name}"
            ));
        }
        advice.extend(self.losses.iter().map(|loss| format!("{name}: LOST: {loss}")));
        if self.report.is_none() {
            let report = self.recording.with_extension("json");
            advice.push(format!(
                "{name}: there is no report; to make it, give headrace replay {name} --report {}",
                report.display()
            ));
        }
        advice
    }

    fn json(&self) -> Value {
        json!({
            "recording": text_of(&self.recording),
            "report": self.report.as_ref().map(|(path, _)| text_of(path)),
            "begun_utc": self.begun_utc,
            "place": self.place,
            "duration_s": self.duration_s,
            "from_m": self.number("coverage_extent", "from_m"),
            "to_m": self.number("coverage_extent", "to_m"),
            "pass_m": self.number("summary", "pass_m"),
            "fail_m": self.number("summary", "fail_m"),
            "no_verdict_m": self.without_verdict_m(),
            "is_interrupted": self.is_interrupted,
            "losses": self.losses,
        })
    }
}
