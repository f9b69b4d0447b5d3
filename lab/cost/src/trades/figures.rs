//! Combines figures of several dives into means with intervals.

use headrace_geometry::math;

use crate::point::{Error, Interval};

/// Mean with its 95 % interval. A single value is returned without an interval.
pub(super) fn spread(values: &[f64]) -> Option<Interval> {
    Interval::mean(values).or_else(|| Interval::quartiles(values))
}

/// Root mean square; `None` without values.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (mut count, mut sum) = (0.0, 0.0);
    for value in values {
        (count, sum) = (count + 1.0, sum + value * value);
    }
    (count > 0.0).then(|| math::sqrt(sum / count))
}

/// An error whose interval comes from one value per dive; `None` without values.
pub(super) fn error(name: &str, unit: &str, values: &[f64]) -> Option<Error> {
    Some(Error::new(name, unit, spread(values)?))
}
