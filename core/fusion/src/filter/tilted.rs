//! Sums by which a head is found whose axis leans: it is yawed or pitched on its mount.
//!
//! A beam that leans along the tunnel is longer whichever way it leans, by about the square of the lean. A head's own lean shows
//! therefore as a share of the vehicle's: where that turns to one side its ranges are too long, and too short where it turns to the
//! other. What they are too long all the time may as well be the wall's shape, and is left out. Derivation: `docs/fusion.md`,
//! "Settings in doubt".

use serde::{Deserialize, Serialize};

use super::evidence::{FEWEST_BLOCKS, POSE, SURE, dot, solved};
use headrace_geometry::math;

/// Share of the weight that is left where what is there all the time is left out: the vehicle has turned to and fro.
const LEAST_LEFT: f64 = 0.05;

/// Standard deviations by the noise of ranges that the least tilt told must be.
const SHOWS: f64 = 3.0;
/// Beyond this no small change describes it, radians.
const MOST_RAD: f64 = 0.3;

/// Places of the sums: of the pattern's square, of pattern and derivative, of the derivative's square, of each with residuals.
const SUMS: usize = 5;

/// Sums of a head and an axis within a spell, beside those of the vehicle's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct TiltLine {
    pattern_by_pose: [f64; POSE],
    tilt_by_pose: [f64; POSE],
    sums: [f64; SUMS],
}

/// The same over blocks, freed of the vehicle's pose, and their second moments.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct TiltFit {
    blocks: u32,
    sums: [f64; SUMS],
    squares: [[f64; SUMS]; SUMS],
}

impl TiltLine {
    /// Adds a reading: its derivatives by pose, and by the tilt and by half of the tilt's square at no lean.
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

    /// The sums freed of the vehicle's pose, of which `residuals` are the residuals' sums and `factor` the information's factor.
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
    /// Adds the sums of a block.
    pub(super) fn add(&mut self, block: [f64; SUMS]) {
        if block[0] <= 0.0 {
            return;
        }
        self.blocks += 1;
        for (sum, part) in self.sums.iter_mut().zip(block) {
            *sum += part;
        }
        for (line, a) in self.squares.iter_mut().zip(block) {
            for (sum, b) in line.iter_mut().zip(block) {
                *sum += a * b;
            }
        }
    }

    /// The tilt, radians, and its weight, freed of what is there all the time; `None` where the vehicle hasn't turned enough.
    fn estimate(&self) -> Option<(f64, f64)> {
        let [pattern_2, both, tilt_2, pattern_off, tilt_off] = self.sums;
        if self.blocks < FEWEST_BLOCKS || pattern_2 <= 0.0 {
            return None;
        }
        let share = both / pattern_2;
        let weight = tilt_2 - share * both;
        (weight > LEAST_LEFT * tilt_2).then(|| ((tilt_off - share * pattern_off) / weight, weight))
    }

    /// The tilt where it is certainly beyond this, radians, and its standard deviations from zero by the scatter of the blocks; `None`
    /// where ranges would be too noisy to show so little, and where there is more than a tilt.
    pub(super) fn certain(&self, least_rad: f64) -> Option<(f64, f64)> {
        let (tilt_rad, weight) = self.estimate()?;
        if weight * least_rad * least_rad < SHOWS * SHOWS {
            return None;
        }
        let [pattern_2, both, _, pattern_off, _] = self.sums;
        let share = both / pattern_2;
        let steady = (pattern_off - tilt_rad * both) / pattern_2;
        // What a block's sums leave, linear in them.
        let left = [share * steady, share * tilt_rad - steady, -tilt_rad, -share, 1.0];
        let scatter = self.squares.iter().zip(left).map(|(line, a)| a * dot(line, &left)).sum::<f64>();
        let n = f64::from(self.blocks);
        let sd_rad = math::sqrt((scatter * n / (n - 2.0)).max(0.0)) / weight;
        let sure_sd = tilt_rad.abs() / sd_rad.max(1.0 / math::sqrt(weight));
        ((least_rad..MOST_RAD).contains(&tilt_rad.abs()) && sure_sd >= SURE).then_some((tilt_rad, sure_sd))
    }

    /// Sum of normalised squares that it explains.
    pub(super) fn explains(&self) -> f64 {
        self.estimate().map_or(0.0, |(tilt_rad, weight)| tilt_rad * tilt_rad * weight)
    }
}
