//! Largest speed that a strip of wall allows, from its time between passes and its largest distance between samples of
//! a turn.

use crate::spacing;
use headrace_geometry::math;

/// Motion of the vehicle and its beams, for the prediction of sample spacing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Going {
    /// Longest time between two pings of any head, seconds.
    pub ping_period_s: f64,
    /// Largest speed of the beams along the wall due to swing, in addition to the vehicle's speed, m/s.
    pub swing_mps: f64,
    /// Displacement of passes along the tunnel from their scheduled places, m. It does not depend on the speed.
    pub shift_m: f64,
    /// Distance between the heads along the hull, m. The vehicle also swings while it covers this distance.
    pub apart_m: f64,
    /// Mean speed of the beams along the wall due to swing, m/s, while the vehicle covers `apart_m`.
    pub apart_swing_mps: f64,
    /// Largest displacement of the beams due to swing over any time, m; `None` if unknown.
    pub swing_most_m: Option<f64>,
}

/// Inputs of the spacing T on a strip: the time between passes, and the distance between samples around the wall.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limit {
    pub(super) gap_s: f64,
    pub(super) t_y_m: f64,
    /// Unevenness of the passes on the two sides of a strip that lies between two sectors; `None` for any other strip.
    ///
    /// The strip's width is `t_y_m`. See [`crate::passes::Passes::uneven_ends`].
    pub(super) uneven: Option<f64>,
}

impl Limit {
    /// Whether the spacing T at a speed is at most a target, m.
    pub(super) fn meets(&self, target_m: f64, speed_mps: f64, going: &Going) -> bool {
        /// Squares that differ by more than this share decide like T itself, which takes longer to compute.
        const ROUNDING: f64 = 1e-9;
        let [t_x_m, advance_m] = self.along_m(speed_mps, going);
        let (along_m, target_m2) = (t_x_m + advance_m, target_m * target_m);
        let t_m2 = along_m * along_m + self.t_y_m * self.t_y_m;
        if t_m2 < target_m2 * (1.0 - ROUNDING) {
            return true;
        }
        let misses = self.uneven.is_none() && t_m2 > target_m2 * (1.0 + ROUNDING);
        !misses && self.t_m(speed_mps, going) <= target_m
    }

    pub(super) fn t_m(&self, speed_mps: f64, going: &Going) -> f64 {
        let [t_x_m, advance_m] = self.along_m(speed_mps, going);
        let t_m = spacing::t_max_m(t_x_m, advance_m, self.t_y_m);
        let Some(uneven) = self.uneven else { return t_m };
        // The row of samples on one side of the strip may be shifted relative to the row on the other side.
        t_m.min(staggered_m(t_x_m - going.shift_m + advance_m, self.t_y_m, uneven, going.shift_m))
    }

    /// Distance between passes at a speed, and the distance travelled between two pings, m.
    fn along_m(&self, speed_mps: f64, going: &Going) -> [f64; 2] {
        let over_ground_mps = speed_mps + going.swing_mps;
        let lag_m2ps = going.apart_swing_mps * going.apart_m;
        let lag_m = if lag_m2ps > 0.0 { lag_m2ps / speed_mps } else { 0.0 };
        let swung_m = over_ground_mps * self.gap_s + going.shift_m + lag_m;
        let at_most_m = going.swing_most_m.map(|most_m| speed_mps * self.gap_s + going.shift_m + most_m);
        let t_x_m = at_most_m.map_or(swung_m, |at_most_m| swung_m.min(at_most_m));
        [t_x_m, over_ground_mps * going.ping_period_s]
    }

    /// Returns the largest speed that solves T = hypot((v + w) t + shift + u a / v, T_y).
    ///
    /// In this equation, t is the sum of the pass gap and the ping period. w is `swing_mps`, u is `apart_swing_mps`,
    /// and a is `apart_m`.
    ///
    /// The result is higher than this solution in two cases: the largest displacement by swing is known, or a circle
    /// between two rows of turning points limits the hole.
    pub(super) fn speed_mps(&self, target_m: f64, going: &Going) -> Option<f64> {
        let along_m = spacing::along_m(target_m, self.t_y_m)?;
        let staggered_m =
            |uneven| along_staggered_m(target_m, self.t_y_m, uneven, going.shift_m) + going.shift_m;
        let along_m = self.uneven.map_or(along_m, |uneven| along_m.max(staggered_m(uneven)));
        let bounded = going.swing_most_m.and_then(|most_m| self.bounded_mps(along_m, most_m, going));
        self.swung_mps(along_m, going).into_iter().chain(bounded).max_by(f64::total_cmp)
    }

    fn bounded_mps(&self, along_m: f64, most_m: f64, going: &Going) -> Option<f64> {
        let time_s = self.gap_s + going.ping_period_s;
        let for_speed_m = along_m - going.shift_m - most_m - going.swing_mps * going.ping_period_s;
        (time_s > 0.0 && for_speed_m > 0.0).then(|| for_speed_m / time_s)
    }

    fn swung_mps(&self, along_m: f64, going: &Going) -> Option<f64> {
        let time_s = self.gap_s + going.ping_period_s;
        let for_speed_m = along_m - going.shift_m - going.swing_mps * time_s;
        let rest = for_speed_m * for_speed_m - 4.0 * time_s * going.apart_swing_mps * going.apart_m;
        let possible = time_s > 0.0 && for_speed_m > 0.0 && rest >= 0.0;
        possible.then(|| (for_speed_m + math::sqrt(rest)) / (2.0 * time_s))
    }
}

/// Diameter of the largest circle between two rows of samples, m.
///
/// Samples in a row are `along_m` apart, and the rows are `across_m` apart. One row is shifted along the tunnel by the
/// sum of half of `along_m`, the share `uneven` of `along_m`, and `moved_m` in either direction. A shift by all of
/// `along_m` is the worst case: both rows then have samples at the same chainages.
///
/// The circle passes through two neighbouring samples of one row and through the sample of the other row that is
/// between these two, a and b away from them along the tunnel: 2 R = sqrt((a^2 + c^2) (b^2 + c^2)) / c, with c =
/// `across_m`. If c^2 < a b, the circle's centre is not between the rows. In this case, the largest circle is centred
/// on one row, between two samples of this row.
fn staggered_m(along_m: f64, across_m: f64, uneven: f64, moved_m: f64) -> f64 {
    let off_m = (uneven * along_m + moved_m).min(along_m / 2.0);
    let square = |x_m: f64| x_m * x_m;
    let (a2, b2) = (square(along_m / 2.0 - off_m), square(along_m / 2.0 + off_m));
    let across2 = across_m * across_m;
    if across2 * across2 < a2 * b2 || across_m <= 0.0 {
        return along_m;
    }
    math::sqrt((a2 + across2) * (b2 + across2)) / across_m
}

/// Returns the `along_m` for which [`staggered_m`] equals the target, but at most the target, m.
fn along_staggered_m(target_m: f64, across_m: f64, uneven: f64, moved_m: f64) -> f64 {
    let (mut meets_m, mut misses_m) = (0.0, target_m);
    if staggered_m(misses_m, across_m, uneven, moved_m) <= target_m {
        return target_m;
    }
    for _ in 0..60 {
        let middle_m = f64::midpoint(meets_m, misses_m);
        if staggered_m(middle_m, across_m, uneven, moved_m) <= target_m {
            meets_m = middle_m;
        } else {
            misses_m = middle_m;
        }
    }
    meets_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_circle_between_staggered_rows_equals_brute_force() {
        for (along_m, across_m) in [(0.5, 0.3), (0.4, 0.4), (0.3, 0.35), (0.5, 0.22), (0.6, 0.1)] {
            for uneven in [0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5] {
                let samples: Vec<[f64; 2]> = (-4..=4)
                    .flat_map(|k| [[f64::from(k), 0.0], [f64::from(k) + 0.5 + uneven, across_m]])
                    .map(|[x, y]| [x * along_m, y])
                    .collect();
                let clear = |x: f64, y: f64| {
                    let away = |sample: &[f64; 2]| math::hypot(sample[0] - x, sample[1] - y);
                    samples.iter().map(away).fold(f64::INFINITY, f64::min)
                };
                let grid = (0..400).flat_map(|i| (0..=200).map(move |k| (f64::from(i), f64::from(k))));
                let places = grid.map(|(i, k)| clear(i / 400.0 * along_m, k / 200.0 * across_m));
                let widest_m = 2.0 * places.fold(0.0, f64::max);
                let formula_m = staggered_m(along_m, across_m, uneven, 0.0);
                let what = format!("{along_m} {across_m} {uneven}: {widest_m} {formula_m}");
                assert!(widest_m <= formula_m + 1e-9, "{what}");
                // If the circle's centre is not between the rows, `formula_m` is only an upper bound. The circle is then
                // centred on one row, and the samples of the other row limit it as well.
                let is_between = across_m * across_m >= along_m * along_m * (0.25 - uneven * uneven);
                assert!(!is_between || widest_m > formula_m - 0.005, "{what}");
                assert!((staggered_m(along_m, across_m, 0.0, uneven * along_m) - formula_m).abs() < 1e-12);
                let back_m = along_staggered_m(formula_m, across_m, uneven, 0.0);
                assert!((back_m - along_m).abs() < 1e-9, "{what}: {back_m}");
            }
        }
        // If the samples of both rows are at the same chainages, they form rectangles of 0.4 m by 0.3 m.
        assert!((staggered_m(0.4, 0.3, 0.5, 0.0) - 0.5).abs() < 1e-12);
        assert!((staggered_m(0.4, 0.3, 0.3, 1.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn largest_hole_at_the_limit_speed_equals_the_target_with_swing_and_shift() {
        let bounded = Some(0.3);
        for (swing_mps, shift_m, swing_most_m) in
            [(0.0, 0.0, None), (0.01, 0.0, None), (0.0, 0.03, None), (0.01, 0.03, bounded)]
        {
            let going = Going { ping_period_s: 0.02, swing_mps, shift_m, swing_most_m, ..Going::default() };
            for uneven in [None, Some(0.0), Some(0.1), Some(0.4)] {
                for target_m in [0.4, 0.5, 0.9] {
                    let limit = Limit { gap_s: 4.0, t_y_m: 0.3, uneven };
                    let Some(speed_mps) = limit.speed_mps(target_m, &going) else { continue };
                    let t_m = limit.t_m(speed_mps, &going);
                    assert!((t_m - target_m).abs() < 1e-9, "{limit:?} {going:?}: {t_m} for {target_m}");
                }
            }
        }
    }
}
