//! Positions of objects in the tunnel, before and after the tunnel's wall is displaced.

use headrace_geometry::tunnel::Profile;

use super::axis::Axis;
use super::stations::Scales;
use super::tube::Tube;
use super::vector::Frame;

/// Largest ratio of an object's span of chainage to its length. It occurs on the inside of the tightest bend.
const BEND: f64 = 2.0;

/// A shape, the number of its feature, and the range of chainage that the shape extends into, m.
#[derive(Debug, Clone)]
pub(super) struct Placed<S> {
    pub(super) shape: S,
    pub(super) feature: u16,
    pub(super) span_m: (f64, f64),
}

/// Properties of the tunnel before its wall is displaced.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub(super) profile: &'a Profile,
    pub(super) scales: &'a Scales,
    pub(super) axis: &'a Axis,
    pub(super) length_m: f64,
    /// Largest distance of the tunnel's wall to either side of the axis, m.
    pub(super) half_width_m: f64,
}

/// Range of chainage of an object at `chainage_m`, m. `reach_m` is the object's extent along the axis relative to
/// `chainage_m`, from the least to the largest.
pub(super) fn span_m(axis: &Axis, chainage_m: f64, reach_m: [f64; 2]) -> (f64, f64) {
    let [back_m, ahead_m] = reach_m.map(|reach_m| if axis.is_straight() { reach_m } else { BEND * reach_m });
    (chainage_m + back_m, chainage_m + ahead_m)
}

/// The tunnel in which features are placed.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) tube: &'a Tube,
    pub(super) length_m: f64,
}

impl Ground<'_> {
    /// Frame of the axis at `chainage_m`: along the tunnel, left, up. The origin is the point (y, z) of the
    /// cross-section.
    pub(super) fn frame(&self, chainage_m: f64, [y, z]: [f64; 2]) -> Frame {
        Frame::across(self.tube.axis().station(chainage_m), [y, z])
    }

    /// Range of chainage that lies within `reach_m` of a point of the tunnel at `chainage_m`, m.
    pub(super) fn span_m(&self, chainage_m: f64, reach_m: f64) -> (f64, f64) {
        span_m(self.tube.axis(), chainage_m, [-reach_m, reach_m])
    }
}
