//! Heads that don't make every step that they are told to make.

use headrace_geometry::math::{self, TAU};
use headrace_sensor::measurement::Sounding;

/// How far a head is off its commands. Hosts command steps, not angles, so that a step that isn't made is never made up.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Behind {
    commanded_rad: Option<f64>,
    off_rad: f64,
}

impl Behind {
    /// The next ping, which a head that has made its step there, or hasn't, gives from `sounding`'s angle; `told` says
    /// whether the head knows.
    pub(super) fn step(&mut self, sounding: &mut Sounding, made: bool, told: bool) {
        let commanded_rad = sounding.angle_rad;
        let step_rad =
            self.commanded_rad.map_or(0.0, |before| math::wrap_signed(commanded_rad - before, TAU));
        self.commanded_rad = Some(commanded_rad);
        if !made {
            self.off_rad = math::wrap_signed(self.off_rad - step_rad, TAU);
        }
        sounding.angle_rad += self.off_rad;
        if told {
            sounding.reported_rad += self.off_rad;
        }
    }
}
