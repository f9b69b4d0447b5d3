//! Comparison of a report with one made before.

use std::path::Path;

use headrace_monitor::report::Report;
use serde_json::Value;

use crate::failure::Failure;
use crate::files;

/// Differences that are shown one by one.
const SHOWN: usize = 20;

/// Whether the report differs from a golden one in anything but the log's own name and hash, what the ports' lines went
/// through, and what the golden one itself allows; says where on stderr.
pub(crate) fn differs(report: &Report, golden: &Path) -> Result<bool, Failure> {
    let wrong = |why: String| {
        Failure::Usage(format!("reading {}: {why}; wanted is a report of headrace", golden.display()))
    };
    let mut expected: Value =
        serde_json::from_str(&files::read(golden)?).map_err(|error| wrong(error.to_string()))?;
    let allowed = Allowed::take(&mut expected).map_err(wrong)?;
    drop_log(&mut expected);
    Ok(tell(&expected, &without_log(report)?, &allowed))
}

/// Writes the report as the golden one, without the log's own name and hash, and with what that one allows; says on stderr
/// what it changes.
pub(crate) fn bless(report: &Report, golden: &Path) -> Result<(), Failure> {
    let mut got = without_log(report)?;
    let old: Option<Value> =
        if golden.exists() { serde_json::from_str(&files::read(golden)?).ok() } else { None };
    match old {
        Some(mut old) => {
            let stated: Option<Value> = old.get(TOLERANCES).cloned();
            let allowed = Allowed::take(&mut old).unwrap_or_default();
            drop_log(&mut old);
            if !tell(&old, &got, &allowed) {
                eprintln!("{}: nothing has changed", golden.display());
                return Ok(());
            }
            if let (Some(stated), Some(report)) = (stated, got.as_object_mut()) {
                report.insert(TOLERANCES.to_owned(), stated);
            }
        }
        None => eprintln!("{}: a new golden report", golden.display()),
    }
    let mut text = serde_json::to_string_pretty(&got)?;
    text.push('\n');
    files::write(golden, text.as_bytes())
}

/// Key of a golden report with what may differ: from a path, in which `*` stands for any one name or number, to how far
/// apart two numbers may be, or `"any"`.
const TOLERANCES: &str = "tolerances";

/// What may differ.
#[derive(Debug, Default)]
struct Allowed(Vec<(Vec<String>, Option<f64>)>);

impl Allowed {
    /// Takes it out of a golden report.
    fn take(golden: &mut Value) -> Result<Self, String> {
        let stated = golden.as_object_mut().and_then(|golden| golden.remove(TOLERANCES));
        let Some(stated) = stated else { return Ok(Self::default()) };
        let entries = stated.as_object().ok_or_else(|| format!("{TOLERANCES} is no table"))?;
        let entry = |(path, within): (&String, &Value)| {
            let within = match within {
                Value::String(any) if any == "any" => None,
                other => Some(other.as_f64().filter(|within| *within >= 0.0).ok_or_else(|| {
                    format!("{TOLERANCES} of {path:?} is {other}; allowed are a number from zero and \"any\"")
                })?),
            };
            Ok((path.split('/').map(str::to_owned).collect(), within))
        };
        entries.iter().map(entry).collect::<Result<_, String>>().map(Self)
    }

    /// Whether two values that differ may do so.
    fn covers(&self, path: &str, expected: &Value, got: &Value) -> bool {
        let names: Vec<&str> = path.split('/').collect();
        let fits = |wanted: &[String]| {
            // Below what may be anything, all may.
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
fn tell(expected: &Value, got: &Value, allowed: &Allowed) -> bool {
    let mut differences = Vec::new();
    compare("", expected, got, allowed, &mut differences);
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
                differences.push(format!("{path}: {} entries in place of {}", b.len(), a.len()));
            }
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                compare(&format!("{path}/{}", entry_name(index, a)), a, b, allowed, differences);
            }
        }
        _ if expected != got && !allowed.covers(path, expected, got) => {
            differences.push(format!("{path}: {got} in place of {expected}"));
        }
        _ => {}
    }
}
