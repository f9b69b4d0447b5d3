//! Sums of residuals that show whether a setting is wrong: the value of a parameter, or the mount of a sensor.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Maximum number of range sources whose settings are checked.
pub(super) const FOLLOWED: usize = 12;
/// Number of readings per comparison with alternative mounts. The other readings are skipped, because a comparison
/// costs a ray cast.
pub(super) const COMPARED: u32 = 4;
/// Minimum number of blocks from which a parameter's uncertainty is computed. A block covers at least 3 m of tunnel.
pub(super) const FEWEST_BLOCKS: u32 = 8;
/// A fitted parameter is certainly not zero if its distance from zero is at least this many standard deviations.
///
/// The limit for an alternative mount, `SURE_GAIN`, is lower, because the gain by another mount varies with the
/// vehicle's position.
pub(super) const SURE: f64 = 6.0;
pub(super) const SURE_GAIN: f64 = 3.0;
/// Minimum sum of normalised squared residuals that a parameter must explain, per reading of all sources.
///
/// A parameter explains this much if it changes ranges by a seventh of their noise.
const EXPLAINS: f64 = 0.02;
/// Unknowns of the vehicle's pose within a pose window of a few seconds: position across and up, roll, pitch and yaw.
pub(super) const POSE: usize = 5;
/// Limit at which residuals are clipped when mounts are compared, m. Some echoes come from objects other than the wall.
const MOST_MISSED_M: f64 = 0.5;
/// Limits for doubting a mount. Its mean square residual is at least `MISSES_M2`, m^2, and an alternative mount leaves
/// at most the share `LEAVES` of its squared residuals.
const MISSES_M2: f64 = 0.01;
const LEAVES: f64 = 0.4;

/// Least-squares sums of one parameter within a pose window, including its cross sums with the pose.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Line {
    pub(super) by_pose: [f64; POSE],
    pub(super) squares: f64,
    pub(super) residuals: f64,
}

/// Least-squares sums of one parameter over blocks of distance, with the vehicle's pose eliminated.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Fit {
    pub(super) blocks: u32,
    readings: u32,
    weight: f64,
    value: f64,
    weights_2: f64,
    both: f64,
    values_2: f64,
}

/// Comparison of a sonar's residuals with its configured mount and with an alternative mount. The alternative is the
/// mount of another sonar, or the configured mount turned by half a turn.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Alternative {
    pub(super) source: u16,
    pub(super) other: u16,
    pub(super) is_echo: bool,
    /// Sums of the present block (`block`), and of all blocks before it (`all`).
    ///
    /// The values are the squared residuals at the configured mount, those at the alternative, and the number of
    /// readings.
    pub(super) block: [f64; 3],
    pub(super) all: [f64; 3],
    pub(super) blocks: u32,
    pub(super) gains: f64,
    pub(super) gains_2: f64,
}

impl Line {
    pub(super) fn add(&mut self, by_pose: [f64; POSE], by: f64, residual_m: f64, weight: f64) {
        for (sum, part) in self.by_pose.iter_mut().zip(by_pose) {
            *sum += weight * by * part;
        }
        self.squares += weight * by * by;
        self.residuals += weight * by * residual_m;
    }
}

pub(super) fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Solves a lower triangular system by forward substitution.
pub(super) fn solved(factor: &[[f64; POSE]; POSE], right: [f64; POSE]) -> [f64; POSE] {
    let mut solution = [0.0; POSE];
    for (i, (row, right)) in factor.iter().zip(right).enumerate() {
        let known = dot(row, &solution);
        if let (Some(slot), Some(diagonal)) = (solution.get_mut(i), row.get(i)) {
            *slot = (right - known) / diagonal;
        }
    }
    solution
}

impl Fit {
    /// Adds the sums of a block to the fit; `readings` is the number of readings of all sources.
    pub(super) fn add(&mut self, [weight, value]: [f64; 2], readings: u32) {
        if weight <= 0.0 {
            return;
        }
        self.blocks += 1;
        self.readings = self.readings.saturating_add(readings);
        self.weight += weight;
        self.value += value;
        self.weights_2 += weight * weight;
        self.both += weight * value;
        self.values_2 += value * value;
    }

    /// Whether there are enough blocks for an estimate of the parameter.
    pub(super) fn is_settled(&self) -> bool {
        self.blocks >= FEWEST_BLOCKS
    }

    /// Returns the estimated parameter and its standard deviation, computed from the scatter of blocks.
    pub(super) fn estimate(&self) -> Option<[f64; 2]> {
        if self.blocks < FEWEST_BLOCKS || self.weight <= 0.0 {
            return None;
        }
        let estimate = self.value / self.weight;
        let scatter = self.values_2 - 2.0 * estimate * self.both + estimate * estimate * self.weights_2;
        let n = f64::from(self.blocks);
        Some([estimate, math::sqrt((scatter * n / (n - 1.0)).max(0.0)) / self.weight])
    }

    /// Returns the estimated parameter and its distance from zero in sd. `None` if its size is below `least` or if it
    /// may be zero.
    ///
    /// The sd is the larger of two: one from the scatter of blocks, and one from the noise of ranges, because blocks
    /// may hardly scatter. `None` also if the parameter changes ranges only by millimetres, because errors of the wall
    /// and beam models do the same.
    pub(super) fn certain(&self, least: f64) -> Option<(f64, f64)> {
        let [estimate, scatter] = self.estimate()?;
        let sure_sd = estimate.abs() / scatter.max(1.0 / math::sqrt(self.weight));
        let shows = self.explains() >= EXPLAINS * f64::from(self.readings);
        (estimate.abs() >= least && sure_sd >= SURE && shows).then_some((estimate, sure_sd))
    }

    /// Returns the sum of normalised squares that the parameter explains.
    pub(super) fn explains(&self) -> f64 {
        self.value * self.value / self.weight.max(f64::MIN_POSITIVE)
    }
}

impl Alternative {
    /// Adds a reading, given by its residuals at the configured mount and at the alternative mount, m.
    pub(super) fn note(&mut self, missed_m: [f64; 2]) {
        let [own, theirs] = missed_m.map(|missed_m| missed_m.abs().min(MOST_MISSED_M));
        for (sum, part) in self.block.iter_mut().zip([own * own, theirs * theirs, 1.0]) {
            *sum += part;
        }
    }

    pub(super) fn close(&mut self) {
        let [own, theirs, readings] = self.block;
        if readings <= 0.0 {
            return;
        }
        for (sum, part) in self.all.iter_mut().zip(self.block) {
            *sum += part;
        }
        let gain = (own - theirs) / readings;
        self.blocks += 1;
        self.gains += gain;
        self.gains_2 += gain * gain;
    }

    /// Returns the ratio of the squared residuals at the alternative mount to those at the configured mount.
    pub(super) fn share_left(&self) -> f64 {
        let [own, theirs, _] = self.all;
        theirs / own.max(f64::MIN_POSITIVE)
    }

    /// Returns by how many standard deviations the alternative mount fits better than the configured one.
    ///
    /// `None` unless the alternative certainly fits better and `share_left` is small. If two sources may be swapped,
    /// the caller gives the ratio for both together.
    pub(super) fn certain(&self, share_left: f64) -> Option<f64> {
        let [own, _, readings] = self.all;
        let n = f64::from(self.blocks);
        if self.blocks < FEWEST_BLOCKS || own < MISSES_M2 * readings || share_left > LEAVES {
            return None;
        }
        let mean = self.gains / n;
        let sd = math::sqrt(((self.gains_2 / n - mean * mean) / (n - 1.0)).max(0.0));
        let sure_sd = mean / sd.max(f64::MIN_POSITIVE);
        (sure_sd >= SURE_GAIN).then_some(sure_sd)
    }

    /// Returns the sum of normalised squares that the alternative mount explains, for a range noise of 3 cm.
    pub(super) fn explains(&self) -> f64 {
        let [own, theirs, _] = self.all;
        (own - theirs) * f64::from(COMPARED) / (0.03 * 0.03)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a fit to identical blocks without noise. The parameter changes ranges by `changes_sd` standard
    /// deviations.
    fn alike(changes_sd: f64, by: f64) -> Fit {
        let mut fit = Fit::default();
        let weight = 100.0 * (changes_sd / by) * (changes_sd / by);
        (0..20).for_each(|_| fit.add([weight, by * weight], 100));
        fit
    }

    /// The gain by an alternative mount varies between blocks. The alternative is only as certain as the mean gain.
    #[test]
    fn alternative_mount_is_less_certain_if_its_gain_scatters_between_blocks() {
        let sure_sd = |scatter_m2: f64| {
            let mut alternative = Alternative::default();
            for k in 0..8 {
                let theirs_m2 = 0.05 + if k % 2 == 0 { scatter_m2 } else { -scatter_m2 };
                alternative.note([0.5, math::sqrt(theirs_m2)]);
                alternative.close();
                alternative.block = [0.0; 3];
            }
            alternative.certain(alternative.share_left())
        };
        // The mean gain is 0.2 m^2. Eight gains lie alternately above and below it by the scatter, so the sd of the
        // mean is the scatter divided by the root of seven.
        for scatter_m2 in [0.05, 0.04, 0.02] {
            let expected = 0.2 / scatter_m2 * math::sqrt(7.0);
            let found = sure_sd(scatter_m2).unwrap();
            assert!((found / expected - 1.0).abs() < 1e-6, "{found}, not {expected}");
        }
    }

    #[test]
    fn setting_that_hardly_changes_the_ranges_is_never_certain() {
        assert!(alike(1.0, 0.05).certain(0.03).is_some());
        assert!(alike(0.2, 0.2).certain(0.03).is_some(), "ranges change by 6 mm, noise 3 cm");
        assert_eq!(alike(0.1, 0.2).certain(0.03), None, "ranges change by 3 mm");
        assert_eq!(alike(0.001, 1e9).certain(0.03), None, "a rotated head in a round pipe");
        assert_eq!(alike(1.0, 0.02).certain(0.03), None, "below the reporting limit");
    }
}
