//! Relative error covariance between two epochs.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;

/// Relative covariance of the errors that move a sample along the tunnel: chainage, pitch and yaw.
///
/// The relative error is the difference between the errors at two times.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Relative([[f64; 3]; 3]);

impl Relative {
    /// Creates the relative covariance from a matrix in the order chainage, m, pitch and yaw, radians.
    pub fn new(covariance: [[f64; 3]; 3]) -> Self {
        Self(covariance)
    }

    /// Creates the relative covariance of a pure chainage error with this standard deviation, m.
    pub fn along(sd_m: f64) -> Self {
        Self([[sd_m * sd_m, 0.0, 0.0], [0.0; 3], [0.0; 3]])
    }

    /// Standard deviation of the relative chainage error of a point at `arm` from the vehicle, m.
    pub fn sd_m(&self, arm: Vec3<Tunnel>) -> f64 {
        let weights = [1.0, arm.z(), -arm.y()];
        let rows = self.0.iter().zip(weights);
        let sum: f64 =
            rows.map(|(row, w)| w * row.iter().zip(weights).map(|(c, w)| c * w).sum::<f64>()).sum();
        math::sqrt(sum.max(0.0))
    }

    /// Standard deviation of the relative pitch and yaw errors together, radians.
    ///
    /// For each metre by which the arm to the point becomes longer, [`Relative::sd_m`] changes by at most this many
    /// metres.
    pub fn turn_sd_rad(&self) -> f64 {
        let [_, [_, pitch, _], [.., yaw]] = self.0;
        math::sqrt((pitch + yaw).max(0.0))
    }

    /// Returns the relative covariance for another reference point on the vehicle. `arm` leads to it from the present
    /// reference point.
    #[must_use]
    pub fn moved(&self, arm: Vec3<Tunnel>) -> Self {
        let sheared = |[x, pitch, yaw]: [f64; 3]| [x + arm.z() * pitch - arm.y() * yaw, pitch, yaw];
        // The shear is applied to the rows and then to the columns, so the matrix stays symmetric.
        let once = self.0.map(sheared);
        let columns = [0, 1, 2].map(|c| sheared(once.map(|row| row.get(c).copied().unwrap_or(0.0))));
        Self(columns)
    }

    /// Returns the weighted sum of two relative covariances.
    #[must_use]
    pub fn weighted(&self, share: f64, other: &Self, other_share: f64) -> Self {
        let mut sum = [[0.0; 3]; 3];
        for ((sum, a), b) in
            sum.as_flattened_mut().iter_mut().zip(self.0.as_flattened()).zip(other.0.as_flattened())
        {
            *sum = a * share + b * other_share;
        }
        Self(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reference_point_does_not_change_the_sd_of_a_sample() {
        let relative = Relative::new([[0.04, 0.003, -0.002], [0.003, 0.01, 0.001], [-0.002, 0.001, 0.02]]);
        let (whole, part) = (Vec3::new(0.3, 2.0, -1.5), Vec3::new(-0.1, 0.4, 0.7));
        let moved = relative.moved(part).sd_m(whole + -part);
        assert!((moved - relative.sd_m(whole)).abs() < 1e-12, "{moved}");
    }

    #[test]
    fn sd_grows_by_at_most_the_rotation_sd_per_metre_of_lever_arm() {
        let relative = Relative::new([[0.04, 0.003, -0.002], [0.003, 0.01, 0.001], [-0.002, 0.001, 0.02]]);
        let arm = |k: u32| Vec3::new(0.0, math::sin(f64::from(k)), math::cos(f64::from(k)));
        let adds_m = |k: u32| relative.sd_m(arm(k).scaled(51.0)) - relative.sd_m(arm(k).scaled(50.0));
        let most_m = (0..200).map(adds_m).fold(0.0, f64::max);
        assert!(most_m <= relative.turn_sd_rad() && most_m > 0.7 * relative.turn_sd_rad(), "{most_m}");
    }
}
