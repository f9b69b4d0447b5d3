//! Table of a profile's extent by direction. It gives bounds for a profile with many elements.

use super::plane::{Yz, dot, norm};
use crate::math::{self, TAU};

/// Number of directions in the table of extents.
const DIRECTIONS: usize = 128;

/// Extent of the profile's points in each direction of the table, m.
///
/// Between two directions of the table, both entries together give an upper bound. It is too large by at most half the
/// longest edge of the points' convex hull times tan(pi / [`DIRECTIONS`]) = 0.025. For a flat wall, this is 12 mm per
/// metre.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Support(Vec<(Yz, f64)>);

impl Support {
    /// Computes the table of extents for points.
    pub(super) fn of(points: &[Yz]) -> Self {
        let reach = |k: usize| {
            let (sin, cos) = math::sin_cos(TAU * k as f64 / DIRECTIONS as f64);
            let direction = [cos, sin];
            let reach_m = points.iter().map(|point| dot(*point, direction)).fold(f64::NEG_INFINITY, f64::max);
            (direction, reach_m)
        };
        Self((0..DIRECTIONS).map(reach).collect())
    }

    /// Upper bound of the distance from `origin` to the farthest point, m; at most 0.03 % too large.
    pub(super) fn farthest_m(&self, origin: Yz) -> f64 {
        let reaches = self.0.iter().map(|(direction, reach_m)| reach_m - dot(origin, *direction));
        reaches.fold(0.0, f64::max) / math::cos(TAU / 2.0 / DIRECTIONS as f64)
    }

    /// Upper bound of the dot product (point - origin) . direction for all points of the profile, m.
    pub(super) fn reach_m(&self, origin: Yz, direction: Yz) -> f64 {
        let length = norm(direction);
        let turned = math::wrap(math::atan2(direction[1], direction[0]), TAU) / TAU * DIRECTIONS as f64;
        let before = math::floor_to_i64(turned).rem_euclid(DIRECTIONS as i64);
        let at = |index: i64| {
            let index = usize::try_from(index.rem_euclid(DIRECTIONS as i64)).unwrap_or_default();
            self.0.get(index).map_or(0.0, |(_, reach_m)| *reach_m)
        };
        // The given direction is a weighted sum of the two nearest directions in the table.
        let step = TAU / DIRECTIONS as f64;
        let beyond = (turned - before as f64) * step;
        let (share, other) = (math::sin(step - beyond), math::sin(beyond));
        length * (share * at(before) + other * at(before + 1)) / math::sin(step) - dot(origin, direction)
    }
}
