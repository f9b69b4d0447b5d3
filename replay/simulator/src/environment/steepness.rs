//! Bound on the gauge's slope, which sets the steps along rays.

use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;

use super::bulge::Bulge;

/// Directions in which a profile is sampled.
const DIRECTIONS: u32 = 2_000;
/// Allowance for directions between the samples.
const MARGIN: f64 = 1.05;
/// Largest ratio of chainage speed to the point's speed, on the inside of a bend. Bends are no tighter than twice the
/// tunnel's reach.
const INSIDE_OF_BEND: f64 = 2.0;

/// The wall of a profile as seen from its reference point.
#[derive(Debug, Clone)]
pub(super) struct Steepness {
    views: Vec<View>,
    perimeter_m: f64,
    /// The largest distance of the wall from the floor's centre, m.
    farthest_m: f64,
}

/// The wall in one direction.
#[derive(Debug, Clone, Copy)]
struct View {
    arc_m: f64,
    /// Its distance from the reference point, m.
    radius_m: f64,
    /// The distance of its tangent from the reference point, m.
    tangent_m: f64,
}

impl Steepness {
    /// Samples a profile.
    ///
    /// Allocates: startup only.
    pub(super) fn new(profile: &Profile) -> Self {
        let reference = profile.reference();
        let view = |k: u32| {
            let (sin, cos) = math::sin_cos(TAU * f64::from(k) / f64::from(DIRECTIONS));
            let hit = profile.cast_from_inside(reference, [cos, sin])?;
            let tangent_m = -(hit.normal[0] * cos + hit.normal[1] * sin) * hit.range_m;
            Some(View { arc_m: hit.arc_m, radius_m: hit.range_m, tangent_m })
        };
        Self {
            views: (0..DIRECTIONS).filter_map(view).collect(),
            perimeter_m: profile.perimeter_m(),
            farthest_m: profile.farthest_m(profile.point_at(0.0)),
        }
    }

    /// An upper bound on the slope of the gauge, in places where the gauge is at most 1, 1/m.
    ///
    /// With the wall at R(phi) from the reference point, displaced by D(chainage, arc), the gauge is rho / (R - D). In
    /// the section its slope is sqrt(1 + (R' - D')^2 / (R - D)^2) / (R - D). Along the tunnel D's own slope adds to it,
    /// and so does the change of scale, which moves points in proportion to their distance from the floor's centre.
    pub(super) fn gauge_slope_pm(
        &self,
        bulges: &[Bulge],
        least_scale: f64,
        scale_slope_pm: f64,
        curvature_pm: f64,
    ) -> f64 {
        let slopes = self.views.iter().map(|view| self.at(view, bulges, least_scale, scale_slope_pm.abs()));
        let bend = if curvature_pm == 0.0 { 1.0 } else { INSIDE_OF_BEND };
        MARGIN
            * slopes
                .map(|(section, along)| math::sqrt(section * section + bend * bend * along * along))
                .fold(0.0, f64::max)
    }

    /// Slopes within the section and along the tunnel.
    fn at(&self, view: &View, bulges: &[Bulge], scale: f64, scale_slope_pm: f64) -> (f64, f64) {
        // Distance along the wall to the next direction but one.
        let margin_m = 2.0 * TAU / f64::from(DIRECTIONS) * view.radius_m * view.radius_m / view.tangent_m;
        let (mut inwards_m, mut outwards_m, mut along, mut across) = (0.0, 0.0, 0.0, 0.0);
        for bulge in bulges.iter().filter(|b| b.covers(view.arc_m, self.perimeter_m, margin_m)) {
            inwards_m += bulge.depth_m.max(0.0);
            outwards_m += (-bulge.depth_m).max(0.0);
            along += bulge.steepest_along();
            across += bulge.steepest_across();
        }
        let View { radius_m, tangent_m, .. } = *view;
        let wall_m = scale * radius_m - inwards_m;
        let incline = math::sqrt((radius_m * radius_m / (tangent_m * tangent_m) - 1.0).max(0.0));
        let turned = scale * radius_m * incline + across * radius_m * radius_m / tangent_m;
        let section = math::sqrt(1.0 + turned * turned / (wall_m * wall_m)) / wall_m;
        let displaced = (along + inwards_m.max(outwards_m) * scale_slope_pm / scale) / wall_m;
        let reach_m = self.farthest_m + outwards_m / scale;
        (section, section * reach_m * scale_slope_pm + displaced)
    }
}
