//! Upper bound on the slope of the gauge, which determines the length of steps along rays. The gauge of a point is its
//! distance from the reference point, divided by the distance of the wall in the same direction; see [`super::tube`].

use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::Profile;

use super::bulge::Bulge;

/// Number of directions in which a profile's wall is sampled.
const DIRECTIONS: u32 = 2_000;
/// Safety factor on the slope of the gauge, which may be steeper between the sampled directions.
const MARGIN: f64 = 1.05;
/// Largest ratio of a point's change of chainage to the distance that the point moves. It occurs at the inner wall of
/// the tightest allowed bend, which has a radius of twice the tunnel's half-width.
const INSIDE_OF_BEND: f64 = 2.0;

/// The wall of a profile as seen from its reference point.
#[derive(Debug, Clone)]
pub(super) struct Steepness {
    views: Vec<View>,
    perimeter_m: f64,
    /// Largest distance of the wall from the floor's centre, m.
    farthest_m: f64,
}

/// The profile's wall, seen from the reference point in one direction.
#[derive(Debug, Clone, Copy)]
struct View {
    arc_m: f64,
    /// Distance from the reference point to the wall in this direction, m.
    radius_m: f64,
    /// Distance from the reference point to the tangent of the wall in this direction, m.
    tangent_m: f64,
}

impl Steepness {
    /// Samples the wall of a profile.
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

    /// An upper bound on the slope of the gauge, 1/m. It holds wherever the gauge is at most 1.
    ///
    /// Let R(phi) be the distance of the wall from the reference point, and D(chainage, arc) the displacement of the
    /// wall. The gauge of a point is rho / (R - D), where rho is the distance of the point from the reference point.
    /// The slope of the gauge in the section is sqrt(1 + (R' - D')^2 / (R - D)^2) / (R - D). Along the tunnel, the
    /// slope of D adds to the slope of the gauge. The change of scale adds to it too, because it moves points in
    /// proportion to their distance from the floor's centre.
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

    /// Slopes of the gauge within the cross-section and along the tunnel.
    fn at(&self, view: &View, bulges: &[Bulge], scale: f64, scale_slope_pm: f64) -> (f64, f64) {
        // A bulge counts for this view if it is at most two sampled directions away from the view's direction.
        // `margin_m` is the distance on the wall between two sampled directions, taken twice.
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
