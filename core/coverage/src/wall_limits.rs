//! How far returns may be off the design, and off one another, to be of one wall.

use serde::{Deserialize, Serialize};

use headrace_geometry::math;

/// Limits of what is taken for wall, m. They scale with the cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallLimits {
    /// Returns no farther than this off the design, or off others that agree with them, are wall.
    pub tolerance_m: f64,
    /// Returns farther than this off the design contradict it.
    pub contradiction_m: f64,
    /// Perimeter of the design profile.
    pub perimeter_m: f64,
    /// Radius of a circle of this perimeter.
    pub radius_m: f64,
    /// How far along the tunnel an earlier pass counts. Not the target T: samples don't depend on what is asked of them.
    pub reach_m: f64,
}

/// Share of the equivalent radius: the roughness of blasted rock, a tenth of a tunnel's radius.
const TOLERANCE_SHARE: f64 = 0.1;
/// The least tolerance, m: resolution and noise of profiling sonars, three times.
const LEAST_TOLERANCE_M: f64 = 0.03;

/// Share of the equivalent radius, and the least, m: about the distance between passes.
const REACH_SHARE: f64 = 0.1;
const LEAST_REACH_M: f64 = 0.2;

impl WallLimits {
    /// Limits for a profile of this perimeter.
    pub fn new(perimeter_m: f64, contradiction_m: f64) -> Self {
        let radius_m = perimeter_m / math::TAU;
        let tolerance_m = (TOLERANCE_SHARE * radius_m).max(LEAST_TOLERANCE_M).min(contradiction_m);
        let reach_m = (REACH_SHARE * radius_m).max(LEAST_REACH_M);
        Self { tolerance_m, contradiction_m, perimeter_m, radius_m, reach_m }
    }

    /// Whether the design itself vouches for a return.
    pub fn is_design(&self, placed: &PlacedReturn) -> bool {
        placed.off_m.abs() <= self.tolerance_m
    }

    /// Whether two returns of neighbouring beams are of one wall.
    pub(super) fn agree(&self, a: &PlacedReturn, b: &PlacedReturn) -> bool {
        let apart_m = self.apart_m(a, b);
        let slope_m = (SLOPE * apart_m).min(MOST_SLOPE * self.tolerance_m);
        apart_m <= NEAR_SHARE * self.radius_m && (a.off_m - b.off_m).abs() <= self.tolerance_m + slope_m
    }

    /// Distance between two returns across their rays, at the nearer one's range from the middle, m.
    pub(super) fn width_m(&self, a: &PlacedReturn, b: &PlacedReturn) -> f64 {
        let inward = (1.0 + a.off_m.min(b.off_m) / self.radius_m).clamp(0.0, 1.0);
        let around_m = math::wrap_signed(a.arc_m - b.arc_m, self.perimeter_m) * inward;
        math::hypot(a.x_m - b.x_m, around_m)
    }

    /// Distance between the rays of two returns along the wall, at the farther one, m.
    fn apart_m(&self, a: &PlacedReturn, b: &PlacedReturn) -> f64 {
        let outward = 1.0 + a.off_m.max(b.off_m).max(0.0) / self.radius_m;
        let around_m = math::wrap_signed(a.arc_m - b.arc_m, self.perimeter_m) * outward;
        math::hypot(a.x_m - b.x_m, around_m)
    }
}

/// Steepness of rock that two neighbouring beams may meet, beyond the tolerance: 45 degrees.
const SLOPE: f64 = 1.0;
/// What steepness may add at most, tolerances.
const MOST_SLOPE: f64 = 1.0;
/// Neighbours are no farther apart than this share of the radius.
const NEAR_SHARE: f64 = 0.4;

/// A return placed on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct PlacedReturn {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length, m.
    pub arc_m: f64,
    /// Outward deviation from the design along the ray from the profile's reference point, m.
    pub off_m: f64,
}
