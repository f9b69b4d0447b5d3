//! Comparison of a report with one made before.

use std::path::Path;

use headrace_core::app::report::Report;
use serde_json::Value;

use crate::failure::Failure;
use crate::files;

/// Differences that are shown one by one.
const SHOWN: usize = 20;

/// Whether the report differs from a golden one in anything but the log's own name and hash, and what the ports' lines went
/// through; says where on stderr.
pub(crate) fn differs(report: &Report, golden: &Path) -> Result<bool, Failure> {
    let mut expected: Value = serde_json::from_str(&files::read(golden)?).map_err(|error| {
        Failure::Usage(format!("reading {}: {error}; wanted is a report of headrace", golden.display()))
    })?;
    drop_log(&mut expected);
    Ok(tell(&expected, &without_log(report)?))
}

/// Writes the report as the golden one, without the log's own name and hash; says on stderr what that changes.
pub(crate) fn bless(report: &Report, golden: &Path) -> Result<(), Failure> {
    let got = without_log(report)?;
    let old = if golden.exists() { serde_json::from_str(&files::read(golden)?).ok() } else { None };
    match old {
        Some(mut old) => {
            drop_log(&mut old);
            if !tell(&old, &got) {
                eprintln!("{}: nothing has changed", golden.display());
                return Ok(());
            }
        }
        None => eprintln!("{}: a new golden report", golden.display()),
    }
    let mut text = serde_json::to_string_pretty(&got)?;
    text.push('\n');
    files::write(golden, text.as_bytes())
}

fn without_log(report: &Report) -> Result<Value, Failure> {
    let mut value = serde_json::to_value(report)?;
    drop_log(&mut value);
    Ok(value)
}

fn drop_log(report: &mut Value) {
    if let Some(object) = report.as_object_mut() {
        object.remove("log");
    }
    // A replay has no ports.
    let sources = report.get_mut("sources").and_then(Value::as_array_mut);
    for source in sources.into_iter().flatten().filter_map(Value::as_object_mut) {
        source.remove("line");
    }
}

/// Says where two reports differ; whether they do.
fn tell(expected: &Value, got: &Value) -> bool {
    let mut differences = Vec::new();
    compare("", expected, got, &mut differences);
    differences.sort_by_key(|difference| rank(difference));
    for difference in differences.iter().take(SHOWN) {
        eprintln!("differs: {difference}");
    }
    if differences.len() > SHOWN {
        eprintln!("and {} more", differences.len() - SHOWN);
    }
    !differences.is_empty()
}

/// What is told first: the report as a whole, sections' verdicts, the rest of the sections, all else.
fn rank(difference: &str) -> u8 {
    let path = difference.split(": ").next().unwrap_or_default();
    match path {
        _ if path.matches('/').count() == 1 => 0,
        _ if path.starts_with("/sections/") && path.ends_with("/verdict") => 1,
        _ if path.starts_with("/sections/") => 2,
        _ => 3,
    }
}

/// What an entry of a list is called: a section by where it lies, anything else by its number.
fn entry_name(index: usize, entry: &Value) -> String {
    let metres = |key: &str| entry.get(key).and_then(Value::as_f64);
    match (metres("start_m"), metres("end_m")) {
        (Some(start), Some(end)) => format!("{index}[{start}..{end}m]"),
        _ => index.to_string(),
    }
}

fn compare(path: &str, expected: &Value, got: &Value, differences: &mut Vec<String>) {
    match (expected, got) {
        (Value::Object(a), Value::Object(b)) => {
            for key in a.keys().chain(b.keys().filter(|key| !a.contains_key(*key))) {
                let below = format!("{path}/{key}");
                compare(
                    &below,
                    a.get(key).unwrap_or(&Value::Null),
                    b.get(key).unwrap_or(&Value::Null),
                    differences,
                );
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            if a.len() != b.len() {
                differences.push(format!("{path}: {} entries in place of {}", b.len(), a.len()));
            }
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                compare(&format!("{path}/{}", entry_name(index, a)), a, b, differences);
            }
        }
        _ if expected != got => differences.push(format!("{path}: {got} in place of {expected}")),
        _ => {}
    }
}
