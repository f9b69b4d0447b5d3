//! Intervals of speed that meet a coverage target T.
//!
//! Heads that are apart along the hull are in phase only at some speeds, so the target may be met in several intervals.
//!
//! The advised speed depends on the heads' measured motion and the vehicle's pose, not on the present speed. It is the
//! upper end of the highest interval. If that interval vanishes while heads run out of phase, the next interval may be
//! far lower, and the advice jumps. [`EASE`] provides hysteresis against jumps up and down.

use super::search::{self, SPEED_MARGIN};
use crate::margin::RemainingTarget;
use crate::passes::{Passes, Phasing};
use crate::spacing;
use crate::strips::{Going, Strips};
use headrace_geometry::math;

/// Hysteresis of the advised interval, as a share of the target.
///
/// The previously advised interval is kept while its T exceeds the target by at most this share. A higher interval
/// replaces it only if it meets a target that is smaller by this share. A share of 2 % corresponds to 2 mm/s at 0.1
/// m/s.
pub(super) const EASE: f64 = 0.02;
/// Speeds that differ by less than this share count as one interval.
const NEAR: f64 = 0.05;
/// Number of speeds tested on either side of the previous result, and the relative step between them.
const TRIED: i32 = 30;
const TRIED_SHARE: f64 = 0.001;

/// Inputs that decide whether a speed meets a target.
pub(super) struct Driving<'a> {
    pub(super) strips: &'a Strips,
    pub(super) phasing: &'a Phasing,
    pub(super) going: &'a Going,
    pub(super) parallax_rad: f64,
    /// Whether lost returns require extra passes over each place.
    pub(super) lossy: bool,
    pub(super) astern: bool,
    pub(super) sure: RemainingTarget,
    /// Target minus the margin for position errors at unlimited speed, m. `apart_m` is the distance between the heads
    /// along the hull, m.
    pub(super) most_m: f64,
    pub(super) apart_m: f64,
    /// Speed above which the target is missed, whatever the heads' phases, m/s.
    pub(super) bound_mps: f64,
}

impl Driving<'_> {
    /// Whether a speed meets the target when the target is enlarged by the share `more`.
    pub(super) fn meets(&self, speed_mps: f64, more: f64) -> bool {
        self.tries(speed_mps, more).is_ok()
    }

    /// Checks whether a speed meets the target when the target is enlarged by the share `more`.
    ///
    /// If the tested speed misses the target, returns the same or a lower speed, m/s. No speed between the returned and
    /// the tested speed meets the target.
    pub(super) fn tries(&self, speed_mps: f64, more: f64) -> Result<(), f64> {
        let most_m = self.most_m * (1.0 + more);
        let then = self.passes(speed_mps);
        // Where all heads see the wall, the gap between passes is the shortest. This simple test therefore rejects most
        // speeds.
        let gap_s = then.gap_s(then.heads()).unwrap_or(f64::INFINITY);
        if speed_mps * gap_s > most_m {
            return Err(self.below_mps(speed_mps, gap_s, most_m));
        }
        let target_m = self.sure.at_m(speed_mps) * (1.0 + more);
        if speed_mps * gap_s > target_m {
            return Err(speed_mps);
        }
        let Some(unmet) = self.strips.unmet(0, &then, speed_mps, target_m, self.going) else { return Ok(()) };
        // If a strip is narrower than the target, samples on its two sides may keep holes small enough at a lower
        // speed.
        let stays = unmet.width_m > most_m;
        let below_mps = |along_m| self.below_mps(speed_mps, unmet.gap_s, along_m).min(speed_mps);
        Err(if stays { spacing::along_m(most_m, unmet.t_y_m).map_or(0.0, below_mps) } else { speed_mps })
    }

    /// Returns the speed, m/s, down to which neighbouring passes stay more than `most_m` apart.
    ///
    /// At the given speed v, neighbouring passes are g = `gap_s` apart in time. At a lower speed u, heads at most a
    /// apart along the hull shift by up to a (1 / u - 1 / v) in time relative to each other. The longest gap then lasts
    /// at least g minus this shift. Its length along the tunnel is at least u g - a (1 - u / v).
    fn below_mps(&self, speed_mps: f64, gap_s: f64, most_m: f64) -> f64 {
        /// Allowance for rounding errors of the speed.
        const A_LITTLE: f64 = 1e-9;
        let apart_m = self.apart_m;
        (most_m + apart_m) / (gap_s + apart_m / speed_mps) * (1.0 + A_LITTLE)
    }

    fn t_m(&self, speed_mps: f64) -> f64 {
        self.strips.t_max_m(0, &self.passes(speed_mps), speed_mps, self.going)
    }

    fn passes(&self, speed_mps: f64) -> Passes {
        let signed_mps = if self.astern { -speed_mps } else { speed_mps };
        self.phasing.at(signed_mps).beside(self.parallax_rad).lossy(self.lossy)
    }

    /// Returns the largest speed that meets the target, m/s, or zero; `last_mps` is the previous result.
    pub(super) fn fastest_mps(&self, last_mps: Option<f64>) -> f64 {
        let highest = |more: f64| {
            if self.phasing.fits_some_speeds() {
                search::downwards_mps(self.bound_mps, |speed_mps: f64| self.tries(speed_mps, more))
            } else {
                search::highest_mps(self.bound_mps, |speed_mps: f64| self.meets(speed_mps, more))
            }
        };
        let top_mps = highest(0.0);
        let Some(last_mps) = last_mps.filter(|_| self.phasing.fits_some_speeds()) else { return top_mps };
        if top_mps < last_mps * (1.0 - NEAR) {
            return self.kept_mps(last_mps).unwrap_or(top_mps);
        }
        if top_mps > last_mps * (1.0 + NEAR) && highest(-EASE) <= last_mps * (1.0 + NEAR) {
            let within =
                search::downwards_mps(last_mps * (1.0 + NEAR), |speed_mps| self.tries(speed_mps, 0.0));
            return if within < last_mps * (1.0 - NEAR) { top_mps } else { within };
        }
        top_mps
    }

    /// Returns the speed reduced by the margin [`SPEED_MARGIN`], or by up to twice that margin.
    ///
    /// The larger margin applies where the spacing T grows faster than the speed, because the heads run out of phase.
    /// A speed error of 1 % then costs more than 1 % of T.
    pub(super) fn kept_back_mps(&self, fastest_mps: f64) -> f64 {
        const STEEP: f64 = 2.0 * SPEED_MARGIN;
        let meets = |speed_mps: f64| self.meets(speed_mps, 0.0);
        let less_mps = search::kept_back_mps(fastest_mps, SPEED_MARGIN, meets);
        let nearly = |speed_mps: f64| self.meets(speed_mps, STEEP);
        let beyond_mps = fastest_mps * (1.0 - SPEED_MARGIN) * (1.0 + STEEP);
        if fastest_mps <= 0.0 || nearly(beyond_mps) {
            return less_mps;
        }
        let edge_mps = search::edge_mps(fastest_mps, beyond_mps, nearly);
        less_mps.min(search::kept_back_mps(fastest_mps, 1.0 - edge_mps / fastest_mps / (1.0 + STEEP), meets))
    }

    /// Returns the speed with the smallest spacing T near the previous result.
    ///
    /// `None` if this T exceeds the target by more than [`EASE`].
    fn kept_mps(&self, last_mps: f64) -> Option<f64> {
        let near = (-TRIED..=TRIED).map(|k| last_mps * (1.0 + TRIED_SHARE * f64::from(k)));
        let best =
            near.map(|speed_mps| (speed_mps, self.t_m(speed_mps))).min_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 <= self.sure.at_m(best.0) * (1.0 + EASE)).then_some(best.0)
    }

    /// Returns the lower end of the interval that ends at `speed_mps` and whose speeds all meet the target, m/s.
    ///
    /// Zero if all lower speeds meet the target.
    pub(super) fn lower_end_mps(&self, speed_mps: f64) -> f64 {
        const STEP: f64 = 0.99;
        /// The search stops at this share of the upper speed, because no pilot goes more slowly.
        const SLOWEST: f64 = 0.2;
        if !self.phasing.fits_some_speeds() {
            return 0.0;
        }
        let mut good = speed_mps;
        while good > SLOWEST * speed_mps {
            let next = good * STEP;
            if !self.meets(next, 0.0) {
                return good;
            }
            good = next;
        }
        0.0
    }

    /// Returns the speed nearest to `speed_mps` that meets the target, m/s. It is at least half and at most twice
    /// `speed_mps`.
    ///
    /// `None` if `speed_mps` itself meets the target, or if no speed within this range meets it.
    pub(super) fn nearest_mps(&self, speed_mps: f64) -> Option<f64> {
        const STEPS: i32 = 70;
        const STEP: f64 = 0.01;
        if self.meets(speed_mps, 0.0) {
            return None;
        }
        (1..=STEPS).find_map(|k| {
            let by = math::exp(STEP * f64::from(k));
            let both = [speed_mps / by, speed_mps * by];
            both.into_iter().find(|tried_mps| *tried_mps <= self.bound_mps && self.meets(*tried_mps, 0.0))
        })
    }
}
