//! Stretches of the tunnel, given by chainage.

use headrace_config::{ConfigError, Section};

/// A stretch of the tunnel: chainages from `from_m` up to, but not including, `to_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stretch {
    /// Chainage of the start, m; minus infinity if the stretch has no start.
    pub from_m: f64,
    /// Chainage of the end, m; infinity if the stretch has no end.
    pub to_m: f64,
}

impl Stretch {
    /// The stretch that covers the whole tunnel.
    pub(crate) const ALL: Self = Self { from_m: f64::NEG_INFINITY, to_m: f64::INFINITY };

    /// Reads `from_m` and `to_m`. Without one of the keys, the stretch has no limit on that side.
    ///
    /// Errors: a limit is outside the tunnel, or the end is not beyond the start.
    pub(crate) fn read(table: &Section<'_>, length_m: f64) -> Result<Self, ConfigError> {
        let from_m = table.number("from_m", 0.0..=length_m)?;
        let to_m = table.number("to_m", 0.0..=length_m)?;
        let stretch =
            Self { from_m: from_m.unwrap_or(Self::ALL.from_m), to_m: to_m.unwrap_or(Self::ALL.to_m) };
        if stretch.to_m <= stretch.from_m {
            return Err(table.invalid("to_m", &format!("must be above from_m, which is {}", stretch.from_m)));
        }
        Ok(stretch)
    }

    /// Whether a chainage lies in the stretch.
    pub(crate) fn has(&self, chainage_m: f64) -> bool {
        (self.from_m..self.to_m).contains(&chainage_m)
    }

    /// Whether the stretch overlaps another stretch.
    pub(crate) fn meets(&self, other: &Self) -> bool {
        self.from_m < other.to_m && other.from_m < self.to_m
    }
}
