//! Places along the tunnel, in the axis's own terms.

use super::knots::Offsets;

/// Where the vehicle is, relative to the axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Chainage, m.
    pub chainage_m: f64,
    /// Place in the cross-section: y left, z up from the floor's centre, m.
    pub across_m: [f64; 2],
    /// Roll, pitch and yaw against the axis, radians.
    pub turned_rad: [f64; 3],
}

/// What a trajectory's speeds are measured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// The vehicle holds its speed through the water: a current carries it.
    Water,
    /// The trajectory is given over ground: a current changes nothing of it.
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
