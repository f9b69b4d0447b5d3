//! Checks the errors of hard cases against their bounds and against `docs/why/hard-cases.csv`.
//!
//! `tests/hard_cases/run` generates that page.

#![allow(clippy::panic, reason = "a failed step ends the test")]

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Environment variable with a file name. If it is set, results are written to this file and not compared with the
/// page.
const COLLECT: &str = "HEADRACE_HARD_CASES";

/// Checks the error of one case. Name and unit of the case are those in `tests/hard_cases/list`.
///
/// Panics: the error is over its bound, isn't a number, or differs from the page.
#[track_caller]
pub fn found(name: &str, error: f64, bound: f64) {
    tell(name, error, bound, None);
}

/// As [`found`], for a problem with a condition number, which is the factor between input errors and result errors.
///
/// Panics: as [`found`].
#[track_caller]
pub fn found_at(name: &str, condition: f64, error: f64, bound: f64) {
    tell(name, error, bound, Some(condition));
}

#[track_caller]
fn tell(name: &str, error: f64, bound: f64, condition: Option<f64>) {
    assert!(error <= bound, "{name}: error {error:e}, allowed is {bound:e}");
    let condition = condition.map_or_else(|| "-".to_owned(), rounded);
    let figures = [rounded(error), rounded(bound), condition];
    if let Some(path) = std::env::var_os(COLLECT) {
        let line = format!("{name}|{}\n", figures.join("|"));
        let file = OpenOptions::new().create(true).append(true).open(&path);
        let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
        written.unwrap_or_else(|why| panic!("{}: {why}", PathBuf::from(&path).display()));
        return;
    }
    let row = row(name);
    let stated = &row[3..6];
    assert_eq!(
        stated, figures,
        "docs/why/hard-cases.csv has other figures for {name}; renew it with tests/hard_cases/run"
    );
}

/// Cells of the row for a hard case in `docs/why/hard-cases.csv`.
#[track_caller]
fn row(name: &str) -> Vec<String> {
    let list = read("tests/hard_cases/list");
    let mut fields = list.lines().map(|line| line.split('|').map(str::trim));
    let case = fields.find_map(|mut fields| (fields.next() == Some(name)).then(|| fields.next()).flatten());
    let case = case.unwrap_or_else(|| panic!("tests/hard_cases/list has no case {name}"));
    let table = read("docs/why/hard-cases.csv");
    let row = table.lines().map(cells).find(|cells| cells.get(1).is_some_and(|found| found == case));
    row.unwrap_or_else(|| {
        panic!("docs/why/hard-cases.csv has no row {case:?}; add it with tests/hard_cases/run")
    })
}

/// Cells of a line of CSV in which every cell is quoted.
pub fn cells(line: &str) -> Vec<String> {
    let inner = line.strip_prefix('"').and_then(|line| line.strip_suffix('"')).unwrap_or(line);
    inner.split("\",\"").map(|cell| cell.replace("\"\"", "\"")).collect()
}

#[track_caller]
fn read(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

/// Rounds to one significant digit, so that other processors and build profiles print the same value.
fn rounded(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.0e}") }
}
