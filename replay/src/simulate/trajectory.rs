//! The vehicle's way through a straight tunnel.

use headrace_core::frames::{Point3, Pose, Rot};

/// A stretch gone at one speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// How far, m, positive.
    pub distance_m: f64,
    /// How fast, m/s; negative goes back.
    pub speed_mps: f64,
}

/// Legs one after the other, along the axis, level, at one place of the cross-section.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Chainage at the start, m.
    pub start_m: f64,
    /// Place in the cross-section: y left, z up, m.
    pub place_m: [f64; 2],
    /// The legs, at least one.
    pub legs: Vec<Leg>,
}

impl Leg {
    fn duration_s(&self) -> f64 {
        self.distance_m / self.speed_mps.abs()
    }
}

impl Trajectory {
    /// Time from the start to the end of the last leg, seconds.
    pub fn duration_s(&self) -> f64 {
        self.legs.iter().map(Leg::duration_s).sum()
    }

    /// Pose `after_s` seconds after the start; before it and after the end the vehicle goes on at that leg's speed.
    pub fn pose(&self, after_s: f64) -> Pose {
        let (mut x_m, mut left_s) = (self.start_m, after_s);
        for (index, leg) in self.legs.iter().enumerate() {
            let last = index + 1 == self.legs.len();
            if last || left_s < leg.duration_s() {
                x_m += left_s * leg.speed_mps;
                break;
            }
            x_m += leg.distance_m * leg.speed_mps.signum();
            left_s -= leg.duration_s();
        }
        let [y_m, z_m] = self.place_m;
        Pose { position: Point3::new(x_m, y_m, z_m), attitude: Rot::identity() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_follow_each_other_without_a_jump() {
        let legs = vec![
            Leg { distance_m: 10.0, speed_mps: 0.2 },
            Leg { distance_m: 3.0, speed_mps: 0.3 },
            Leg { distance_m: 1.0, speed_mps: -0.5 },
        ];
        let trajectory = Trajectory { start_m: 2.0, place_m: [0.0, 3.0], legs };
        assert!((trajectory.duration_s() - 62.0).abs() < 1e-12);
        for (after_s, x_m) in
            [(0.0, 2.0), (50.0, 12.0), (60.0, 15.0), (61.0, 14.5), (62.0, 14.0), (63.0, 13.5)]
        {
            assert!((trajectory.pose(after_s).position.x() - x_m).abs() < 1e-9, "{after_s}");
        }
    }
}
