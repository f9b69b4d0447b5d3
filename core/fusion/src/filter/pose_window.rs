//! Least-squares sums over a pose window of a few seconds, for the vehicle's pose and all fitted settings.
//!
//! Only the part of the residuals that the pose does not explain counts for the settings.

use serde::{Deserialize, Serialize};

use super::evidence::{FOLLOWED, Line, POSE, dot, solved};
use super::head_tilt::TiltSums;
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;

/// Prior standard deviations of the vehicle's pose error within a pose window, m and radians.
const POSE_SD: [f64; POSE] = [0.3, 0.3, 0.005, 0.01, 0.02];

/// Least-squares sums over the readings of a pose window.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct PoseWindow {
    pub(super) begun: Option<MonoNs>,
    /// Information matrix of the pose, and the right-hand side of its normal equations.
    pub(super) pose: [[f64; POSE]; POSE],
    pub(super) residuals: [f64; POSE],
    pub(super) scale: Line,
    pub(super) turned: [Line; FOLLOWED],
    /// Sums for fitting the pitch and yaw of each head on its mount.
    pub(super) tilted: [[TiltSums; 2]; FOLLOWED],
}

impl PoseWindow {
    /// Adds the information that a reading gives on the vehicle's pose.
    pub(super) fn add(&mut self, by_pose: [f64; POSE], residual_m: f64, weight: f64) {
        for ((by, line), sum) in by_pose.iter().zip(&mut self.pose).zip(&mut self.residuals) {
            for (part, other) in line.iter_mut().zip(&by_pose) {
                *part += weight * by * other;
            }
            *sum += weight * by * residual_m;
        }
    }

    /// Returns the lower Cholesky factor of the pose's information matrix, priors included.
    pub(super) fn factor(&self) -> Option<[[f64; POSE]; POSE]> {
        let mut factor = [[0.0; POSE]; POSE];
        for (i, (line, sd)) in self.pose.iter().zip(POSE_SD).enumerate() {
            let mut row = [0.0; POSE];
            for (j, sum) in line.iter().enumerate().take(i + 1) {
                let before = factor.get(j).map_or(0.0, |above| dot(&row, above));
                let left = sum - if i == j { dot(&row, &row) - 1.0 / (sd * sd) } else { before };
                let slot = row.get_mut(j)?;
                *slot = if i == j { math::sqrt(left.max(0.0)) } else { left / *factor.get(j)?.get(j)? };
            }
            *factor.get_mut(i)? = row;
        }
        let is_sound = factor.iter().flatten().all(|x| x.is_finite());
        (is_sound && factor.iter().enumerate().all(|(i, row)| row.get(i).is_some_and(|x| *x > 0.0)))
            .then_some(factor)
    }

    /// Returns the weight and the weighted value of a fitted parameter, after elimination of the vehicle's pose.
    pub(super) fn freed(&self, line: &Line, factor: &[[f64; POSE]; POSE]) -> [f64; 2] {
        let (by, residuals) = (solved(factor, line.by_pose), solved(factor, self.residuals));
        [line.squares - dot(&by, &by), line.residuals - dot(&by, &residuals)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A parameter is fitted to three readings with residuals of 1, 2 and 3 m.
    ///
    /// `alone`: the pose does not change the ranges. `like_it`: pose and parameter change the ranges in the same way.
    #[test]
    fn residuals_explained_by_a_pose_error_are_removed() {
        let line = |by_pose: [f64; POSE]| Line { squares: 3.0, residuals: 6.0, by_pose };
        let spell = |weight: f64| {
            let mut spell = PoseWindow::default();
            for residual_m in [1.0, 2.0, 3.0] {
                spell.add([1.0, 0.0, 0.0, 0.0, 0.0], residual_m, weight);
            }
            spell
        };
        let freed = |spell: &PoseWindow, line: &Line| spell.freed(line, &spell.factor().unwrap());
        let alone = freed(&spell(1.0), &line([0.0; POSE]));
        assert!((alone[0] - 3.0).abs() < 1e-12 && (alone[1] - 6.0).abs() < 1e-12, "{alone:?}");
        // The three readings give an information of 3 / m^2 on the pose, and the prior of 0.3 m gives 11.1 / m^2. So
        // the pose explains the share 3 / 14.1 of the residuals' sums, and the parameter explains the rest.
        let like_it = freed(&spell(1.0), &line([3.0, 0.0, 0.0, 0.0, 0.0]));
        let left = 1.0 - 3.0 / (3.0 + 1.0 / 0.09);
        assert!(
            (like_it[0] - 3.0 * left).abs() < 1e-9 && (like_it[1] - 6.0 * left).abs() < 1e-9,
            "{like_it:?}"
        );
    }
}
