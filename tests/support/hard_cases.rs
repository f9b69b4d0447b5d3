//! What tests of hard cases find: held to its bound, and to `docs/why/hard-cases.md`, which `tests/hard_cases/run` makes of it.

#![allow(clippy::panic, reason = "a test stops at what it can't do")]

use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Where to collect what is found, in place of holding it to the page.
const COLLECT: &str = "HEADRACE_HARD_CASES";

/// The error of a case of `tests/hard_cases/list`, by its name there, in the unit that the list gives.
///
/// Panics: over its bound or no number, or another than the page tells.
#[track_caller]
pub fn found(name: &str, error: f64, bound: f64) {
    tell(name, error, bound, None);
}

/// The same of a problem with a condition number: how many times it magnifies errors of what is given.
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
    let told: Vec<&str> = row.split('|').map(str::trim).skip(3).take(3).collect();
    assert_eq!(
        told, figures,
        "docs/why/hard-cases.md tells other figures of {name}; tests/hard_cases/run makes it anew"
    );
}

/// The page's row of a case.
#[track_caller]
fn row(name: &str) -> String {
    let list = read("tests/hard_cases/list");
    let mut fields = list.lines().map(|line| line.split('|').map(str::trim));
    let case = fields.find_map(|mut fields| (fields.next() == Some(name)).then(|| fields.next()).flatten());
    let case = case.unwrap_or_else(|| panic!("tests/hard_cases/list has no case {name}"));
    let start = format!("| {case} |");
    let page = read("docs/why/hard-cases.md");
    let row = page.lines().find(|line| line.starts_with(&start));
    row.unwrap_or_else(|| panic!("docs/why/hard-cases.md has no row {case:?}; tests/hard_cases/run makes it"))
        .to_owned()
}

#[track_caller]
fn read(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

/// One digit, so that other processors and profiles tell the same.
fn rounded(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { format!("{value:.0e}") }
}
