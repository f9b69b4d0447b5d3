//! Sums that detect a tilted head: a head whose axis is yawed or pitched on its mount.
//!
//! A beam that leans along the tunnel has a longer range, by about the square of the lean. If the head itself is
//! tilted, its ranges are too long while the vehicle turns to one side, and too short while it turns to the other side.
//! So a tilt shows as an asymmetry. The wall's shape may also make ranges too long, but to the same extent on both
//! sides. This constant excess is eliminated. Derivation: `docs/why/navigation.md`, "Settings in doubt".

use serde::{Deserialize, Serialize};

use super::evidence::{FEWEST_BLOCKS, POSE, SURE, dot, solved};
use headrace_geometry::math;

/// Minimum share of a tilt's weight that remains after the constant excess of the ranges is eliminated.
///
/// A smaller share shows that the vehicle has not turned enough to both sides.
const LEAST_LEFT: f64 = 0.05;
/// Minimum lean of the beams along the tunnel in a pose window, rms, radians.
///
/// A smaller lean comes mostly from errors of the heading, so the pose window shows nothing about the tilt.
const LEAST_LEAN_RAD: f64 = 0.012;

/// A head's tilt is judged only if the smallest tilt to report is this many times the sd caused by declared range
/// noise.
const SHOWS: f64 = 3.0;
/// Largest tilt for which the linear model holds, radians.
const MOST_RAD: f64 = 0.3;

/// Number of sums. Their terms: pattern squared, pattern times derivative, derivative squared, pattern times residual,
/// derivative times residual.
const SUMS: usize = 5;

/// Tilt sums of one head about one axis within a pose window, and their cross sums with the vehicle's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct TiltSums {
    pattern_by_pose: [f64; POSE],
    tilt_by_pose: [f64; POSE],
    sums: [f64; SUMS],
}

/// Tilt sums and their second moments over pose windows, after the vehicle's pose is eliminated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct TiltFit {
    windows: u32,
    sums: [f64; SUMS],
    squares: [[f64; SUMS]; SUMS],
}

impl TiltSums {
    /// Adds a reading.
    ///
    /// `by_pose` and `by_tilt` are derivatives of the range with respect to pose and tilt. `pattern` is the derivative
    /// with respect to half of the squared tilt, at zero lean.
    pub(super) fn add(
        &mut self,
        by_pose: [f64; POSE],
        by_tilt: f64,
        pattern: f64,
        residual_m: f64,
        weight: f64,
    ) {
        for ((pattern_sum, tilt_sum), by) in
            self.pattern_by_pose.iter_mut().zip(&mut self.tilt_by_pose).zip(by_pose)
        {
            *pattern_sum += weight * pattern * by;
            *tilt_sum += weight * by_tilt * by;
        }
        let parts = [
            pattern * pattern,
            pattern * by_tilt,
            by_tilt * by_tilt,
            pattern * residual_m,
            by_tilt * residual_m,
        ];
        for (sum, part) in self.sums.iter_mut().zip(parts) {
            *sum += weight * part;
        }
    }

    /// Returns the tilt sums after the vehicle's pose is eliminated.
    ///
    /// `residuals` are the sums of each residual times its derivatives with respect to the pose. `factor` is the
    /// Cholesky factor of the information on the pose.
    pub(super) fn freed(&self, residuals: [f64; POSE], factor: &[[f64; POSE]; POSE]) -> [f64; SUMS] {
        let [pattern, tilt, residuals] =
            [self.pattern_by_pose, self.tilt_by_pose, residuals].map(|sums| solved(factor, sums));
        let by_pose = [
            dot(&pattern, &pattern),
            dot(&pattern, &tilt),
            dot(&tilt, &tilt),
            dot(&pattern, &residuals),
            dot(&tilt, &residuals),
        ];
        let mut freed = self.sums;
        for (sum, part) in freed.iter_mut().zip(by_pose) {
            *sum -= part;
        }
        freed
    }
}

impl TiltFit {
    /// Adds the tilt sums of a pose window to the fit.
    ///
    /// A tilt needs no blocks of distance, unlike other settings. Its effect changes sign as the vehicle swings, but
    /// the effect of the wall's shape does not. The vehicle must still move on between windows. Otherwise it sees the
    /// same bumps in every swing, and they do not average out.
    pub(super) fn add(&mut self, window: [f64; SUMS]) {
        let [pattern_2, _, tilt_2, ..] = window;
        if pattern_2 <= 0.0 || tilt_2 < LEAST_LEAN_RAD * LEAST_LEAN_RAD * pattern_2 {
            return;
        }
        self.windows += 1;
        for (sum, part) in self.sums.iter_mut().zip(window) {
            *sum += part;
        }
        for (line, a) in self.squares.iter_mut().zip(window) {
            for (sum, b) in line.iter_mut().zip(window) {
                *sum += a * b;
            }
        }
    }

    /// Returns the head's tilt, radians, and the tilt's weight after the constant range excess is eliminated.
    ///
    /// `None` if the vehicle has not turned enough.
    fn estimate(&self) -> Option<(f64, f64)> {
        let [pattern_2, both, tilt_2, pattern_off, tilt_off] = self.sums;
        if self.windows < FEWEST_BLOCKS || pattern_2 <= 0.0 {
            return None;
        }
        let share = both / pattern_2;
        let weight = tilt_2 - share * both;
        (weight > LEAST_LEFT * tilt_2).then(|| ((tilt_off - share * pattern_off) / weight, weight))
    }

    /// Returns the standard deviation of the head's tilt, radians; `None` if the vehicle has not turned enough.
    ///
    /// The value comes from the scatter of pose windows. It is at least the sd that range noise causes, whose variance
    /// is `level` times the declared variance.
    pub(super) fn sd_rad(&self, level: f64) -> Option<f64> {
        let (rad, weight) = self.estimate()?;
        let [pattern_2, both, _, pattern_off, _] = self.sums;
        let share = both / pattern_2;
        let steady = (pattern_off - rad * both) / pattern_2;
        // Weights of a window's sums. Weighted by them, the sums give the residual that the fit leaves in this window.
        let left = [share * steady, share * rad - steady, -rad, -share, 1.0];
        let scatter = self.squares.iter().zip(left).map(|(line, a)| a * dot(line, &left)).sum::<f64>();
        let n = f64::from(self.windows);
        let sd_rad = math::sqrt((scatter * n / (n - 2.0)).max(0.0)) / weight;
        Some(sd_rad.max(math::sqrt(level / weight)))
    }

    /// Returns the head's tilt and its distance from zero in sd, if its size is at least `least_rad` and it is
    /// certainly not zero.
    ///
    /// `None` also if declared range noise would hide a tilt of `least_rad`, or if the tilt is too large for the linear
    /// model.
    pub(super) fn certain(&self, least_rad: f64, level: f64) -> Option<(f64, f64)> {
        let (tilt_rad, weight) = self.estimate()?;
        if weight * least_rad * least_rad < SHOWS * SHOWS {
            return None;
        }
        let sure_sd = tilt_rad.abs() / self.sd_rad(level)?;
        ((least_rad..MOST_RAD).contains(&tilt_rad.abs()) && sure_sd >= SURE).then_some((tilt_rad, sure_sd))
    }

    /// Returns the sum of normalised squares that the tilt explains.
    pub(super) fn explains(&self) -> f64 {
        self.estimate().map_or(0.0, |(tilt_rad, weight)| tilt_rad * tilt_rad * weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE_M: f64 = 0.01;

    /// Returns the readings of each block: pattern, derivative, residual. The head has the tilt `tilt_rad`.
    ///
    /// The wall differs from its design by `steady` times the pattern.
    fn blocks(tilt_rad: f64, steady: f64) -> Vec<Vec<[f64; 3]>> {
        let mut seed = 5_u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let block = |number: u32| {
            let reading = |k: u32| {
                let turned = math::sin(0.7 * f64::from(number) + 0.1 * f64::from(k));
                let (pattern, by_tilt) = (2.0 + 0.5 * draw(), 1.5 * turned + 0.3 * draw());
                [pattern, by_tilt, tilt_rad * by_tilt + steady * pattern + 0.02 * draw()]
            };
            (0..30).map(reading).collect()
        };
        { 0..FEWEST_BLOCKS + 12 }.map(block).collect()
    }

    fn fit(blocks: &[Vec<[f64; 3]>]) -> TiltFit {
        let mut fit = TiltFit::default();
        let unit = core::array::from_fn(|row| core::array::from_fn(|k| f64::from(u8::from(k == row))));
        for block in blocks {
            let mut line = TiltSums::default();
            for [pattern, by_tilt, residual_m] in block {
                line.add([0.0; POSE], *by_tilt, *pattern, *residual_m, 1.0 / (NOISE_M * NOISE_M));
            }
            fit.add(line.freed([0.0; POSE], &unit));
        }
        fit
    }

    /// The oracle is a least-squares fit to the readings themselves. Cramer's rule solves it for its two unknowns.
    #[test]
    fn head_tilt_and_its_certainty_equal_a_least_squares_fit() {
        let weight = 1.0 / (NOISE_M * NOISE_M);
        let square = |x: f64| x * x;
        for (tilt_rad, steady) in [(0.05, 0.02), (-0.08, -0.1), (0.2, 0.3)] {
            let blocks = blocks(tilt_rad, steady);
            let sum = |of: &dyn Fn(&[f64; 3]) -> f64| blocks.iter().flatten().map(of).sum::<f64>() * weight;
            let [pp, pt, tt] = [sum(&|r| r[0] * r[0]), sum(&|r| r[0] * r[1]), sum(&|r| r[1] * r[1])];
            let [po, to] = [sum(&|r| r[0] * r[2]), sum(&|r| r[1] * r[2])];
            let whole = pp * tt - pt * pt;
            let (found_rad, found_steady) = ((pp * to - pt * po) / whole, (tt * po - pt * to) / whole);
            let fit = fit(&blocks);
            // The tilt explains the difference between the sums of squared residuals of two fits, one without and one
            // with a tilt.
            let left = |tilt: f64, steady: f64| sum(&|r| square(r[2] - tilt * r[1] - steady * r[0]));
            let explained = left(0.0, po / pp) - left(found_rad, found_steady);
            assert!((fit.explains() / explained - 1.0).abs() < 1e-6, "{} {explained}", fit.explains());
            let pull = |block: &Vec<[f64; 3]>| {
                let pulls = |r: &[f64; 3]| {
                    weight * (r[1] - pt / pp * r[0]) * (r[2] - found_rad * r[1] - found_steady * r[0])
                };
                square(block.iter().map(pulls).sum::<f64>())
            };
            let n = blocks.len() as f64;
            let scatter = blocks.iter().map(pull).sum::<f64>() * n / (n - 2.0);
            let sd_rad = (math::sqrt(scatter) / (whole / pp)).max(math::sqrt(pp / whole));
            let (certain_rad, sure_sd) = fit.certain(0.01, 1.0).unwrap();
            assert!((certain_rad - found_rad).abs() < 1e-9 && (certain_rad - tilt_rad).abs() < 0.01);
            assert!(
                (sure_sd / (found_rad.abs() / sd_rad) - 1.0).abs() < 1e-6,
                "{sure_sd} {found_rad} {sd_rad}"
            );
        }
        assert_eq!(
            fit(&blocks(0.005, 0.02)).certain(0.01, 1.0),
            None,
            "a tilt below the limit is not reported"
        );
        // With large range noise, this noise limits the certainty of the tilt. With less noise, the scatter of pose
        // windows does.
        let sure_sd = |level: f64| fit(&blocks(0.05, 0.0)).certain(0.01, level).unwrap().1;
        assert!(
            (sure_sd(100.0) / sure_sd(400.0) - 2.0).abs() < 1e-9,
            "{} {}",
            sure_sd(100.0),
            sure_sd(400.0)
        );
        assert!((sure_sd(0.01) / sure_sd(0.02) - 1.0).abs() < 1e-9);
    }
}
