//! Smooth motion through equidistant knots: uniform cubic B-splines. Their acceleration has no jumps.

use headrace_geometry::math;

use crate::random::Stream;

/// Offsets of the vehicle: along the axis, left and up, m; roll, pitch and yaw, radians.
pub type Offsets = [f64; 6];

/// Control points of a spline, spaced `spacing_s` apart in time. The first point lies one spacing before the start.
///
/// The curve stays within the hull of four neighbouring points, so none of its values lies outside the range of these
/// four points.
#[derive(Debug, Clone, PartialEq)]
pub struct Knots {
    spacing_s: f64,
    points: Vec<Offsets>,
}

impl Knots {
    /// Creates a spline with a duration of `duration_s`. Its control point number k, counted from -1, is `point(k)` and
    /// lies at time k * `spacing_s`.
    pub fn new(duration_s: f64, spacing_s: f64, mut point: impl FnMut(i64) -> Offsets) -> Self {
        let last = math::floor_to_i64(duration_s / spacing_s) + 2;
        Self { spacing_s, points: (-1..=last).map(&mut point).collect() }
    }

    /// Sets a component of control point number k, counted from -1.
    pub(super) fn set(&mut self, k: i64, component: usize, value: f64) {
        let point = usize::try_from(k + 1).ok().and_then(|index| self.points.get_mut(index));
        if let Some(slot) = point.and_then(|point| point.get_mut(component)) {
            *slot = value;
        }
    }

    /// Offsets of the vehicle `after_s` seconds after the start. Before the first and after the last knot the motion
    /// continues straight.
    pub fn at(&self, after_s: f64) -> Offsets {
        let inside = (self.points.len() as f64 - 3.0) * self.spacing_s;
        let within_s = after_s.clamp(0.0, inside.max(0.0));
        let (first, weights) = self.weights(within_s);
        let place = self.sum(first, weights);
        let beyond_s = after_s - within_s;
        if beyond_s == 0.0 {
            return place;
        }
        let (first, weights) = self.slopes(within_s);
        let speed = self.sum(first, weights);
        let mut beyond = place;
        for (value, speed) in beyond.iter_mut().zip(speed) {
            *value += speed * beyond_s;
        }
        beyond
    }

    fn split(&self, after_s: f64) -> (usize, f64) {
        let position = after_s / self.spacing_s;
        let most = self.points.len().saturating_sub(4);
        let first = usize::try_from(math::floor_to_i64(position)).unwrap_or(0).min(most);
        (first, position - first as f64)
    }

    fn weights(&self, after_s: f64) -> (usize, [f64; 4]) {
        let (first, u) = self.split(after_s);
        let v = 1.0 - u;
        let (u2, u3) = (u * u, u * u * u);
        let weights = [v * v * v, 3.0 * u3 - 6.0 * u2 + 4.0, -3.0 * u3 + 3.0 * u2 + 3.0 * u + 1.0, u3];
        (first, weights.map(|weight| weight / 6.0))
    }

    fn slopes(&self, after_s: f64) -> (usize, [f64; 4]) {
        let (first, u) = self.split(after_s);
        let v = 1.0 - u;
        let u2 = u * u;
        let slopes = [-v * v, 3.0 * u2 - 4.0 * u, -3.0 * u2 + 2.0 * u + 1.0, u2];
        (first, slopes.map(|slope| slope / (2.0 * self.spacing_s)))
    }

    fn sum(&self, first: usize, weights: [f64; 4]) -> Offsets {
        let mut sum = [0.0; 6];
        for (point, weight) in self.points.iter().skip(first).zip(weights) {
            for (total, value) in sum.iter_mut().zip(point) {
                *total += weight * value;
            }
        }
        sum
    }
}

/// A random drift about zero with amplitude `reach` and period `period_s`.
///
/// Control points are half a period apart and uniformly distributed. The standard deviation is 0.4 of the amplitude.
pub fn wandering(stream: Stream, duration_s: f64, period_s: f64, reach: Offsets) -> Knots {
    Knots::new(duration_s, period_s / 2.0, |k| {
        // One is added because step numbers are not negative, but the first control point has number -1.
        let step = (k + 1).unsigned_abs();
        let numbers = [0, 1, 2].map(|block| stream.block(step, block).uniform());
        let mut point = reach;
        for (value, number) in point.iter_mut().zip(numbers.iter().flatten()) {
            *value *= 2.0 * number - 1.0;
        }
        point
    })
}
