//! Compares a report with a golden report, which states the expected results.

use std::path::Path;

use headrace_monitor::report::Report;
use serde_json::Value;

use crate::failure::Failure;
use crate::files;
use crate::logging::complain;

/// Maximum number of differences that are listed for two reports.
const SHOWN: usize = 20;

/// A golden report, which replays are compared with. A golden report lacks the log's name and hash, the program's
/// version, and the history of ports.
pub(crate) struct Golden {
    expected: Value,
    allowed: Allowed,
}

impl Golden {
    /// Reads a golden report.
    ///
    /// Errors: the file can't be read, or isn't a report.
    pub(crate) fn read(path: &Path) -> Result<Self, Failure> {
        let wrong = |why: String| {
            Failure::Usage(format!("reading {}: {why}; expected a report of headrace", path.display()))
        };
        let mut expected: Value =
            serde_json::from_str(&files::read_report(path)?).map_err(|error| wrong(error.to_string()))?;
        let allowed = Allowed::take(&mut expected).map_err(wrong)?;
        drop_log(&mut expected);
        Ok(Self { expected, allowed })
    }

    /// Whether a report differs from the golden one by more than the tolerances. Lists the differences on
    /// stderr.
    ///
    /// The log, the program's version and the ports aren't compared.
    pub(crate) fn differs(&self, report: &Report) -> Result<bool, Failure> {
        Ok(tell(&self.expected, &without_log(report)?, &self.allowed))
    }
}

/// Replaces the golden report, keeps its tolerances, and lists the differences on stderr.
///
/// The new report has no name and hash of the log, and no version of the program.
pub(crate) fn bless(report: &Report, golden: &Path) -> Result<(), Failure> {
    let mut got = without_log(report)?;
    let old: Option<Value> =
        if golden.exists() { serde_json::from_str(&files::read_report(golden)?).ok() } else { None };
    match old {
        Some(mut old) => {
            let before = old.clone();
            let stated: Option<Value> = old.get(TOLERANCES).cloned();
            let allowed = Allowed::take(&mut old).unwrap_or_default();
            drop_log(&mut old);
            let differs = tell(&old, &got, &allowed);
            if let (Some(stated), Some(report)) = (stated, got.as_object_mut()) {
                report.insert(TOLERANCES.to_owned(), stated);
            }
            // Keys that a golden report of an earlier version doesn't have are added.
            let is_new = |key: &String| before.get(key).is_none();
            if !differs && !got.as_object().is_some_and(|got| got.keys().any(is_new)) {
                complain(&format!("{}: unchanged", golden.display()));
                return Ok(());
            }
        }
        None => complain(&format!("{}: new golden report", golden.display())),
    }
    let mut text = serde_json::to_string_pretty(&got)?;
    text.push('\n');
    files::write(golden, text.as_bytes())
}

/// Key of the tolerances in a golden report.
///
/// The tolerances are listed by path. In a path, `*` matches any name or index. The value is the largest
/// allowed difference of two numbers, or `"any"`.
const TOLERANCES: &str = "tolerances";

/// Allowed differences by path; `None` allows any difference.
#[derive(Debug, Default)]
struct Allowed(Vec<(Vec<String>, Option<f64>)>);

impl Allowed {
    /// Takes the tolerances out of a golden report.
    fn take(golden: &mut Value) -> Result<Self, String> {
        let stated = golden.as_object_mut().and_then(|golden| golden.remove(TOLERANCES));
        let Some(stated) = stated else { return Ok(Self::default()) };
        let entries = stated.as_object().ok_or_else(|| format!("{TOLERANCES} isn't an object"))?;
        let entry = |(path, within): (&String, &Value)| {
            let within = match within {
                Value::String(any) if any == "any" => None,
                other => Some(other.as_f64().filter(|within| *within >= 0.0).ok_or_else(|| {
                    format!(
                        "{TOLERANCES} of {path:?} is {other}; expected a number not below zero or \"any\""
                    )
                })?),
            };
            Ok((path.split('/').map(str::to_owned).collect(), within))
        };
        entries.iter().map(entry).collect::<Result<_, String>>().map(Self)
    }

    /// Whether the difference of two values is allowed.
    fn covers(&self, path: &str, expected: &Value, got: &Value) -> bool {
        let names: Vec<&str> = path.split('/').collect();
        let fits = |wanted: &[String]| {
            // The tolerance "any" also covers all paths that begin with its path.
            wanted.len() <= names.len()
                && wanted.iter().zip(&names).all(|(wanted, name)| {
                    wanted == "*" || wanted == name || name.split('[').next() == Some(wanted)
                })
        };
        let apart = expected.as_f64().zip(got.as_f64()).map(|(expected, got)| (expected - got).abs());
        self.0.iter().filter(|(wanted, _)| fits(wanted)).any(|(wanted, within)| match within {
            None => true,
            Some(within) => wanted.len() == names.len() && apart.is_some_and(|apart| apart <= *within),
        })
    }
}

fn without_log(report: &Report) -> Result<Value, Failure> {
    let mut value = serde_json::to_value(report)?;
    drop_log(&mut value);
    Ok(value)
}

/// Removes the log and the ports from a report. A replay has no ports to compare.
fn drop_log(report: &mut Value) {
    if let Some(object) = report.as_object_mut() {
        object.insert("log".to_owned(), Value::Null);
        object.insert("program".to_owned(), Value::Null);
    }
    let sources = report.get_mut("sources").and_then(Value::as_array_mut);
    for source in sources.into_iter().flatten().filter_map(Value::as_object_mut) {
        source.insert("line".to_owned(), Value::Null);
    }
}

/// Lists the differences of two reports. Returns whether there are any.
fn tell(expected: &Value, got: &Value, allowed: &Allowed) -> bool {
    let mut differences = Vec::new();
    compare("", expected, got, allowed, &mut differences);
    differences.sort_by_key(|difference| rank(difference));
    for difference in differences.iter().take(SHOWN) {
        complain(&format!("differs: {difference}"));
    }
    if differences.len() > SHOWN {
        complain(&format!("and {} more", differences.len() - SHOWN));
    }
    !differences.is_empty()
}

/// Position of a difference in the list, which has this order: the report as a whole, the verdicts of sections, other
/// differences of sections, and everything else.
fn rank(difference: &str) -> u8 {
    let path = difference.split(": ").next().unwrap_or_default();
    match path {
        _ if path.matches('/').count() == 1 => 0,
        _ if path.starts_with("/sections/") && path.ends_with("/verdict") => 1,
        _ if path.starts_with("/sections/") => 2,
        _ => 3,
    }
}

/// Name of an entry in a list. The name of a section is its bounds; other entries are named by index.
fn entry_name(index: usize, entry: &Value) -> String {
    let metres = |key: &str| entry.get(key).and_then(Value::as_f64);
    match (metres("start_m"), metres("end_m")) {
        (Some(start), Some(end)) => format!("{index}[{start}..{end}m]"),
        _ => index.to_string(),
    }
}

fn compare(path: &str, expected: &Value, got: &Value, allowed: &Allowed, differences: &mut Vec<String>) {
    match (expected, got) {
        (Value::Object(a), Value::Object(b)) => {
            for key in a.keys().chain(b.keys().filter(|key| !a.contains_key(*key))) {
                let below = format!("{path}/{key}");
                compare(
                    &below,
                    a.get(key).unwrap_or(&Value::Null),
                    b.get(key).unwrap_or(&Value::Null),
                    allowed,
                    differences,
                );
            }
        }
        (Value::Array(a), Value::Array(b)) => {
            if a.len() != b.len() && !allowed.covers(path, expected, got) {
                differences.push(format!("{path}: {} entries, expected {}", b.len(), a.len()));
            }
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                compare(&format!("{path}/{}", entry_name(index, a)), a, b, allowed, differences);
            }
        }
        _ if expected != got && !allowed.covers(path, expected, got) => {
            differences.push(format!("{path}: {got}, expected {expected}"));
        }
        _ => {}
    }
}
