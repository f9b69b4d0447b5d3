//! Reads keys that the tables of several effects have.

use std::ops::RangeInclusive;

use headrace_config::{ConfigError, Section};

/// Accepts only a single table, for an effect on the vehicle or the tunnel.
///
/// Errors: there is more than one table.
pub(super) fn only_one(tables: Vec<Section<'_>>) -> Result<Vec<Section<'_>>, ConfigError> {
    match tables.get(1) {
        Some(second) => Err(second.invalid_itself("is a second table; this effect allows only one")),
        None => Ok(tables),
    }
}

/// Reads two numbers `[least, most]`.
///
/// Errors: the value isn't two numbers, a number is outside `allowed`, or the first is larger than the second.
pub(super) fn span(
    table: &Section<'_>,
    key: &'static str,
    allowed: RangeInclusive<f64>,
    usual: [f64; 2],
) -> Result<[f64; 2], ConfigError> {
    match table.numbers(key, allowed)?.as_deref() {
        None => Ok(usual),
        Some([least, most]) if least <= most => Ok([*least, *most]),
        Some(_) => Err(table.invalid(key, "must be two numbers [least, most]")),
    }
}

/// Reads a number that defaults to zero.
///
/// Errors: the number is outside `allowed`.
pub(super) fn or_zero(
    table: &Section<'_>,
    key: &'static str,
    allowed: RangeInclusive<f64>,
) -> Result<f64, ConfigError> {
    Ok(table.number(key, allowed)?.unwrap_or(0.0))
}

/// Checks that at least one of an effect's keys isn't zero, so that the effect changes something.
///
/// Errors: all of the keys are zero or absent.
pub(super) fn some_not_zero(table: &Section<'_>, values: &[(&'static str, f64)]) -> Result<(), ConfigError> {
    if values.iter().any(|(_, value)| *value != 0.0) {
        return Ok(());
    }
    let keys: Vec<&str> = values.iter().map(|(key, _)| *key).collect();
    match keys.as_slice() {
        [] => Ok(()),
        [only] => Err(table.invalid(only, "must not be zero: the effect would change nothing")),
        [first, ..] => {
            let problem = format!("at least one of {} must not be zero", keys.join(", "));
            Err(table.invalid(first, &problem))
        }
    }
}
