//! Kinds of `[[tunnel.features]]` tables, and the keys that several kinds share.

use headrace_config::{ConfigError, Section};

/// Kind of a feature in the tunnel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Boulder,
    Boulders,
    Bulge,
    Debris,
    Fall,
    Gate,
    Mesh,
    RockTrap,
    SideTunnel,
}

const KINDS: [(&str, Kind); 9] = [
    ("boulder", Kind::Boulder),
    ("boulders", Kind::Boulders),
    ("bulge", Kind::Bulge),
    ("debris", Kind::Debris),
    ("fall", Kind::Fall),
    ("gate", Kind::Gate),
    ("mesh", Kind::Mesh),
    ("rock_trap", Kind::RockTrap),
    ("side_tunnel", Kind::SideTunnel),
];

/// Reads the kind of a feature.
///
/// Errors: the key is missing or is not a known kind.
pub(super) fn kind(table: &Section<'_>) -> Result<Kind, ConfigError> {
    table.required("kind", table.choice("kind", &KINDS)?)
}

/// Reads the name of a feature. The default is its kind and number.
///
/// Errors: the name is empty or too long.
pub(super) fn name(table: &Section<'_>, number: u16) -> Result<String, ConfigError> {
    let given = table.text("name")?;
    if given.as_ref().is_some_and(|name| name.is_empty() || name.len() > 64) {
        return Err(table.invalid("name", "must have 1 to 64 letters"));
    }
    let kind = table.text("kind")?.unwrap_or_default();
    Ok(given.unwrap_or_else(|| format!("{kind}_{number}")))
}

/// Reads `chainage_m`, the middle of a feature, m.
///
/// Errors: the key is missing, or the middle is outside the tunnel.
pub(super) fn chainage_m(table: &Section<'_>, length_m: f64) -> Result<f64, ConfigError> {
    table.required("chainage_m", table.number("chainage_m", 0.0..=length_m)?)
}

/// Reads a required length of a feature.
///
/// Errors: the key is missing or outside `allowed`.
pub(super) fn length_m(
    table: &Section<'_>,
    key: &'static str,
    allowed: core::ops::RangeInclusive<f64>,
) -> Result<f64, ConfigError> {
    table.required(key, table.number(key, allowed)?)
}

/// Reads `chainage_m` and the length of a feature, which is in the key `key`. The feature must lie entirely within the
/// tunnel.
///
/// Errors: a key is missing or out of range, or the feature extends out of the tunnel.
pub(super) fn extent_m(
    table: &Section<'_>,
    key: &'static str,
    tunnel_m: f64,
) -> Result<(f64, f64), ConfigError> {
    let middle_m = chainage_m(table, tunnel_m)?;
    let extent_m = length_m(table, key, 0.01..=1000.0)?;
    if middle_m - extent_m / 2.0 < 0.0 || middle_m + extent_m / 2.0 > tunnel_m {
        let problem = format!("reaches out of the tunnel, which goes from 0 to {tunnel_m} m");
        return Err(table.invalid(key, &problem));
    }
    Ok((middle_m, extent_m))
}

/// Reads the `seed` of scattered objects. The default is 1.
///
/// Errors: the seed is negative.
pub(super) fn seed(table: &Section<'_>) -> Result<u64, ConfigError> {
    Ok(table.integer("seed", 0..=i64::MAX)?.unwrap_or(1).unsigned_abs())
}
