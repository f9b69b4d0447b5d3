//! Recent corrections of the estimate by the cable counter, and the error that these corrections cause if the counter's
//! wheel has stuck.
//!
//! A count that does not change means either that the vehicle is stationary or that the wheel has stuck. A filter that
//! trusts the count estimates a speed of zero in both cases. So the filter also tracks the alternative: the estimate
//! without the recent corrections by the counter. Derivation: `docs/why/navigation.md`, "When cable and estimate
//! disagree".

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Time constant with which the correction sums decay while the cable count changes, s.
///
/// Recent corrections are kept for a while, because a counter fails some time before the failure is noticed.
const RECENT_S: f64 = 1.0;
/// Minimum time after which an unchanged count means a stop of the vehicle, s. Shorter pauses may come from slow
/// motion and coarse steps.
const STANDS_S: f64 = 2.0;
/// Standard deviation of the length that a stuck wheel may have lost, as a share of the summed chainage corrections.
///
/// The wheel is assumed to be stuck in one of ten cases of a stationary count, so the variance of the lost length is a
/// tenth of the squared corrections.
const STUCK_SHARE: f64 = 0.3;
/// Corrections count as chance if their sum is at most this many of its predicted standard deviations.
///
/// With a limit of 0, stops of the vehicle make positions uncertain, so 24 % of all epochs of the seeded dives are
/// `cannot_say`; with 0.5, 19 %. With a limit of 1, stuck wheels cause unreported errors in 9 of 800 dives; with 0.5,
/// in 6.
const CHANCE_SDS: f64 = 0.5;
/// Time constant with which a possibly lost length fades from the relative error between head passes, s. It is about
/// one turn of a head.
///
/// Corrections are added up only for this time after the count stops changing. Later corrections say nothing about the
/// wheel, because they come from a hovering vehicle.
const PASSES_S: f64 = 20.0;

/// Corrections by the cable counter, and the length that the counter has lost if its wheel has stuck.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct CounterCorrections {
    /// Sums of the corrections of chainage and speed in the last second, m and m/s.
    recent: [f64; 2],
    /// Sums of the corrections since shortly before the cable count stopped changing, m and m/s. The chainage sum
    /// includes the integral of the speed sum.
    sums: [f64; 2],
    /// Standard deviations of the sums of corrections, as predicted by the filter's covariance, m and m/s.
    by_chance: [f64; 2],
    /// Time for which the cable count has not changed, s.
    stood_s: f64,
    /// Standard deviations of the length that a stuck wheel may have lost, m: `uncounted_m` since the count became
    /// stationary, `lost_m` between two head passes.
    uncounted_m: f64,
    lost_m: f64,
    /// Variance of the length that the counter may have lost permanently since the last call of `take_slipped_m2`,
    /// m^2.
    slipped_m2: f64,
}

impl CounterCorrections {
    /// Records how a fused cable reading changed the estimate.
    ///
    /// `by` are the corrections of chainage and speed, m and m/s. `variances` are the reductions of their variances,
    /// m^2 and m^2/s^2.
    pub fn note(&mut self, by: [f64; 2], variances: [f64; 2]) {
        for sums in [&mut self.recent, &mut self.sums] {
            for (sum, by) in sums.iter_mut().zip(by) {
                *sum += by;
            }
        }
        for (sd, variance) in self.by_chance.iter_mut().zip(variances) {
            *sd = math::sqrt(*sd * *sd + variance.max(0.0));
        }
    }

    /// Advances by the time since the previous reading, s; `is_same` means that the count has not changed.
    pub fn pass(&mut self, dt_s: f64, is_same: bool) {
        debug_assert!(dt_s >= 0.0, "cable readings are in order of time: {dt_s} s apart");
        self.lost_m *= math::exp(-dt_s / PASSES_S);
        self.recent = self.recent.map(|sum| sum * math::exp(-dt_s / RECENT_S));
        if is_same {
            self.stand(dt_s);
            return;
        }
        if self.stood_s >= STANDS_S {
            self.slipped_m2 += self.uncounted_m * self.uncounted_m;
        }
        (self.stood_s, self.uncounted_m) = (0.0, 0.0);
        self.fade(dt_s / RECENT_S);
    }

    fn stand(&mut self, dt_s: f64) {
        self.stood_s += dt_s;
        // A wrong correction of the speed causes an error of the distance, and this error grows with time.
        for [way_m, speed_mps] in [&mut self.sums, &mut self.by_chance] {
            *way_m += *speed_mps * dt_s;
        }
        if self.stood_s <= PASSES_S {
            let ([way_m, _], [chance_m, _]) = (self.sums, self.by_chance);
            self.uncounted_m = STUCK_SHARE * (way_m.abs() - CHANCE_SDS * chance_m).max(0.0);
        } else {
            self.fade(dt_s / PASSES_S);
        }
        self.lost_m = self.lost_m.max(self.uncounted_m);
        debug_assert!(self.uncounted_m >= 0.0, "a standard deviation isn't negative: {} m", self.uncounted_m);
    }

    fn fade(&mut self, times: f64) {
        let left = math::exp(-times);
        for sum in self.sums.iter_mut().chain(&mut self.by_chance) {
            *sum *= left;
        }
    }

    /// Returns the sums of the corrections in the last second, m and m/s, and clears all sums.
    ///
    /// Older corrections are not reverted. On a cable that is wound in half a metre at a time, most corrections after a
    /// change of the count are right. Reverting all of them caused chainage errors of 4 to 18 m instead of 1 to 3 m
    /// (scene `leak-current`).
    pub fn take_back(&mut self) -> [f64; 2] {
        core::mem::take(self).recent
    }

    /// Returns the standard deviation of the length that a stuck wheel may have lost between two head passes, m.
    pub fn lost_m(&self) -> f64 {
        debug_assert!(self.lost_m >= 0.0, "a standard deviation isn't negative: {} m", self.lost_m);
        self.lost_m
    }

    /// Returns and clears the variance of the length that the counter may have lost permanently since the last call,
    /// m^2.
    pub fn take_slipped_m2(&mut self) -> f64 {
        core::mem::take(&mut self.slipped_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the state after ten readings a second. Each reading corrects the chainage by 1 mm and the speed by
    /// `speed_mps`.
    ///
    /// The count changes for 10 s. Then it is stationary for `readings` readings.
    fn stood(readings: u32, speed_mps: f64, variances: [f64; 2]) -> CounterCorrections {
        let mut corrections = CounterCorrections::default();
        for k in 0..100 + readings {
            corrections.pass(0.1, k >= 100);
            corrections.note([0.001, speed_mps], variances);
        }
        corrections
    }

    /// Effective number of corrections in a sum that decays over a second: 1 / (e^0.1 - 1), plus the last correction.
    fn lately() -> f64 {
        1.0 / (math::exp(0.1) - 1.0) + 1.0
    }

    #[test]
    fn cable_disagreement_while_the_cable_moves_reverts_the_last_second_of_corrections() {
        let mut corrections = stood(0, -0.002, [0.0; 2]);
        assert!(corrections.lost_m() == 0.0 && corrections.take_slipped_m2() == 0.0);
        let [way_m, speed_mps] = corrections.take_back();
        assert!((way_m - 0.001 * lately()).abs() < 1e-6 && (speed_mps + 2.0 * way_m).abs() < 1e-6, "{way_m}");
        assert_eq!(corrections, CounterCorrections::default());
    }

    /// Even after a long stop, only the corrections of the last second are reverted.
    #[test]
    fn cable_disagreement_after_a_long_stop_reverts_only_the_last_second_of_corrections() {
        let [way_m, speed_mps] = stood(50, -0.002, [0.0; 2]).take_back();
        assert!((way_m - 0.001 * lately()).abs() < 1e-6 && (speed_mps + 2.0 * way_m).abs() < 1e-6, "{way_m}");
    }

    /// The length that a stuck wheel may have lost is the difference between the estimates with and without the
    /// counter. So a correction of the speed adds this speed times the time since then.
    #[test]
    fn speed_corrections_increase_the_length_that_a_stuck_counter_may_have_lost() {
        let speeds = (0..50).map(|k| 0.002 * (lately() + f64::from(k)));
        let expected_m = 0.001 * (lately() + 49.0) + speeds.map(|speed| 0.1 * speed).sum::<f64>();
        let lost_m = stood(50, 0.002, [0.0; 2]).lost_m();
        assert!((lost_m - 0.3 * expected_m).abs() < 1e-4, "{lost_m} {expected_m}");
    }

    #[test]
    fn sd_of_the_length_lost_by_a_stuck_wheel_is_0_3_of_the_corrections_beyond_chance() {
        let sure = stood(50, 0.0, [0.0; 2]);
        assert!((sure.lost_m() - 0.3e-3 * (lately() + 49.0)).abs() < 1e-6, "{}", sure.lost_m());
        // The predicted standard deviation makes half of the corrections count as chance.
        let chance_m = 0.001 * (lately() + 49.0);
        let variance = chance_m * chance_m / 54.0;
        let half = stood(50, 0.0, [variance, 0.0]);
        assert!((0.4..0.6).contains(&(half.lost_m() / sure.lost_m())), "{} {}", half.lost_m(), sure.lost_m());
        assert!(
            stood(50, 0.0, [variance, 1.0]).lost_m() < 1e-9,
            "a filter that is unsure of the speed needs the counter"
        );
    }

    /// After the first 20 s of the stop, corrections have the opposite sign, as for a hovering vehicle.
    #[test]
    fn corrections_after_20_s_of_a_stop_do_not_increase_the_possibly_lost_length() {
        let mut corrections = stood(190, 0.0, [0.0; 2]);
        let first_m = corrections.lost_m();
        assert!((first_m - 0.3e-3 * (lately() + 189.0)).abs() < 1e-4, "{first_m}");
        for _ in 0..2000 {
            corrections.pass(0.1, true);
            corrections.note([-0.001, 0.0], [0.0; 2]);
        }
        assert!((corrections.lost_m() - first_m).abs() < 0.004, "{}", corrections.lost_m());
    }

    /// The length that a stuck wheel may have lost adds to the relative error between passes for one head turn, and
    /// permanently to the position error. Short stops do not count, because a slow vehicle with coarse counter steps
    /// makes many of them.
    #[test]
    fn position_error_keeps_the_length_that_a_stuck_wheel_lost_in_a_long_stop() {
        for (readings, slips) in [(15, false), (50, true)] {
            let mut corrections = stood(readings, 0.0, [0.0; 2]);
            let before_m = corrections.lost_m();
            corrections.pass(0.1, false);
            let slipped_m2 = corrections.take_slipped_m2();
            assert_eq!(slipped_m2 > 0.99 * before_m * before_m, slips, "{readings}: {slipped_m2}");
            assert!(corrections.take_slipped_m2() == 0.0, "the variance is taken only once");
            (0..200).for_each(|_| corrections.pass(0.1, false));
            assert!((corrections.lost_m() / before_m - math::exp(-20.1 / 20.0)).abs() < 1e-6);
        }
    }
}
