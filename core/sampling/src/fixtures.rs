//! Sonar heads for the tests of this crate.

use super::head::{HeadBody, HeadSpec};
use headrace_geometry::frames::{Mount, Rot, Vec3};
use headrace_geometry::math;

/// A head in FAST mode at `place` on the vehicle, facing forward or aft, with a body of radius `radius_m`.
pub(super) fn head([x, y, z]: [f64; 3], aft: bool, radius_m: f64) -> HeadSpec {
    HeadSpec {
        mount: Mount {
            position: Vec3::new(x, y, z),
            rotation: Rot::from_roll_pitch_yaw(0.0, 0.0, if aft { math::PI } else { 0.0 }),
        },
        step_rad: f64::to_radians(0.9),
        ping_period_s: 0.02,
        range_m: [0.2, 10.0],
        sound_speed_mps: 1500.0,
        beam_rad: f64::to_radians(1.4),
        body: HeadBody { radius_m, ahead_m: 0.03, behind_m: 0.2 },
    }
}
