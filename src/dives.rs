//! `headrace dives`: lists the dives that are recorded in a folder. Logs are not replayed.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
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

/// Reports in a folder, by the file name of their log.
type Reports = BTreeMap<OsString, Value>;

/// A recorded dive.
struct Dive {
    recording: PathBuf,
    begun_utc: Option<String>,
    /// Names of vehicle and tunnel profile; `None` if the log has no valid vehicle file.
    place: Option<String>,
    duration_s: Option<f64>,
    /// Report of the dive beside the recording.
    report: Option<Value>,
    /// Whether `run --resume` can continue the dive.
    is_interrupted: bool,
}

/// Runs `headrace dives`. The exit code is 3 if a log can't be read.
pub(crate) fn dives(args: &Dives) -> Result<u8, Failure> {
    let logs = files_of(std::slice::from_ref(&args.folder))?;
    let recordings: BTreeSet<PathBuf> =
        logs.into_iter().map(|log| named_part(&log).map_or(log, |(recording, _)| recording)).collect();
    let reports = reports_in(&args.folder)?;
    let (mut dives, mut unreadable) = (Vec::new(), Vec::new());
    for recording in recordings {
        match Dive::read(&recording, &reports) {
            Ok(dive) => dives.push(dive),
            Err(error) => unreadable.push((recording, error.to_string())),
        }
    }
    dives.sort_by(|a, b| a.begun_utc.cmp(&b.begun_utc));
    if args.json {
        let unreadable: Vec<Value> =
            unreadable.iter().map(|(log, error)| json!({"log": log, "error": error})).collect();
        let dives: Vec<Value> = dives.iter().map(Dive::json).collect();
        deliver(&json!({"dives": dives, "unreadable": unreadable}).to_string())?;
    } else {
        say(&table(dives.iter().map(Dive::row)));
        dives.iter().flat_map(Dive::advice).for_each(|text| say(&one_line(&text)));
        for (log, error) in &unreadable {
            say(&one_line(&format!("{}: {error}", log.display())));
        }
    }
    Ok(if unreadable.is_empty() { failure::OK } else { failure::DATA_LOST })
}

/// Reads the reports in a folder. Other JSON files are skipped.
///
/// Errors: the folder can't be read.
fn reports_in(folder: &Path) -> Result<Reports, Failure> {
    let read = |source| Failure::Read { path: folder.to_owned(), source };
    let mut reports = Reports::new();
    for entry in folder.read_dir().map_err(read)? {
        let path = entry.map_err(read)?.path();
        if path.extension().is_some_and(|extension| extension == "json")
            && let Ok(text) = files::read_report(&path)
            && let Ok(report) = serde_json::from_str::<Value>(&text)
            && let Some(log) = report["log"]["path"].as_str().and_then(|log| Path::new(log).file_name())
        {
            reports.insert(log.to_owned(), report);
        }
    }
    Ok(reports)
}

/// Lines of a table. Each column is as wide as its widest cell.
fn table(rows: impl Iterator<Item = [String; 8]>) -> String {
    let rows: Vec<[String; 8]> = std::iter::once(TITLES.map(str::to_owned)).chain(rows).collect();
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: [usize; 8] = std::array::from_fn(width);
    let line = |row: &[String; 8]| {
        let cells = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}"));
        cells.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    rows.iter().map(line).collect::<Vec<_>>().join("\n")
}

impl Dive {
    /// Reads the header and the times of a recording.
    ///
    /// Errors: a log can't be read.
    fn read(recording: &Path, reports: &Reports) -> Result<Self, LogError> {
        let log = DiveLog::open(&files_of(&[recording.to_owned()])?)?;
        let (info, times) = (log.header(), log.times());
        let begun_s =
            utc_of_zero_s(&info.metadata).zip(times).map(|(zero_s, (first, _))| zero_s + first.as_secs_f64());
        let vehicle = vehicle_file::attached(info, &[], recording).ok();
        Ok(Self {
            recording: recording.to_owned(),
            begun_utc: begun_s.map(utc_text),
            place: vehicle.map(|(_, vehicle)| format!("{}, {}", vehicle.name, vehicle.tunnel.name)),
            duration_s: times.map(|(first, last)| last.since(first).as_secs_f64()),
            report: recording.file_name().and_then(|name| reports.get(name)).cloned(),
            is_interrupted: Unfinished::is_at(recording)?,
        })
    }

    /// A number of the report.
    fn number(&self, table: &str, key: &str) -> Option<f64> {
        self.report.as_ref()?[table][key].as_f64()
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
            "recording": self.recording,
            "begun_utc": self.begun_utc,
            "place": self.place,
            "duration_s": self.duration_s,
            "from_m": self.number("coverage_extent", "from_m"),
            "to_m": self.number("coverage_extent", "to_m"),
            "pass_m": self.number("summary", "pass_m"),
            "fail_m": self.number("summary", "fail_m"),
            "no_verdict_m": self.without_verdict_m(),
            "is_interrupted": self.is_interrupted,
        })
    }
}
