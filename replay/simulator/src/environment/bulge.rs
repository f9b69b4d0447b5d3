//! Parts of the wall that are displaced from the profile, towards its reference point or away from it.

use headrace_geometry::math::{self, PI};
use headrace_geometry::tunnel::WallPoint;

/// A displaced patch of wall, with the shape of a raised cosine along the tunnel and along the wall.
///
/// The wall moves along the ray from the profile's reference point. A displacement inwards ends short of the reference
/// point, so all of the wall remains visible from there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bulge {
    /// Number of the feature that the patch belongs to.
    pub(super) feature: u16,
    /// Chainage of the patch's middle, m.
    pub(super) chainage_m: f64,
    /// Half the patch's extent along the tunnel, m.
    pub(super) half_length_m: f64,
    /// Arc length of the patch's middle on the unscaled profile, m.
    pub(super) arc_m: f64,
    /// Half the patch's extent along the wall of the unscaled profile, m.
    pub(super) half_width_m: f64,
    /// Displacement of the wall in the patch's middle, inwards positive, m.
    pub(super) depth_m: f64,
}

impl Bulge {
    /// Chainage of the start of the patch, m.
    pub(super) fn begin_m(&self) -> f64 {
        self.chainage_m - self.half_length_m
    }

    /// Chainage of the end of the patch, m.
    pub(super) fn end_m(&self) -> f64 {
        self.chainage_m + self.half_length_m
    }

    /// Displacement of the wall by the patch at the point `at` of a profile with this perimeter, inwards positive, m.
    pub(super) fn displacement_m(&self, at: WallPoint, perimeter_m: f64) -> f64 {
        let along = (at.x_m - self.chainage_m) / self.half_length_m;
        if along.abs() >= 1.0 {
            return 0.0;
        }
        let across = self.off_middle_m(at.arc_m, perimeter_m) / self.half_width_m;
        if across >= 1.0 {
            return 0.0;
        }
        self.depth_m * raised_cosine(along) * raised_cosine(across)
    }

    /// Steepest slope of the displaced patch along the tunnel.
    pub(super) fn steepest_along(&self) -> f64 {
        self.depth_m.abs() * PI / 2.0 / self.half_length_m
    }

    /// Steepest slope of the displaced patch along the wall.
    pub(super) fn steepest_across(&self) -> f64 {
        self.depth_m.abs() * PI / 2.0 / self.half_width_m
    }

    /// Whether the patch comes within `margin_m` of this arc length.
    pub(super) fn covers(&self, arc_m: f64, perimeter_m: f64, margin_m: f64) -> bool {
        self.off_middle_m(arc_m, perimeter_m) < self.half_width_m + margin_m
    }

    /// Whether the displaced patch overlaps another patch.
    pub(super) fn overlaps(&self, other: &Self, perimeter_m: f64) -> bool {
        self.begin_m() < other.end_m()
            && other.begin_m() < self.end_m()
            && self.covers(other.arc_m, perimeter_m, other.half_width_m)
    }

    fn off_middle_m(&self, arc_m: f64, perimeter_m: f64) -> f64 {
        math::wrap_signed(arc_m - self.arc_m, perimeter_m).abs()
    }
}

/// A raised cosine: 1 at 0, and 0 with zero slope at -1 and 1.
fn raised_cosine(x: f64) -> f64 {
    0.5 + 0.5 * math::cos(PI * x)
}
