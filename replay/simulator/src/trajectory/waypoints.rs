//! Trajectories through waypoints, with one speed for each stretch between waypoints.

use headrace_geometry::math;

use super::knots::{Knots, Offsets};

/// Interval of the knots, s. The spline rounds corners over four such intervals.
pub(super) const SPACING_S: f64 = 0.5;

/// A waypoint of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Waypoint {
    /// Position and attitude of the vehicle at the waypoint.
    pub(super) at: Offsets,
    /// Speed from the previous waypoint to this one, m/s.
    pub(super) speed_mps: f64,
    /// Duration of the stop at the waypoint, s.
    pub(super) stay_s: f64,
}

/// Knots of a trajectory through waypoints, and its duration, s.
pub(super) fn knots(waypoints: &[Waypoint]) -> (Knots, f64) {
    let mut timed: Vec<(f64, Offsets)> = Vec::new();
    let mut at_s = 0.0;
    for point in waypoints {
        if let Some((_, before)) = timed.last() {
            at_s += distance_m(before, &point.at) / point.speed_mps;
        }
        timed.push((at_s, point.at));
        if point.stay_s > 0.0 {
            at_s += point.stay_s;
            timed.push((at_s, point.at));
        }
    }
    (through(&timed, SPACING_S, at_s), at_s)
}

/// Knots on the straight lines between timed poses. The times of the poses never decrease, but may repeat.
pub(super) fn through(timed: &[(f64, Offsets)], spacing_s: f64, duration_s: f64) -> Knots {
    Knots::new(duration_s, spacing_s, |k| {
        let at_s = k as f64 * spacing_s;
        let after = timed.partition_point(|(when_s, _)| *when_s <= at_s);
        let from = timed.get(after.saturating_sub(1)).or(timed.last());
        match (from, timed.get(after)) {
            (Some((from_s, from)), Some((to_s, to))) if at_s > *from_s => {
                between(from, to, (at_s - from_s) / (to_s - from_s))
            }
            (Some((_, from)), _) => *from,
            (None, _) => [0.0; 6],
        }
    })
}

fn between(from: &Offsets, to: &Offsets, share: f64) -> Offsets {
    let mut place = *from;
    for (value, to) in place.iter_mut().zip(to) {
        *value += (to - *value) * share;
    }
    place
}

fn distance_m([x, y, z, ..]: &Offsets, [u, v, w, ..]: &Offsets) -> f64 {
    math::hypot(math::hypot(u - x, v - y), w - z)
}
