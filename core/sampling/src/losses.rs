//! Random loss of sonar returns, and the number of passes over a place that makes up for it.
//!
//! The model assumes that a head loses the returns of several successive pings of a turn at a time. After Gilbert
//! (1960), the model has two parameters: the share of pings that are lost, and the probability that the ping after a
//! lost ping is lost too. Passes lose pings independently of each other. A run of lost pings widens the largest circle
//! without samples between two passes. If a run is as wide as the target, the pass counts as missing at that place.
//!
//! A return that is lost at the same angle in every turn is not lost by chance, and a slower speed does not restore
//! it. The caller excludes such losses.

use serde::{Deserialize, Serialize};

use super::head::MAX_HEADS;
use headrace_geometry::math;

/// Length, m, of a stretch of wall; the chance of a hole is limited per stretch.
///
/// At most the share [`MAY_FAIL`] of all stretches may miss the target because of lost returns.
const STRETCH_M: f64 = 0.25;
/// Share of stretches of wall that may miss the target because of lost returns. The other 95 % of the stretches meet
/// it.
const MAY_FAIL: f64 = 0.05;
/// Maximum number of passes required over a place.
///
/// More passes take too long in practice. Instead, the heads must lose fewer returns.
pub const MOST_PASSES: f64 = 10.0;
/// A hole that chance makes with a lower probability than this does not count as caused by chance.
const HARDLY: f64 = 1e-3;
/// Share of a hole's diameter, along and around the tunnel, that lost passes and pings must cover.
const INNER: f64 = 0.7;
/// Upper limit of the share of lost returns. In practice, a head that receives one ping in a thousand receives
/// nothing.
const MOST_SHARE: f64 = 0.999;

/// Rate at which a head's pings lose their returns by chance.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LossRate {
    /// Share of pings with lost returns among all pings, from 0 to 1.
    pub share: f64,
    /// Share of lost pings among the pings that follow a lost ping, from 0 to 1.
    pub after_lost: f64,
}

impl LossRate {
    /// Creates the rate of pings that are lost independently of each other.
    pub fn independent(share: f64) -> Self {
        let rate = Self { share, after_lost: share };
        debug_assert!(rate.is_valid(), "a share of lost pings is from 0 to 1: {share}");
        rate
    }

    /// Whether both shares of lost pings are from 0 to 1.
    pub fn is_valid(&self) -> bool {
        [self.share, self.after_lost].iter().all(|share| (0.0..=1.0).contains(share))
    }

    fn clamped(self) -> Self {
        debug_assert!(self.is_valid(), "shares of lost pings are from 0 to 1: {self:?}");
        Self { share: self.share.clamp(0.0, MOST_SHARE), after_lost: self.after_lost.clamp(0.0, MOST_SHARE) }
    }

    /// Probability that `pings` pings in a row are lost; at least one ping counts.
    fn chance_of_run(self, pings: f64) -> f64 {
        self.share * power(self.after_lost, (pings - 1.0).max(0.0))
    }

    /// Length, in pings, of the longest run of lost pings that is expected at this many places on the wall.
    ///
    /// A run of this length occurs at one of these places with the probability [`MAY_FAIL`]. Zero if even a single lost
    /// ping is less likely than [`MAY_FAIL`].
    fn longest_run(self, places: f64) -> f64 {
        let expected = places * self.share / MAY_FAIL;
        if expected <= 0.0 {
            return 0.0;
        }
        let rarer = -math::ln(self.after_lost.max(f64::MIN_POSITIVE));
        (1.0 + math::ln(expected) / rarer).max(0.0)
    }
}

/// Spacing of samples on a wall, and the target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sampled {
    /// Target T, m.
    pub target_m: f64,
    /// Largest distance between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// Perimeter of the wall, m.
    pub perimeter_m: f64,
}

impl Sampled {
    /// Returns the number of passes over each place that lost returns require in place of a single pass.
    ///
    /// With these passes, 95 of 100 stretches of 0.25 m meet the target. The number is the ratio of two distances
    /// between passes: the one that the target allows without losses, and the smaller one that it allows with losses.
    /// The number ranges from 1 without losses to [`MOST_PASSES`], and is continuous in all inputs. The model assumes
    /// that the heads pass one after the other, and that the heads with the highest losses come first.
    ///
    /// Source: `docs/why/coverage.md`, "Lost returns".
    pub fn passes_needed(&self, rates: impl Iterator<Item = LossRate>) -> f64 {
        let mut heads = [LossRate::default(); MAX_HEADS];
        let mut count = 0;
        for (slot, rate) in heads.iter_mut().zip(rates) {
            *slot = rate.clamped();
            count += 1;
        }
        let heads = heads.get_mut(..count).unwrap_or_default();
        let lattice_m2 = (self.target_m - self.t_y_m) * (self.target_m + self.t_y_m);
        if lattice_m2 <= 0.0 || self.t_y_m <= 0.0 || heads.iter().all(|rate| rate.share <= 0.0) {
            return 1.0;
        }
        let pings = self.pings_across();
        heads.sort_unstable_by(|a, b| b.chance_of_run(pings).total_cmp(&a.chance_of_run(pings)));
        let along_m = math::sqrt(lattice_m2);
        let places = self.perimeter_m / self.t_y_m * STRETCH_M / along_m;
        // With more passes, there are more places at which passes may fail together. The number is therefore estimated
        // a second time, with the places of the first estimate.
        let once = self.passes_for(places, along_m, heads);
        let passes = self.passes_for(places * once, along_m, heads);
        debug_assert!(
            (1.0..=MOST_PASSES).contains(&passes),
            "lost returns need 1 to {MOST_PASSES} passes: {passes}"
        );
        passes
    }

    /// Whether a hole of this diameter, m, may have been caused by chance.
    ///
    /// `along_m` is the distance between passes, and `rate` the loss rate. If the result is `false`, the wall at the
    /// hole gives no returns at any speed.
    ///
    /// Source: `docs/why/coverage.md`, "Lost returns".
    pub fn is_by_chance(&self, hole_m: f64, along_m: f64, rate: LossRate) -> bool {
        let rate = rate.clamped();
        if self.t_y_m <= 0.0 || along_m <= 0.0 {
            return true;
        }
        let inner_m = INNER * hole_m;
        let places = self.perimeter_m / self.t_y_m * STRETCH_M / along_m;
        let chance = rate.chance_of_run((inner_m / self.t_y_m).max(1.0));
        places.max(1.0) * power(chance, (inner_m / along_m).max(1.0)) >= HARDLY
    }

    /// Number of successive pings, at least one, whose loss makes a gap as wide as the target.
    fn pings_across(&self) -> f64 {
        (self.target_m / self.t_y_m - 1.0).max(1.0)
    }

    /// Number of passes needed over a place, given the number of places at which passes may fail together.
    ///
    /// See [`Sampled::passes_needed`]. `along_m` is the allowed distance between passes without losses.
    fn passes_for(&self, places: f64, along_m: f64, heads: &[LossRate]) -> f64 {
        let pings = self.pings_across();
        let mut left = places;
        let mut whole = 0.0;
        let mut going_by = heads.iter().cycle();
        while let Some(head) = going_by.next().filter(|_| whole < MOST_PASSES) {
            let chance = head.chance_of_run(pings);
            if left * chance <= MAY_FAIL {
                return (whole + along_m / self.along_with_run_m(head.longest_run(left)))
                    .clamp(1.0, MOST_PASSES);
            }
            left *= chance;
            whole += 1.0;
        }
        MOST_PASSES
    }

    /// Distance between passes at which the largest circle equals the target, m.
    ///
    /// One of two neighbouring passes misses a run of pings, which leaves a gap. The circle touches both ends of the
    /// gap and two neighbouring samples of the other pass. Its centre is (a^2 + h^2 - g^2) / (2 a) from the pass with
    /// the gap: a is the distance between passes, h is half the distance between samples of a turn, and g is half the
    /// gap.
    fn along_with_run_m(&self, lost: f64) -> f64 {
        let half_m = self.t_y_m / 2.0;
        let gap_m = (half_m * (1.0 + lost)).min(self.target_m / 2.0).max(half_m);
        let [h2, g2] = [half_m * half_m, gap_m * gap_m];
        let b = self.target_m * self.target_m - 2.0 * (h2 + g2);
        let root = math::sqrt((b * b - 4.0 * (g2 - h2) * (g2 - h2)).max(0.0));
        math::sqrt(f64::midpoint(b, root).max(0.0)).max(f64::MIN_POSITIVE)
    }
}

fn power(base: f64, exponent: f64) -> f64 {
    if base <= 0.0 {
        return if exponent > 0.0 { 0.0 } else { 1.0 };
    }
    math::exp(exponent * math::ln(base))
}

#[cfg(test)]
mod tests;
