//! Rounding of values to the resolution of the files, and numbers as text.

use super::data::Point;
use super::error::FileError;

/// Rounds `value` to a whole number of steps of `1 / per_unit`.
///
/// Errors: the value is not finite, or outside the range.
pub(super) fn steps(
    value: f64,
    per_unit: f64,
    [least, most]: [i64; 2],
    what: impl FnOnce() -> String,
) -> Result<i64, FileError> {
    let rounded = (value * per_unit).round();
    if rounded >= least as f64 && rounded <= most as f64 {
        #[expect(clippy::cast_possible_truncation, reason = "it is whole and within the range")]
        return Ok(rounded as i64);
    }
    Err(FileError::Value {
        what: what(),
        value,
        least: least as f64 / per_unit,
        most: most as f64 / per_unit,
    })
}

/// Appends a number with `digits` decimals. `steps` is the number in units of its last decimal.
pub(super) fn push_decimal(text: &mut Vec<u8>, steps: i64, digits: usize) {
    if steps < 0 {
        text.push(b'-');
    }
    let start = text.len();
    let mut rest = steps.unsigned_abs();
    while rest > 0 || text.len() < start + digits + 1 {
        text.push(b"0123456789"[(rest % 10) as usize]);
        rest /= 10;
    }
    text[start..].reverse();
    if digits > 0 {
        text.insert(text.len() - digits, b'.');
    }
}

/// Resolution of a point's values: steps per metre, second and hour. Profiling sonars resolve ranges to 2 mm at best.
pub(super) const PER_M: f64 = 1000.0;
pub(super) const PER_S: f64 = 1000.0;
pub(super) const PER_H: f64 = 100.0;

/// Largest time that a file holds, ms: a year.
const LONGEST_MS: i64 = 366 * 86_400_000;

/// A point's values in whole millimetres, milliseconds and hundredths of an hour. All formats write these rounded
/// values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct RoundedPoint {
    pub(super) position_mm: [i32; 3],
    pub(super) range_mm: u32,
    pub(super) position_sd_mm: u32,
    pub(super) clock_ch: u16,
    pub(super) time_ms: i64,
    pub(super) head: u8,
    pub(super) doubtful: u8,
}

impl RoundedPoint {
    /// Rounds a point. `number` is the index of the point in the file. Errors state it.
    pub(super) fn new(number: u64, point: &Point) -> Result<Self, FileError> {
        let wrong = |name: &str| format!("{name} of point {number}");
        let mut position_mm = [0_i32; 3];
        for (slot, value) in position_mm.iter_mut().zip(point.position_m) {
            let range = [i64::from(i32::MIN), i64::from(i32::MAX)];
            *slot = narrow(steps(value, PER_M, range, || wrong("position_m"))?);
        }
        let millimetres = |value: f64, name: &str| {
            // PLY has a 32-bit float for this value. Up to 2^24, such a float holds whole millimetres.
            steps(value, PER_M, [0, 1 << 24], || wrong(name)).map(narrow)
        };
        // 12 o'clock is 0 h, so values that round up to 12 become 0.
        let clock_ch = steps(point.clock_h, PER_H, [0, 1200], || wrong("clock_h"))? % 1200;
        Ok(Self {
            position_mm,
            range_mm: millimetres(point.range_m, "range_m")?,
            position_sd_mm: millimetres(point.position_sd_m, "position_sd_m")?,
            clock_ch: narrow(clock_ch),
            time_ms: steps(point.time_s, PER_S, [0, LONGEST_MS], || wrong("time_s"))?,
            head: point.head,
            doubtful: u8::from(point.is_doubtful),
        })
    }

    /// Position in m.
    pub(super) fn position_m(&self) -> [f64; 3] {
        self.position_mm.map(|mm| f64::from(mm) / PER_M)
    }
}

/// Converts a value to a narrower type. The caller has checked that the type can hold the value.
fn narrow<T: TryFrom<i64> + Default>(value: i64) -> T {
    T::try_from(value).unwrap_or_default()
}
