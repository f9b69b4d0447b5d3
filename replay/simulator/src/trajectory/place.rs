//! Poses of the vehicle along the tunnel, relative to the axis.

use super::knots::Offsets;

/// Pose of the vehicle relative to the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Chainage of the vehicle, m.
    pub chainage_m: f64,
    /// Position of the vehicle in the cross-section: y left, z up from the floor's centre, m.
    pub across_m: [f64; 2],
    /// Roll, pitch and yaw of the vehicle relative to the axis, radians.
    pub turned_rad: [f64; 3],
}

/// Reference for the speeds of a trajectory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// The speeds are relative to the water. A current carries the vehicle.
    Water,
    /// The trajectory is given over ground. A current does not change it.
    Tunnel,
}

impl Place {
    pub(super) fn from_offsets([x, y, z, roll, pitch, yaw]: Offsets) -> Self {
        Self { chainage_m: x, across_m: [y, z], turned_rad: [roll, pitch, yaw] }
    }

    pub(super) fn shift(&mut self, [x, y, z, roll, pitch, yaw]: &Offsets) {
        self.chainage_m += x;
        self.across_m = [self.across_m[0] + y, self.across_m[1] + z];
        let [a, b, c] = self.turned_rad;
        self.turned_rad = [a + roll, b + pitch, c + yaw];
    }
}
