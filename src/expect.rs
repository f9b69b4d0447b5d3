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
    let mut got = serde_json::to_value(report)?;
    for side in [&mut expected, &mut got] {
        if let Some(object) = side.as_object_mut() {
            object.remove("log");
        }
        // A replay has no ports.
        for source in side["sources"].as_array_mut().into_iter().flatten().filter_map(Value::as_object_mut) {
            source.remove("line");
        }
    }
    let mut differences = Vec::new();
    compare("", &expected, &got, &mut differences);
    for difference in differences.iter().take(SHOWN) {
        eprintln!("differs: {difference}");
    }
    if differences.len() > SHOWN {
        eprintln!("and {} more", differences.len() - SHOWN);
    }
    Ok(!differences.is_empty())
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
                compare(&format!("{path}/{index}"), a, b, differences);
            }
        }
        _ if expected != got => differences.push(format!("{path}: {got} in place of {expected}")),
        _ => {}
    }
}
