//! Offset of heads that lag behind their commanded angles.

use headrace_geometry::math::{self, TAU};
use headrace_sensor::measurement::Sounding;

/// Offset of a head from its commanded angle. Hosts command steps rather than angles, so a missed step leaves the head
/// permanently behind.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Behind {
    commanded_rad: Option<f64>,
    off_rad: f64,
}

impl Behind {
    /// Applies the head's offset to a ping.
    ///
    /// `made` is false if the head missed the step to this ping. `is_reported` is true if the head reports its true
    /// angle, including the offset.
    pub(super) fn step(&mut self, sounding: &mut Sounding, made: bool, is_reported: bool) {
        let commanded_rad = sounding.angle_rad;
        let step_rad =
            self.commanded_rad.map_or(0.0, |before| math::wrap_signed(commanded_rad - before, TAU));
        self.commanded_rad = Some(commanded_rad);
        if !made {
            self.off_rad = math::wrap_signed(self.off_rad - step_rad, TAU);
        }
        sounding.angle_rad += self.off_rad;
        if is_reported {
            sounding.reported_rad += self.off_rad;
        }
    }
}
