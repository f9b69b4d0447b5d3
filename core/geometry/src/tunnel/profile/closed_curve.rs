//! The closed curve of a profile: checks, ray casting, and places on the wall.

use super::element::{Element, Piece, Shape, build};
use super::plane::{Yz, cross, dot, norm, sub};
use super::support::Support;
use super::tree::{Bounds, Tree};
use crate::math::{self, TAU};

/// Distance below which two points count as equal, m.
pub(super) const SAME_POINT_M: f64 = 1e-9;
/// Number of elements beyond which a polygon gets a table of its extent by direction. The table makes bounds fast.
const MANY: usize = 256;
/// Number of wall points at equal spacing that [`Profile::places`] returns.
const PLACES: u32 = 64;

/// A design profile. Arc length grows from the floor's centre via the left wall, in [0, perimeter).
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    pub(super) elements: Vec<Element>,
    pub(super) tree: Tree,
    /// Table of the profile's extent by direction, only for polygons of many elements.
    support: Option<Support>,
    pub(super) perimeter_m: f64,
    pub(super) reference: Yz,
    /// Equidistant points on the wall, starting at the floor's centre.
    places: Vec<Yz>,
}

/// Intersection of a ray with the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallHit {
    /// Ray parameter. It is the distance in metres if the direction is a unit vector.
    pub range_m: f64,
    /// Arc length of the intersection, m.
    pub arc_m: f64,
    /// The intersection point.
    pub point: Yz,
    /// Unit normal of the wall at the intersection, pointing inwards.
    pub normal: Yz,
}

/// Reason why the given points or pieces are rejected as a profile.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// There are fewer than three distinct points.
    #[error("a profile needs at least 3 distinct points; this one has {count}")]
    TooFewPoints {
        /// Number of distinct points.
        count: usize,
    },
    /// A coordinate is not finite, or exceeds 1000 m.
    #[error("vertex {vertex} has a coordinate that is not a number within 1000 m")]
    NotFinite {
        /// Index of the vertex, counted from zero.
        vertex: usize,
    },
    /// As seen from the reference point, part of the wall at this vertex is hidden or runs backwards.
    #[error(
        "the profile isn't star-shaped about ({y}, {z}): it runs backwards or crosses itself at vertex {vertex}, counted from 0",
        y = .reference[0], z = .reference[1]
    )]
    NotStarShaped {
        /// Index of the offending piece in the input. For a polygon, index of the point at which the offending edge
        /// begins.
        vertex: usize,
        /// The reference point of the profile.
        reference: Yz,
    },
    /// All points of the polygon are on one side of y = 0.
    #[error("all points are on one side of y = 0; the profile needs points on both sides")]
    BesideMiddle,
    /// The curve does not wind about its reference point exactly once.
    #[error(
        "the profile goes {turns} times round the reference point ({y}, {z}); it must go round once",
        y = .reference[0], z = .reference[1]
    )]
    Winding {
        /// Number of turns of the curve about the reference point.
        turns: i64,
        /// The reference point of the profile.
        reference: Yz,
    },
}

impl ProfileError {
    /// Returns the index of the offending vertex in the input; `None` if the error concerns no single vertex.
    pub fn vertex(&self) -> Option<usize> {
        match self {
            Self::NotFinite { vertex } | Self::NotStarShaped { vertex, .. } => Some(*vertex),
            Self::TooFewPoints { .. } | Self::BesideMiddle | Self::Winding { .. } => None,
        }
    }
}

impl Profile {
    /// Creates a closed curve from the floor's centre `start` through `pieces` and back to `start`.
    ///
    /// Pieces run counter-clockwise if y is drawn to the right and z up. All of the wall must be visible from
    /// `reference`.
    ///
    /// Errors: see [`ProfileError`]. Allocates: startup only.
    pub fn new(start: Yz, pieces: &[Piece], reference: Yz) -> Result<Self, ProfileError> {
        let (mut elements, mut pieces_of) = (Vec::new(), Vec::new());
        let mut at = start;
        for (vertex, piece) in pieces.iter().enumerate() {
            let element = build(at, *piece);
            if !element.end.iter().all(|c| c.abs() <= 1000.0) {
                return Err(ProfileError::NotFinite { vertex });
            }
            if element.length_m > SAME_POINT_M {
                at = element.end;
                elements.push(element);
                pieces_of.push(vertex);
            }
        }
        let closing = build(at, Piece::LineTo(start));
        if closing.length_m > SAME_POINT_M {
            elements.push(closing);
            pieces_of.push(pieces.len());
        } else if let Some(last) = elements.last_mut() {
            last.end = start;
        }
        let one_arc = elements.len() == 1 && matches!(elements.first(), Some(e) if e.shape != Shape::Line);
        if elements.len() < 3 && !one_arc {
            return Err(ProfileError::TooFewPoints { count: elements.len() });
        }
        let mut perimeter_m = 0.0;
        for element in &mut elements {
            element.arc_m = perimeter_m;
            perimeter_m += element.length_m;
        }
        check_star_shaped(elements.iter().zip(pieces_of), reference)?;
        let tree = Tree::over(&elements);
        let is_polygon = elements.iter().all(|element| element.shape == Shape::Line);
        let points = || elements.iter().map(|element| element.start).collect::<Vec<_>>();
        let support = (elements.len() > MANY && is_polygon).then(|| Support::of(&points()));
        let mut profile = Self { elements, tree, support, perimeter_m, reference, places: Vec::new() };
        let place = |k: u32| profile.point_at(perimeter_m * f64::from(k) / f64::from(PLACES));
        profile.places = (0..PLACES).map(place).collect();
        debug_assert!(
            perimeter_m > 0.0 && perimeter_m.is_finite(),
            "a perimeter is a length: {perimeter_m} m"
        );
        Ok(profile)
    }

    /// Length of the profile's closed curve, m.
    pub fn perimeter_m(&self) -> f64 {
        self.perimeter_m
    }

    /// The point from which all of the wall is visible.
    pub fn reference(&self) -> Yz {
        self.reference
    }

    /// Whether `point` is inside the profile's curve.
    pub fn contains(&self, point: Yz) -> bool {
        let direction = sub(point, self.reference);
        if direction == [0.0, 0.0] {
            return true;
        }
        self.hit(self.reference, direction).is_some_and(|hit| hit.range_m >= 1.0)
    }

    /// Returns the point at which the ray from `origin` first leaves the profile. `direction` may have any length above
    /// zero.
    ///
    /// From inside, there is always such a point. If rounding lets a ray slip between two elements, their common vertex
    /// is used. From outside, the result is `None`.
    pub fn cast(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        if !self.contains(origin) {
            return None;
        }
        self.hit(origin, direction)
    }

    /// Casts a ray like [`Profile::cast`], but does not check that `origin` is inside.
    ///
    /// Use it for many rays from one point that is known to be inside.
    pub fn cast_from_inside(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        self.hit(origin, direction)
    }

    /// Returns the arc length of the wall in the direction of `point`, as seen from the reference point.
    ///
    /// The spacing of samples uses this arc length even where the wall differs from the design. It is zero for the
    /// reference point itself.
    pub fn arc_of(&self, point: Yz) -> f64 {
        let direction = sub(point, self.reference);
        self.hit(self.reference, direction).map_or(0.0, |hit| hit.arc_m)
    }

    /// Returns the wall point at arc length `arc_m`, modulo the perimeter.
    pub fn point_at(&self, arc_m: f64) -> Yz {
        let arc = math::wrap(arc_m, self.perimeter_m);
        let index = self.elements.partition_point(|element| element.arc_m <= arc).saturating_sub(1);
        self.elements.get(index).map_or(self.reference, |element| element.point_at(arc - element.arc_m))
    }

    /// Returns 64 wall points at equal spacing, for frequent approximate checks.
    ///
    /// The first point is the floor's centre.
    pub fn places(&self) -> &[Yz] {
        &self.places
    }

    /// Returns the clock position of an arc length to the nearest half hour.
    ///
    /// 6 is the floor's centre, 9 the left wall, 12 the crown. The position is seen from the reference point, looking
    /// along the tunnel.
    pub fn clock(&self, arc_m: f64) -> String {
        let half_hours = math::round_to_i64(2.0 * self.hour(arc_m)).rem_euclid(24);
        let hour = if half_hours / 2 == 0 { 12 } else { half_hours / 2 };
        format!("{hour}:{}", if half_hours % 2 == 0 { "00" } else { "30" })
    }

    /// Clock position of a place on the wall, hours from 0 to 12, as in [`clock`](Self::clock).
    pub fn hour(&self, arc_m: f64) -> f64 {
        let place = sub(self.point_at(arc_m), self.reference);
        // Angle as of a head: 0 is down, and angles grow to the left.
        let angle = math::wrap(math::atan2(place[0], -place[1]), TAU);
        math::wrap(angle / TAU * 12.0 + 6.0, 12.0)
    }

    /// Upper bound of the distance from `origin` to the wall, m.
    pub fn farthest_m(&self, origin: Yz) -> f64 {
        let reach = |element: &Element| match element.shape {
            Shape::Line => norm(sub(element.start, origin)),
            Shape::Arc { centre, radius_m, .. } => norm(sub(centre, origin)) + radius_m,
        };
        match &self.support {
            Some(support) => support.farthest_m(origin),
            None => self.elements.iter().map(reach).fold(0.0, f64::max),
        }
    }

    /// Returns the largest distance of the wall from a line through `origin`, m, on either side.
    ///
    /// The line is perpendicular to the unit vector `direction`. For a polygon of many points, the result may be too
    /// large. The excess is at most 12 mm per metre of the longest edge of the points' convex hull.
    pub fn farthest_along_m(&self, origin: Yz, direction: Yz) -> f64 {
        let farthest_m = |element: &Element| {
            let start_m = dot(sub(element.start, origin), direction).abs();
            let Shape::Arc { centre, radius_m, middle, cos_half, .. } = element.shape else { return start_m };
            let (centre_m, towards) = (dot(sub(centre, origin), direction), dot(middle, direction));
            // An arc is farthest from the line where its tangent is parallel to the line. There is one such point on
            // each side of the line.
            let ahead_m = if towards >= cos_half { (centre_m + radius_m).abs() } else { 0.0 };
            let astern_m = if -towards >= cos_half { (centre_m - radius_m).abs() } else { 0.0 };
            start_m.max(ahead_m).max(astern_m)
        };
        match &self.support {
            Some(support) => {
                let ahead_m = support.reach_m(origin, direction);
                ahead_m.max(support.reach_m(origin, [-direction[0], -direction[1]]))
            }
            None => self.elements.iter().map(farthest_m).fold(0.0, f64::max),
        }
    }

    /// Returns start and length of each piece, m, as arc lengths.
    ///
    /// In a polygon, the first and the last piece are parts of one edge, unless a point lies at the floor's centre.
    pub fn pieces_m(&self) -> impl ExactSizeIterator<Item = (f64, f64)> + '_ {
        self.elements.iter().map(|element| (element.arc_m, element.length_m))
    }

    /// Arc lengths, m, at which one line or arc of the profile ends and the next begins.
    #[cfg(test)]
    pub(crate) fn corners_m(&self) -> Vec<f64> {
        self.elements.iter().map(|element| element.arc_m).collect()
    }

    fn hit(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        if !(direction[0].is_finite() && direction[1].is_finite()) || direction == [0.0, 0.0] {
            return None;
        }
        let mut best: Option<(f64, usize)> = None;
        let entry = |bounds: &Bounds| bounds.entry(origin, direction);
        self.tree.search(self.elements.len(), entry, |some| {
            for (index, element) in self.elements.iter().enumerate().take(some.end).skip(some.start) {
                // If several elements are equally near, the first one along the wall is used. So the order of the
                // search does not matter.
                if let Some(t) = element.crossing(origin, direction)
                    && best.is_none_or(|nearest| (t, index) < nearest)
                {
                    best = Some((t, index));
                }
            }
            best.map_or(f64::INFINITY, |(shortest, _)| shortest)
        });
        let (t, index) = best.or_else(|| self.nearest_vertex(origin, direction))?;
        debug_assert!(t >= 0.0, "a ray from {origin:?} along {direction:?} leaves the profile ahead: {t}");
        let element = self.elements.get(index)?;
        let point = [origin[0] + t * direction[0], origin[1] + t * direction[1]];
        let along = element.along(point).clamp(0.0, element.length_m);
        Some(WallHit {
            range_m: t,
            arc_m: math::wrap(element.arc_m + along, self.perimeter_m),
            point,
            normal: element.normal(point),
        })
    }

    /// Returns the vertex nearest to a ray that has slipped between two elements through rounding.
    fn nearest_vertex(&self, origin: Yz, direction: Yz) -> Option<(f64, usize)> {
        let length2 = dot(direction, direction);
        let ahead = |(index, element): (usize, &Element)| {
            let to = sub(element.start, origin);
            let along = dot(to, direction);
            (along > 0.0).then(|| ((cross(direction, to) / along).abs(), along / length2, index))
        };
        let nearest =
            self.elements.iter().enumerate().filter_map(ahead).min_by(|a, b| a.0.total_cmp(&b.0))?;
        (nearest.0 < 1e-6).then_some((nearest.1, nearest.2))
    }
}

/// Checks that all of the wall is visible from the reference point. Each element comes with the index of its piece.
fn check_star_shaped<'a>(
    elements: impl Iterator<Item = (&'a Element, usize)>,
    reference: Yz,
) -> Result<(), ProfileError> {
    let mut turned = 0.0;
    for (element, vertex) in elements {
        match element.angle_about(reference) {
            Some(angle) => turned += angle,
            None => return Err(ProfileError::NotStarShaped { vertex, reference }),
        }
    }
    let turns = math::round_to_i64(turned / TAU);
    if turns == 1 { Ok(()) } else { Err(ProfileError::Winding { turns, reference }) }
}

#[cfg(test)]
mod tests;
