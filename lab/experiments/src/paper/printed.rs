//! Numbers as the paper prints them, and the intervals of values that they allow.

use core::fmt;

use headrace_geometry::math;
use serde::{Serialize, Serializer};

use super::PaperError;

/// Tolerance for rounding errors of recomputed values, as a share of a printed number's last digit. In floating point,
/// 0.196 x 8 / 2 is slightly off 0.784.
const ROUNDING: f64 = 1e-6;
/// Maximum number of decimals of a printed number. It is larger than in any table.
const MOST_DECIMALS: usize = 6;

/// A number with its printed digits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Printed {
    value: f64,
    decimals: usize,
}

/// Way in which a printed number's digits follow from the recomputed value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Digits {
    /// Both rounding and truncating give the digits.
    Both,
    /// Only rounding gives the digits.
    Rounded,
    /// Only truncating gives the digits.
    Truncated,
    /// Neither rounding nor truncating gives the digits.
    Neither,
}

/// Interval of values that are consistent with a printed number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Lower bound.
    pub low: f64,
    /// Upper bound, excluded.
    pub high: f64,
}

impl Digits {
    /// Whether rounding the recomputed value gives the printed digits.
    pub fn rounded(self) -> bool {
        matches!(self, Self::Both | Self::Rounded)
    }
}

impl Printed {
    pub(super) fn parse(text: &str) -> Option<Self> {
        let value = text.parse::<f64>().ok().filter(|value| value.is_finite())?;
        let decimals = text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        (decimals <= MOST_DECIMALS).then_some(Self { value, decimals })
    }

    /// Value of the printed number.
    pub fn value(&self) -> f64 {
        self.value
    }

    /// Returns how the printed digits follow from the recomputed value `ours`.
    pub fn digits_of(&self, ours: f64) -> Digits {
        let beyond = (ours - self.value) / self.last_digit();
        let rounded = beyond.abs() <= 0.5 + ROUNDING;
        let truncated = (-ROUNDING..1.0 - ROUNDING).contains(&beyond);
        match (rounded, truncated) {
            (true, true) => Digits::Both,
            (true, false) => Digits::Rounded,
            (false, true) => Digits::Truncated,
            (false, false) => Digits::Neither,
        }
    }

    /// Values that round to the printed number.
    pub fn rounded_from(&self) -> Interval {
        let half = self.last_digit() / 2.0;
        Interval { low: self.value - half, high: self.value + half }
    }

    /// Values that round or truncate to the printed number.
    pub fn read_from(&self) -> Interval {
        let digit = self.last_digit();
        Interval { low: self.value - digit / 2.0, high: self.value + digit }
    }

    fn last_digit(&self) -> f64 {
        (0..self.decimals).fold(1.0, |digit, _| digit / 10.0)
    }
}

impl fmt::Display for Printed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{:.*}", self.decimals, self.value))
    }
}

impl Serialize for Printed {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_f64(self.value)
    }
}

impl Interval {
    const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    /// Multiplies both bounds by a positive factor.
    pub(super) fn scaled(self, factor: f64) -> Self {
        Self { low: self.low * factor, high: self.high * factor }
    }

    /// Intersection of intervals. It is empty if `low` is not below `high`.
    pub(super) fn common(intervals: impl IntoIterator<Item = Self>) -> Self {
        intervals.into_iter().fold(Self::ALL, |common, one| Self {
            low: common.low.max(one.low),
            high: common.high.min(one.high),
        })
    }

    /// Distance of `value` from the interval; zero inside.
    pub(super) fn missed_by(self, value: f64) -> f64 {
        (self.low - value).max(value - self.high).max(0.0)
    }
}

/// Difference of the recomputed number from the printed one, percent of the printed number; `None` for a printed zero.
pub(super) fn difference_percent(ours: f64, printed: Printed) -> Option<f64> {
    // Differences are rounded, so that a rounding error isn't displayed as -0.00.
    let percent = (ours / printed.value - 1.0) * 100.0;
    percent.is_finite().then(|| math::round_to_i64(percent * 1e6) as f64 / 1e6)
}

/// A line of a table of printed numbers.
#[derive(Debug, Clone)]
pub(super) struct Line {
    table: u8,
    number: usize,
    cells: Vec<(&'static str, &'static str)>,
}

impl Line {
    /// Text in a column.
    pub(super) fn text(&self, column: &'static str) -> Result<&'static str, PaperError> {
        let cell = self.cells.iter().find(|(name, _)| *name == column).map(|(_, text)| *text);
        cell.ok_or_else(|| self.wrong(column))
    }

    /// The number in a column.
    pub(super) fn printed(&self, column: &'static str) -> Result<Printed, PaperError> {
        Printed::parse(self.text(column)?).ok_or_else(|| self.wrong(column))
    }

    /// The number of heads in this line; 1 if the table has no column of heads.
    pub(super) fn heads(&self) -> Result<u8, PaperError> {
        self.text("heads").map_or(Ok(1), |text| text.parse().map_err(|_| self.wrong("heads")))
    }

    fn wrong(&self, column: &'static str) -> PaperError {
        PaperError::Printed { table: self.table, line: self.number, column }
    }
}

/// Lines of the paper's table number `table`, from 1 to 5; empty for any other number.
pub(super) fn lines(table: u8) -> Vec<Line> {
    let text = match table {
        1 => include_str!("table1.csv"),
        2 => include_str!("table2.csv"),
        3 => include_str!("table3.csv"),
        4 => include_str!("table4.csv"),
        5 => include_str!("table5.csv"),
        _ => "",
    };
    let mut rows = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#'));
    let columns = rows.next().map_or("", |(_, line)| line);
    rows.map(|(index, line)| Line {
        table,
        number: index + 1,
        cells: columns.split(',').zip(line.split(',')).collect(),
    })
    .collect()
}
