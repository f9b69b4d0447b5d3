//! Limits for accepting returns as wall: for their deviation from the design profile, and from one another.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Limits for accepting returns as wall, m. They are larger in a larger cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallLimits {
    /// Tolerance: largest difference from the design, or from neighbouring wall returns, at which a return is wall.
    pub tolerance_m: f64,
    /// Deviation from the design above which a return contradicts the design.
    pub contradiction_m: f64,
    /// Perimeter of the design profile.
    pub perimeter_m: f64,
    /// Radius of a circle with this perimeter.
    pub radius_m: f64,
    /// Distance along the tunnel within which returns of an earlier pass are neighbours.
    ///
    /// It does not depend on the target T, so the samples do not depend on T either.
    pub reach_m: f64,
    /// Log odds from which on a run of returns counts as wall. They follow from the confidence of verdicts.
    ///
    /// At the opposite log odds, the run counts as something else.
    pub sure_log_odds: f64,
}

/// Tolerance as a share of the equivalent radius. The roughness of blasted rock is a tenth of a tunnel's radius.
const TOLERANCE_SHARE: f64 = 0.1;
/// Minimum tolerance, m. It is three times the resolution and noise of profiling sonars.
const LEAST_TOLERANCE_M: f64 = 0.03;

/// Approximate number of steps of a head in a turn, and least width of a step as a share of its width at the wall.
const STEPS: f64 = 128.0;
const STEPS_SHARE: f64 = 0.05;

/// Reach along the tunnel as a share of the equivalent radius, and minimum reach, m. Passes are about this far apart.
const REACH_SHARE: f64 = 0.1;
const LEAST_REACH_M: f64 = 0.2;

impl WallLimits {
    /// Creates the limits for a design profile of this perimeter. `confidence_sd` is the confidence of verdicts, as a
    /// number of standard deviations.
    pub fn new(perimeter_m: f64, contradiction_m: f64, confidence_sd: f64) -> Self {
        let radius_m = perimeter_m / math::TAU;
        let tolerance_m = (TOLERANCE_SHARE * radius_m).max(LEAST_TOLERANCE_M).min(contradiction_m);
        let reach_m = (REACH_SHARE * radius_m).max(LEAST_REACH_M);
        let below = 1.0 - math::erfc(confidence_sd / math::sqrt(2.0)) / 2.0;
        let sure_log_odds = math::ln(below / (1.0 - below));
        Self { tolerance_m, contradiction_m, perimeter_m, radius_m, reach_m, sure_log_odds }
    }

    /// Width across the ray that a single return represents, m. It is about the step of a head.
    pub(super) fn step_m(&self, placed: &PlacedReturn) -> f64 {
        let share = (1.0 + placed.off_m / self.radius_m).max(STEPS_SHARE);
        self.perimeter_m / STEPS * share
    }

    /// Whether a return is wall because it agrees with the design.
    pub fn is_design(&self, placed: &PlacedReturn) -> bool {
        placed.off_m.abs() <= self.tolerance_m
    }

    /// Whether two returns of neighbouring beams belong to the same wall.
    pub(super) fn agree(&self, a: &PlacedReturn, b: &PlacedReturn) -> bool {
        let apart_m = self.apart_m(a, b);
        let slope_m = (SLOPE * apart_m).min(MOST_SLOPE * self.tolerance_m);
        apart_m <= NEAR_SHARE * self.radius_m && (a.off_m - b.off_m).abs() <= self.tolerance_m + slope_m
    }

    /// Distance between two returns across their rays, m. It is measured at the smaller range from the centre.
    pub(super) fn width_m(&self, a: &PlacedReturn, b: &PlacedReturn) -> f64 {
        let inward = (1.0 + a.off_m.min(b.off_m) / self.radius_m).clamp(0.0, 1.0);
        let around_m = math::wrap_signed(a.arc_m - b.arc_m, self.perimeter_m) * inward;
        math::hypot(a.x_m - b.x_m, around_m)
    }

    /// Distance along the wall between the rays of two returns, m. It is measured at the larger range.
    fn apart_m(&self, a: &PlacedReturn, b: &PlacedReturn) -> f64 {
        let outward = 1.0 + a.off_m.max(b.off_m).max(0.0) / self.radius_m;
        let around_m = math::wrap_signed(a.arc_m - b.arc_m, self.perimeter_m) * outward;
        math::hypot(a.x_m - b.x_m, around_m)
    }
}

/// Slope between two neighbouring beams that is allowed in addition to the tolerance. 1 means 45 degrees.
const SLOPE: f64 = 1.0;
/// Largest allowance for the wall's slope, as a multiple of the tolerance.
const MOST_SLOPE: f64 = 1.0;
/// Maximum distance between neighbouring returns as a share of the radius.
const NEAR_SHARE: f64 = 0.4;

/// A return placed on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PlacedReturn {
    /// Chainage of the return, m.
    pub x_m: f64,
    /// Arc length of the return, m.
    pub arc_m: f64,
    /// Outward deviation from the design along the ray from the profile's reference point, m.
    pub off_m: f64,
}
