//! Sums by which a head is found whose axis leans: it is yawed or pitched on its mount.
//!
//! A beam that leans along the tunnel is longer whichever way it leans, by about the square of the lean. A head's own lean shows
//! therefore as a share of the vehicle's: where that turns to one side its ranges are too long, and too short where it turns to the
//! other. What they are too long all the time may as well be the wall's shape, and is left out. Derivation: `docs/why/navigation.md`,
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

    /// The tilt where it is certainly beyond this, radians, and its standard deviations from zero: by the scatter of the blocks, and no
    /// fewer than the noise of ranges leaves, of whose declared variance the head shows `level`. `None` where declared noise
    /// would show no such tilt, and where there is more than a tilt.
    pub(super) fn certain(&self, least_rad: f64, level: f64) -> Option<(f64, f64)> {
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
        let sure_sd = tilt_rad.abs() / sd_rad.max(math::sqrt(level / weight));
        ((least_rad..MOST_RAD).contains(&tilt_rad.abs()) && sure_sd >= SURE).then_some((tilt_rad, sure_sd))
    }

    /// Sum of normalised squares that it explains.
    pub(super) fn explains(&self) -> f64 {
        self.estimate().map_or(0.0, |(tilt_rad, weight)| tilt_rad * tilt_rad * weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOISE_M: f64 = 0.01;

    /// Readings of a head that leans by `tilt_rad` on a wall that is off by `steady` of the pattern: pattern, derivative, residual, by block.
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
            let mut line = TiltLine::default();
            for [pattern, by_tilt, residual_m] in block {
                line.add([0.0; POSE], *by_tilt, *pattern, *residual_m, 1.0 / (NOISE_M * NOISE_M));
            }
            fit.add(line.freed([0.0; POSE], &unit));
        }
        fit
    }

    /// Against least squares by the readings themselves, for two unknowns by Cramer's rule.
    #[test]
    fn a_tilt_is_that_of_least_squares_and_as_sure_as_its_blocks_scatter() {
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
            // What a tilt explains is what squares are left without it, less those with it.
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
            let (told_rad, sure_sd) = fit.certain(0.01, 1.0).unwrap();
            assert!((told_rad - found_rad).abs() < 1e-9 && (told_rad - tilt_rad).abs() < 0.01);
            assert!(
                (sure_sd / (found_rad.abs() / sd_rad) - 1.0).abs() < 1e-6,
                "{sure_sd} {found_rad} {sd_rad}"
            );
        }
        assert_eq!(fit(&blocks(0.005, 0.02)).certain(0.01, 1.0), None, "less than is asked for");
        // Ranges that scatter less than declared are as sure as they scatter, and by their noise at most.
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
