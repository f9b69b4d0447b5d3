//! Odds that a run is wall. A run consists of neighbouring returns that do not continue known wall. It comes from a
//! feature of the wall, from an object in the water (a fish, bubbles, silt), or from an echo by a second path.
//!
//! A feature of the wall is about as high or deep as it is wide. An object is small, and at any distance from the wall.
//! So the size of a run shows how likely it is wall. It becomes more likely if a later pass meets the same thing at the
//! same place.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Size of a run. Its returns are neighbours, come from one head and agree with each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    /// Width of the run across the beams, m.
    pub(super) width_m: f64,
    /// Largest distance of the run from the design profile, m.
    pub(super) off_m: f64,
    /// Mean number of earlier passes that met the same thing.
    pub(super) confirmed: f64,
    /// Number of the run's ends that slope to the wall, from 0 to 2.
    pub(super) slopes: u8,
}

// The figures below are assumptions about tunnels and water. They are not fitted to data.
// docs/decisions/0004-verdicts-and-causes.md describes their effect.

/// Mean width of objects in the water and of echoes by a second path, m. In narrow tunnels, it is at most the share
/// `OBJECT_WIDTH_SHARE` of the equivalent radius.
const OBJECT_WIDTH_M: f64 = 0.3;
const OBJECT_WIDTH_SHARE: f64 = 0.1;
/// Median height or depth of a wall feature as a share of its width, and standard deviation of the natural logarithm of
/// this share.
///
/// The height of a half-buried boulder is half its width, and a niche is about as deep as wide.
const HEIGHT_SHARE: f64 = 0.7;
const HEIGHT_LN_SD: f64 = 0.7;
/// Share of wall features whose height or depth does not depend on their width: posts, ladders and boreholes.
const SLENDER_SHARE: f64 = 0.01;
/// Natural logarithm of the ratio of the largest to the smallest width of wall features, which is thirty.
///
/// All logarithms of the width between them are equally likely.
const WIDTHS_LN: f64 = 3.4;
/// Growth of the log odds that a run is wall, for each earlier pass that met it.
///
/// Nearly every pass meets wall again. It is assumed that 3 % of passes meet objects and second echoes again.
const CONFIRMS: f64 = 3.5;
/// Growth of the log odds that a run is wall, for each of its ends that slopes to the wall.
///
/// It is assumed that half of the ends of wall features slope, but only 7 % of those of objects and second echoes.
const SLOPES: f64 = 2.0;

/// Expected numbers of runs in this dive that were wall, and of runs that were something else.
///
/// They give the odds of the next run before its size is known. In murky water, few runs are wall.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Experience {
    wall: f64,
    other: f64,
}

/// Number of later runs after which a run's weight has fallen to a third (1/e).
const REMEMBERED_RUNS: f64 = 50.0;
/// Runs that are added to those of the dive. They stand for clear water, where five of six runs are wall.
///
/// Because of them, the odds of the next run stay limited, however many runs were wall or something else.
const PRIOR: Experience = Experience { wall: 2.5, other: 0.5 };

impl Experience {
    /// Returns the log odds that a run is wall, in a tunnel of this equivalent radius.
    pub(super) fn log_odds(&self, run: &Extent, radius_m: f64) -> f64 {
        let Extent { width_m, off_m, confirmed, slopes } = *run;
        debug_assert!(
            width_m > 0.0 && off_m > 0.0 && radius_m > 0.0,
            "a run has a size: {run:?}, {radius_m} m"
        );
        // Low features, such as a bulging lining, are as likely as features of median height.
        let excess = math::ln(off_m / (HEIGHT_SHARE * width_m)).max(0.0) / HEIGHT_LN_SD;
        let usual = math::exp(-excess * excess / 2.0) / (off_m * HEIGHT_LN_SD * math::sqrt(math::TAU));
        let height = math::ln((1.0 - SLENDER_SHARE) * usual + SLENDER_SHARE / radius_m);
        // Objects are equally likely at any distance from the wall, up to the middle of the tunnel.
        let distance = -math::ln(radius_m);
        let width = -math::ln(width_m * WIDTHS_LN);
        let mean_m = OBJECT_WIDTH_M.min(OBJECT_WIDTH_SHARE * radius_m);
        let object_width = -width_m / mean_m - math::ln(mean_m);
        let size = height - distance + width - object_width;
        let before = math::ln((PRIOR.wall + self.wall) / (PRIOR.other + self.other));
        before + size + CONFIRMS * confirmed + SLOPES * f64::from(slopes)
    }

    /// Adds a run with these log odds of being wall.
    pub(super) fn add(&mut self, log_odds: f64) {
        let wall = probability(log_odds);
        let kept = 1.0 - 1.0 / REMEMBERED_RUNS;
        self.wall = kept * self.wall + wall;
        self.other = kept * self.other + 1.0 - wall;
    }
}

/// Probability of an event with these log odds.
pub(super) fn probability(log_odds: f64) -> f64 {
    1.0 / (1.0 + math::exp(-log_odds))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RADIUS_M: f64 = 5.5;

    fn odds(width_m: f64, off_m: f64, confirmed: f64) -> f64 {
        Experience::default().log_odds(&Extent { width_m, off_m, confirmed, slopes: 0 }, RADIUS_M)
    }

    /// Checks the probability that a run is wall in clear water. Boulders and side tunnels are wall. Fish and second
    /// echoes, which are small and far from the wall, are not.
    #[test]
    fn wide_runs_near_the_wall_are_wall_but_small_runs_far_from_it_are_not() {
        for (width_m, off_m, confirmed, least, most) in [
            (3.0, 0.5, 0.0, 0.999, 1.0),
            (3.0, 3.0, 0.0, 0.99, 1.0),
            (0.6, 0.4, 0.0, 0.9, 1.0),
            (0.6, 3.0, 0.0, 0.02, 0.5),
            (0.6, 3.0, 2.0, 0.977, 1.0),
            (0.2, 3.0, 0.0, 0.0, 0.3),
            (0.05, 2.0, 0.0, 0.0, 0.3),
            (0.05, 2.0, 2.0, 0.977, 1.0),
        ] {
            let wall = probability(odds(width_m, off_m, confirmed));
            assert!((least..=most).contains(&wall), "{width_m} m wide, {off_m} m off, {confirmed}: {wall}");
        }
    }

    proptest! {
        #[test]
        fn odds_of_wall_grow_with_closeness_to_the_wall_confirmation_and_clear_water(
            width_m in 0.01f64..5.0,
            off_m in 0.05f64..5.0,
            confirmed in 0.0f64..3.0,
            strays in 1usize..20,
        ) {
            let here = odds(width_m, off_m, confirmed);
            prop_assert!(odds(width_m, 1.1 * off_m, confirmed) <= here);
            prop_assert!(odds(width_m, off_m, confirmed + 1.0) > here);
            let mut murk = Experience::default();
            (0..strays).for_each(|_| murk.add(-5.0));
            let extent = Extent { width_m, off_m, confirmed, slopes: 0 };
            prop_assert!(murk.log_odds(&extent, RADIUS_M) < here);
        }

        /// Experience fades, so the odds recover in clear water after murky water. Even after a long dive, it never
        /// decides alone. A slender run remains doubtful in the clearest water. A run that two earlier passes have met
        /// is wall in the murkiest water.
        #[test]
        fn experience_from_earlier_runs_never_decides_alone(runs in 0usize..100_000) {
            let slender = Extent { width_m: 0.2, off_m: 3.0, confirmed: 0.0, slopes: 0 };
            let boulder = Extent { width_m: 0.6, off_m: 0.4, confirmed: 0.0, slopes: 0 };
            let mut experience = Experience::default();
            (0..runs).for_each(|_| experience.add(-50.0));
            let confirmed = Extent { confirmed: 2.0, ..boulder };
            prop_assert!(probability(experience.log_odds(&confirmed, RADIUS_M)) > 0.977);
            (0..500).for_each(|_| experience.add(50.0));
            prop_assert!(experience.log_odds(&boulder, RADIUS_M) >= odds(0.6, 0.4, 0.0));
            (0..runs).for_each(|_| experience.add(50.0));
            prop_assert!(probability(experience.log_odds(&slender, RADIUS_M)) < 0.977);
        }
    }
}
