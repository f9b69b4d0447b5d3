//! One dive, replayed by headrace's library in this process, as Arrow tables.
//!
//! ```no_run
//! use headrace_tables::{Parameters, replay};
//!
//! let parameters = Parameters { target_m: Some(0.3), ..Parameters::default() };
//! let tables = replay(&["dive.mcap".into()], &parameters)?;
//! println!("{} sections", tables.sections.num_rows());
//! # Ok::<(), headrace_tables::Error>(())
//! ```
//!
//! `docs/reference/dive-tables.csv` describes the tables. The same log with the same parameters gives the same tables,
//! bit for bit, on any machine.

mod column;
mod error;
mod parameters;
mod replay;
mod stoppable;
mod tables;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

pub use arrow_array;
use arrow_array::RecordBatch;
pub use arrow_schema;
use arrow_schema::SchemaRef;

pub use error::Error;
pub use parameters::Parameters;
pub use replay::log_digest;

use tables::dives::{Row, dives};
use tables::runs::{runs, runs_table};
use tables::sections::{flags, flags_table, holes, holes_table, sections};
use tables::sources::{alerts, sources};

/// Names of the tables, `dives` first.
pub const TABLES: [&str; 7] = ["dives", "sections", "holes", "flags", "runs", "sources", "alerts"];

/// The program's version, and a digest of the sources that decide a dive's results. Tables of two versions may differ.
pub fn program_version() -> &'static str {
    concat!(env!("CARGO_PKG_VERSION"), "+", env!("HEADRACE_SOURCES"))
}

/// The tables of one dive, each with the schema of [`schema`].
#[derive(Debug, Clone, PartialEq)]
pub struct Tables {
    /// The dive, as one row.
    pub dives: RecordBatch,
    /// A row for each section of the coverage extent.
    pub sections: RecordBatch,
    /// A row for each hole that is the largest hole of a section.
    pub holes: RecordBatch,
    /// A row for each section that was flagged.
    pub flags: RecordBatch,
    /// A row for each missed stretch: neighbouring flagged sections.
    pub runs: RecordBatch,
    /// A row for each sensor.
    pub sources: RecordBatch,
    /// A row for each alert.
    pub alerts: RecordBatch,
}

impl Tables {
    /// Finds a table by a name of [`TABLES`].
    pub fn get(&self, name: &str) -> Option<&RecordBatch> {
        Some(match name {
            "dives" => &self.dives,
            "sections" => &self.sections,
            "holes" => &self.holes,
            "flags" => &self.flags,
            "runs" => &self.runs,
            "sources" => &self.sources,
            "alerts" => &self.alerts,
            _ => return None,
        })
    }
}

/// Schema of a table, found by a name of [`TABLES`].
pub fn schema(name: &str) -> Option<SchemaRef> {
    Some(match name {
        "dives" => dives().schema(),
        "sections" => sections().schema(),
        "holes" => holes_table().schema(),
        "flags" => flags_table().schema(),
        "runs" => runs_table().schema(),
        "sources" => sources().schema(),
        "alerts" => alerts().schema(),
        _ => return None,
    })
}

/// Key that identifies a dive in all tables: the first 16 digits of its log's SHA-256.
pub fn dive_key(log_sha256: &str) -> &str {
    log_sha256.get(..16).unwrap_or(log_sha256)
}

/// Replays a dive and makes its tables.
///
/// `log` has the files of one dive: a log, or the parts of a recording in order. The replay uses one thread, and takes
/// about as long as `headrace replay`.
///
/// Errors: see [`Error`]. Lost data isn't an error: `dives.losses` counts the losses, `dives.lost` names them and
/// `dives.exit_code` is 3.
pub fn replay(log: &[PathBuf], parameters: &Parameters) -> Result<Tables, Error> {
    let first = log.first().ok_or(Error::NoLog)?.display().to_string();
    replay_digested(log, &first, &log_digest(log)?, parameters)
}

/// Replays a dive like [`replay`], but stops early if another thread sets `stop`.
///
/// Errors: see [`replay`]; [`Error::Stopped`].
pub fn replay_until(log: &[PathBuf], parameters: &Parameters, stop: &AtomicBool) -> Result<Tables, Error> {
    let first = log.first().ok_or(Error::NoLog)?.display().to_string();
    tables_of(log, &first, &log_digest(log)?, parameters, stop)
}

/// Replays a log whose [`log_digest`] is already known. `dives.log` gets the given name.
///
/// Errors: see [`replay`].
pub fn replay_digested(
    log: &[PathBuf],
    named: &str,
    sha256: &str,
    parameters: &Parameters,
) -> Result<Tables, Error> {
    tables_of(log, named, sha256, parameters, &AtomicBool::new(false))
}

fn tables_of(
    log: &[PathBuf],
    named: &str,
    sha256: &str,
    parameters: &Parameters,
    stop: &AtomicBool,
) -> Result<Tables, Error> {
    let dive = replay::run(log, sha256, parameters, stop)?;
    let (key, report) = (dive_key(sha256), &dive.report);
    let row = Row {
        log: named,
        sha256,
        parameters: &parameters.digest(),
        version: program_version(),
        dive: Ok(&dive),
    };
    Ok(Tables {
        dives: dives().batch(key, &[row])?,
        sections: sections().batch(key, &report.sections)?,
        holes: holes_table().batch(key, &holes(&report.sections))?,
        flags: flags_table().batch(key, &flags(&report.sections))?,
        runs: runs_table().batch(key, &runs(report))?,
        sources: sources().batch(key, &report.sources)?,
        alerts: alerts().batch(key, &report.alert_list)?,
    })
}

/// The tables of a log that couldn't be replayed. They contain only a row of `dives`, with the error.
///
/// `sha256` is the log's [`log_digest`], or empty if the digest can't be computed. `log` is the log's path.
///
/// Errors: [`Error::Table`], which is a defect of this library.
pub fn unread(log: &str, sha256: &str, parameters: &Parameters, error: &str) -> Result<Tables, Error> {
    let row =
        Row { log, sha256, parameters: &parameters.digest(), version: program_version(), dive: Err(error) };
    Ok(Tables {
        dives: dives().batch(dive_key(sha256), &[row])?,
        sections: sections().batch("", &[])?,
        holes: holes_table().batch("", &[])?,
        flags: flags_table().batch("", &[])?,
        runs: runs_table().batch("", &[])?,
        sources: sources().batch("", &[])?,
        alerts: alerts().batch("", &[])?,
    })
}

/// The tables and their columns as CSV, for `docs/reference/dive-tables.csv`. A row without a column name describes the
/// table.
pub fn described() -> String {
    let mut page = "table,column,type,description\n".to_owned();
    macro_rules! describe {
        ($($table:expr),*) => { $( $table.describe(&mut page); )* };
    }
    describe!(dives(), sections(), holes_table(), flags_table(), runs_table(), sources(), alerts());
    page
}

/// Formats the first bytes of a digest as hexadecimal digits.
#[expect(clippy::format_collect, reason = "a few bytes")]
fn hex(bytes: &[u8], most: usize) -> String {
    bytes.iter().take(most).map(|byte| format!("{byte:02x}")).collect()
}
