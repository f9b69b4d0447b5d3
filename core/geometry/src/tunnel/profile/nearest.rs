//! Point of a profile nearest to another point.

use super::closed_curve::Profile;
use super::element::{ARC_SLACK_RAD, Element, Shape};
use super::plane::{Yz, dot, norm, sub};
use super::tree::Bounds;
use crate::math::{self, TAU};

/// Point of the wall nearest to a given point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Distance to the wall, m, never negative.
    pub distance_m: f64,
    /// Arc length of the nearest point, m.
    pub arc_m: f64,
    /// The nearest point of the wall.
    pub point: Yz,
}

impl Profile {
    /// Returns the point of the wall nearest to `point`, from inside or outside. It is exact for lines and arcs.
    ///
    /// If several points are equally near, the one on the first element in order of arc length is returned.
    ///
    /// Allocates: never.
    pub fn nearest(&self, point: Yz) -> Nearest {
        let mut best = (f64::INFINITY, 0, self.reference);
        let distance = |bounds: &Bounds| bounds.distance_m(point);
        self.tree.search(self.elements.len(), distance, |some| {
            for (index, element) in self.elements.iter().enumerate().take(some.end).skip(some.start) {
                let place = element.nearest(point);
                let distance_m = norm(sub(point, place));
                if (distance_m, index) < (best.0, best.1) {
                    best = (distance_m, index, place);
                }
            }
            best.0
        });
        let (distance_m, index, place) = best;
        let arc_m = self.elements.get(index).map_or(0.0, |element| {
            let along = element.along(place).clamp(0.0, element.length_m);
            math::wrap(element.arc_m + along, self.perimeter_m)
        });
        Nearest { distance_m, arc_m, point: place }
    }
}

impl Element {
    fn nearest(&self, point: Yz) -> Yz {
        match self.shape {
            Shape::Line => {
                let along = sub(self.end, self.start);
                let share = (dot(sub(point, self.start), along) / dot(along, along)).clamp(0.0, 1.0);
                [self.start[0] + share * along[0], self.start[1] + share * along[1]]
            }
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, .. } => {
                let out = sub(point, centre);
                let length = norm(out);
                let turned = math::wrap(math::atan2(out[1], out[0]) - from_rad, TAU);
                if length > 0.0 && turned <= sweep_rad + ARC_SLACK_RAD {
                    let scale = radius_m / length;
                    return [centre[0] + out[0] * scale, centre[1] + out[1] * scale];
                }
                let (to_start, to_end) = (norm(sub(point, self.start)), norm(sub(point, self.end)));
                if to_start <= to_end { self.start } else { self.end }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tunnel::shapes;

    /// Smallest distance from `point` to wall points that are 0.5 mm apart. It is at most 0.25 mm longer than the
    /// distance to the wall.
    fn by_places(profile: &Profile, point: Yz) -> f64 {
        let places = math::round_to_i64(profile.perimeter_m() / 5e-4);
        (0..places).map(|k| norm(sub(point, profile.point_at(k as f64 * 5e-4)))).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn nearest_point_equals_a_dense_search() {
        let profiles = [
            shapes::ceran_blueprint().unwrap(),
            shapes::rectangle(4.0, 3.0).unwrap(),
            shapes::circle(2.0).unwrap(),
            shapes::arch(6.0, 5.0, 3.5).unwrap(),
        ];
        for profile in &profiles {
            for i in -7..=7 {
                for k in -7..=7 {
                    let point = [f64::from(i) * 0.97, 3.0 + f64::from(k) * 0.89];
                    let nearest = profile.nearest(point);
                    let dense = by_places(profile, point);
                    assert!(nearest.distance_m <= dense + 1e-12, "{point:?}");
                    assert!(nearest.distance_m > dense - 3e-4, "{point:?}: {nearest:?}, {dense}");
                    let there = profile.point_at(nearest.arc_m);
                    assert!(norm(sub(there, nearest.point)) < 1e-9, "{point:?}: {nearest:?}, {there:?}");
                }
            }
        }
    }

    #[test]
    fn nearest_wall_of_a_circle_is_one_radius_from_its_centre() {
        let profile = shapes::circle(2.0).unwrap();
        assert!((profile.nearest([0.0, 2.0]).distance_m - 2.0).abs() < 1e-12);
    }

    #[test]
    fn wall_point_has_distance_zero() {
        let profile = shapes::ceran_blueprint().unwrap();
        for k in 0..1000 {
            let arc_m = f64::from(k) * 0.03417;
            let nearest = profile.nearest(profile.point_at(arc_m));
            assert!(nearest.distance_m < 1e-9);
            let off = math::wrap_signed(nearest.arc_m - arc_m, profile.perimeter_m());
            assert!(off.abs() < 1e-9, "{arc_m}: {nearest:?}");
        }
    }
}
