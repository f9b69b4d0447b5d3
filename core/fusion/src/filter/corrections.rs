//! What the cable counter has lately made of the estimate, and what of that is lost if its wheel has stuck.
//!
//! A count that stands says that the vehicle stands, or that the wheel does; a filter that believes it stops the vehicle either way. So the
//! hypothesis of a stuck wheel is kept beside: the estimate without these corrections. Derivation: `docs/why/navigation.md`, "A count that stands".

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Time for which corrections by a count that changes are remembered, s: a counter goes wrong before it is noticed.
const RECENT_S: f64 = 1.0;
/// A count that stands for less than this may be that of a slow vehicle with coarse steps, s.
const STANDS_S: f64 = 2.0;
/// A wheel has stuck in one case of ten: the variance of what is lost is a tenth of the corrections squared.
const STUCK_SHARE: f64 = 0.3;
/// Standard deviations of the corrections that chance explains. With none, stops make a position unsure (can't say in 24 % of the seeded
/// dives, instead of 19); with one, wheels that stick are silent in 9 of 800 instead of 6.
const CHANCE_SDS: f64 = 0.5;
/// Time for which what is lost counts between passes, s: about a head's turn. It is that of a count's first such time, too: what a vehicle
/// that hovers for minutes is corrected by says nothing of the wheel.
const PASSES_S: f64 = 20.0;

/// See the module's description.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Corrections {
    /// Corrections of chainage and speed of the last second, m and m/s.
    recent: [f64; 2],
    /// The same with all since the count changed, the speeds carried on.
    sums: [f64; 2],
    /// Standard deviations that the covariance expects of them, m and m/s.
    by_chance: [f64; 2],
    /// For how long the count has stood, s.
    stood_s: f64,
    /// Standard deviation of what may be lost since the count stands, and between passes, m.
    lacks_m: f64,
    lost_m: f64,
    /// Variance of what may be lost for good and has not been asked for, m^2.
    slipped_m2: f64,
}

impl Corrections {
    /// Notes how a reading that was fused has corrected chainage and speed, m and m/s, and what variance that took from them, m^2 and m^2/s^2.
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

    /// Takes a reading so long after the one before, s, whose count is the same or not.
    pub fn pass(&mut self, dt_s: f64, is_same: bool) {
        self.lost_m *= math::exp(-dt_s / PASSES_S);
        self.recent = self.recent.map(|sum| sum * math::exp(-dt_s / RECENT_S));
        if is_same {
            self.stand(dt_s);
            return;
        }
        if self.stood_s >= STANDS_S {
            self.slipped_m2 += self.lacks_m * self.lacks_m;
        }
        (self.stood_s, self.lacks_m) = (0.0, 0.0);
        self.fade(dt_s / RECENT_S);
    }

    fn stand(&mut self, dt_s: f64) {
        self.stood_s += dt_s;
        // The corrected speed is missing in the way.
        for [way_m, speed_mps] in [&mut self.sums, &mut self.by_chance] {
            *way_m += *speed_mps * dt_s;
        }
        if self.stood_s <= PASSES_S {
            let ([way_m, _], [chance_m, _]) = (self.sums, self.by_chance);
            self.lacks_m = STUCK_SHARE * (way_m.abs() - CHANCE_SDS * chance_m).max(0.0);
        } else {
            self.fade(dt_s / PASSES_S);
        }
        self.lost_m = self.lost_m.max(self.lacks_m);
    }

    fn fade(&mut self, times: f64) {
        let left = math::exp(-times);
        for sum in self.sums.iter_mut().chain(&mut self.by_chance) {
            *sum *= left;
        }
    }

    /// Those of the last second, m and m/s, to be taken back: none are left. What a counter that is wound by half metres has made of the
    /// estimate since its count changed is mostly right: with all of it taken back the chainage left the truth by 4 to 18 m instead of 1 to 3
    /// (the scene `leak-current`).
    pub fn take_back(&mut self) -> [f64; 2] {
        core::mem::take(self).recent
    }

    /// Standard deviation of what counter and estimate may have lost between passes, m.
    pub fn lost_m(&self) -> f64 {
        self.lost_m
    }

    /// Variance of what may be lost for good since this was last asked, m^2.
    pub fn take_slipped_m2(&mut self) -> f64 {
        core::mem::take(&mut self.slipped_m2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corrections by a millimetre and so many m/s each reading, ten a second: of a count that changes for 10 s, and then stands.
    fn stood(readings: u32, speed_mps: f64, variances: [f64; 2]) -> Corrections {
        let mut corrections = Corrections::default();
        for k in 0..100 + readings {
            corrections.pass(0.1, k >= 100);
            corrections.note([0.001, speed_mps], variances);
        }
        corrections
    }

    /// A sum that fades over a second: 1 / (e^0.1 - 1) corrections and the last one.
    fn lately() -> f64 {
        1.0 / (math::exp(0.1) - 1.0) + 1.0
    }

    #[test]
    fn dispute_takes_back_last_second_of_a_changing_count() {
        let mut corrections = stood(0, -0.002, [0.0; 2]);
        assert!(corrections.lost_m() == 0.0 && corrections.take_slipped_m2() == 0.0);
        let [way_m, speed_mps] = corrections.take_back();
        assert!((way_m - 0.001 * lately()).abs() < 1e-6 && (speed_mps + 2.0 * way_m).abs() < 1e-6, "{way_m}");
        assert_eq!(corrections, Corrections::default());
    }

    /// What has been wrong for long has been believed for long.
    #[test]
    fn dispute_takes_back_last_second_of_a_standing_count() {
        let [way_m, speed_mps] = stood(50, -0.002, [0.0; 2]).take_back();
        assert!((way_m - 0.001 * lately()).abs() < 1e-6 && (speed_mps + 2.0 * way_m).abs() < 1e-6, "{way_m}");
    }

    /// The estimate as the counter has made it, less that without it: what the speed lost becomes way.
    #[test]
    fn corrected_speed_adds_to_the_lost_distance() {
        let speeds = (0..50).map(|k| 0.002 * (lately() + f64::from(k)));
        let expected_m = 0.001 * (lately() + 49.0) + speeds.map(|speed| 0.1 * speed).sum::<f64>();
        let lost_m = stood(50, 0.002, [0.0; 2]).lost_m();
        assert!((lost_m - 0.3 * expected_m).abs() < 1e-4, "{lost_m} {expected_m}");
    }

    #[test]
    fn corrections_beyond_chance_are_doubted_by_a_tenth_of_their_square() {
        let sure = stood(50, 0.0, [0.0; 2]);
        assert!((sure.lost_m() - 0.3e-3 * (lately() + 49.0)).abs() < 1e-6, "{}", sure.lost_m());
        // As much by chance as there is: half of it.
        let chance_m = 0.001 * (lately() + 49.0);
        let variance = chance_m * chance_m / 54.0;
        let half = stood(50, 0.0, [variance, 0.0]);
        assert!((0.4..0.6).contains(&(half.lost_m() / sure.lost_m())), "{} {}", half.lost_m(), sure.lost_m());
        assert!(
            stood(50, 0.0, [variance, 1.0]).lost_m() < 1e-9,
            "a filter that is unsure of the speed needs the counter"
        );
    }

    /// Corrections of a vehicle that hovers go to and fro.
    #[test]
    fn long_stop_counts_by_its_first_20_s() {
        let mut corrections = stood(190, 0.0, [0.0; 2]);
        let first_m = corrections.lost_m();
        assert!((first_m - 0.3e-3 * (lately() + 189.0)).abs() < 1e-4, "{first_m}");
        for _ in 0..2000 {
            corrections.pass(0.1, true);
            corrections.note([-0.001, 0.0], [0.0; 2]);
        }
        assert!((corrections.lost_m() - first_m).abs() < 0.004, "{}", corrections.lost_m());
    }

    /// It counts for a head's turn between passes, and for good in the position; a slow vehicle's coarse steps are no stops.
    #[test]
    fn doubt_of_a_stop_stays_when_the_count_changes_again() {
        for (readings, slips) in [(15, false), (50, true)] {
            let mut corrections = stood(readings, 0.0, [0.0; 2]);
            let before_m = corrections.lost_m();
            corrections.pass(0.1, false);
            let slipped_m2 = corrections.take_slipped_m2();
            assert_eq!(slipped_m2 > 0.99 * before_m * before_m, slips, "{readings}: {slipped_m2}");
            assert!(corrections.take_slipped_m2() == 0.0, "once");
            (0..200).for_each(|_| corrections.pass(0.1, false));
            assert!((corrections.lost_m() / before_m - math::exp(-20.1 / 20.0)).abs() < 1e-6);
        }
    }
}
