//! Where things are in the tunnel.

use headrace_geometry::tunnel::Profile;

use super::axis::Axis;
use super::stations::Scales;

/// In a bend, what is as far to the inside as is allowed spans as much more chainage than of its own length.
const BEND: f64 = 2.0;

/// A shape, the feature that it belongs to, and the chainages that it reaches into, m.
#[derive(Debug, Clone)]
pub(super) struct Placed<S> {
    pub(super) shape: S,
    pub(super) feature: u16,
    pub(super) span_m: (f64, f64),
}

/// The tunnel before anything displaces its wall.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub(super) profile: &'a Profile,
    pub(super) scales: &'a Scales,
    pub(super) axis: &'a Axis,
    pub(super) length_m: f64,
    /// How far the largest section reaches to the sides of the axis, m.
    pub(super) half_width_m: f64,
}

/// The chainages of what lies within `reach_m` (least, largest) along the axis's direction at `chainage_m`, m.
pub(super) fn span_m(axis: &Axis, chainage_m: f64, reach_m: [f64; 2]) -> (f64, f64) {
    let [back_m, ahead_m] = reach_m.map(|reach_m| if axis.is_straight() { reach_m } else { BEND * reach_m });
    (chainage_m + back_m, chainage_m + ahead_m)
}
