//! The tunnel and its wall, for placing features.

use super::frame::Frame;
use super::placing;
use super::tube::Tube;

/// The tunnel that features are placed in.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) tube: &'a Tube,
    pub(super) length_m: f64,
}

impl Ground<'_> {
    /// Frame of the axis at `chainage_m`: along the tunnel, left, up. The origin is point (y, z) of the section.
    pub(super) fn frame(&self, chainage_m: f64, [y, z]: [f64; 2]) -> Frame {
        Frame::across(self.tube.axis().station(chainage_m), [y, z])
    }

    /// Range of chainage that lies within `reach_m` of a point of the tunnel at `chainage_m`, m.
    pub(super) fn span_m(&self, chainage_m: f64, reach_m: f64) -> (f64, f64) {
        placing::span_m(self.tube.axis(), chainage_m, [-reach_m, reach_m])
    }
}
