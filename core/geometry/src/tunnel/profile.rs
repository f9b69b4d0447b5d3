//! A tunnel's design profile: a closed curve of straight lines and arcs, with exact ray casting.

use crate::math::{self, TAU};

mod nearest;

pub use nearest::Nearest;

/// A point in the cross-section: y left, z up, metres.
pub type Yz = [f64; 2];

/// Points closer together than this are the same, m.
const SAME_POINT_M: f64 = 1e-9;
/// Angle by which a hit may lie beyond an arc's end, rad, so that neighbours leave no gap between them.
const ARC_SLACK_RAD: f64 = 1e-12;
/// Margin beyond which a hit is clearly within or clearly outside an arc: difference between its cosine about the arc's
/// middle and that of the ends; far larger than the slack and rounding together.
const CLEAR: f64 = 1e-9;

/// One piece of a profile, as given; pieces run counter-clockwise with y to the right and z up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Piece {
    /// A straight line to this point.
    LineTo(Yz),
    /// An arc about `centre` through `sweep_rad` > 0 (polar angle grows, so that it bulges outwards).
    Arc {
        /// Centre of its circle.
        centre: Yz,
        /// Angle turned about the centre.
        sweep_rad: f64,
    },
}

/// A design profile. Arc length grows from the floor's centre via the left wall, in [0, perimeter).
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    elements: Vec<Element>,
    perimeter_m: f64,
    reference: Yz,
}

/// Intersection of a ray with the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallHit {
    /// Ray parameter; the distance in metres when the direction has length one.
    pub range_m: f64,
    /// Arc length of the point, m.
    pub arc_m: f64,
    /// The point.
    pub point: Yz,
    /// Unit normal there, pointing inwards.
    pub normal: Yz,
}

/// Why a profile is rejected.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ProfileError {
    /// Fewer than three distinct points.
    #[error("a profile needs at least 3 distinct points; this one has {count}")]
    TooFewPoints {
        /// Distinct points.
        count: usize,
    },
    /// A coordinate isn't finite, or exceeds 1000 m.
    #[error("vertex {vertex} has a coordinate that is no number within 1000 m")]
    NotFinite {
        /// Index of the vertex, from zero.
        vertex: usize,
    },
    /// From the reference point, the wall at this vertex is hidden or runs backwards.
    #[error(
        "the profile isn't star-shaped about ({y}, {z}): it runs backwards or crosses itself at vertex {vertex}",
        y = .reference[0], z = .reference[1]
    )]
    NotStarShaped {
        /// Index of the vertex at which the offending element begins.
        vertex: usize,
        /// The reference point.
        reference: Yz,
    },
    /// The curve doesn't wind about its reference point exactly once.
    #[error("the profile winds {turns} times about ({y}, {z}); it must do so once", y = .reference[0], z = .reference[1])]
    Winding {
        /// Number of turns.
        turns: i64,
        /// The reference point.
        reference: Yz,
    },
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Element {
    start: Yz,
    end: Yz,
    arc_m: f64,
    length_m: f64,
    shape: Shape,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    Line,
    /// `middle` is the unit vector to the arc's middle, `cos_half` the cosine of half its sweep.
    Arc {
        centre: Yz,
        radius_m: f64,
        from_rad: f64,
        sweep_rad: f64,
        middle: Yz,
        cos_half: f64,
    },
}

impl Profile {
    /// A closed curve that begins at `start`, the floor's centre, and runs counter-clockwise (y right, z up) through
    /// `pieces` back to it. All of the wall must be visible from `reference`.
    ///
    /// Errors: see [`ProfileError`].
    /// Allocates: startup only.
    pub fn new(start: Yz, pieces: &[Piece], reference: Yz) -> Result<Self, ProfileError> {
        let mut elements = Vec::new();
        let mut at = start;
        for (vertex, piece) in pieces.iter().enumerate() {
            let element = build(at, *piece);
            if !element.end.iter().all(|c| c.abs() <= 1000.0) {
                return Err(ProfileError::NotFinite { vertex });
            }
            if element.length_m > SAME_POINT_M {
                at = element.end;
                elements.push(element);
            }
        }
        let closing = build(at, Piece::LineTo(start));
        if closing.length_m > SAME_POINT_M {
            elements.push(closing);
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
        let profile = Self { elements, perimeter_m, reference };
        profile.check_star_shaped()?;
        Ok(profile)
    }

    /// A polygon through `points`, in either sense of rotation; arc length begins at the lowest crossing of y = 0.
    /// `reference` defaults to the polygon's centroid.
    ///
    /// Errors: see [`ProfileError`]; also when the polygon never crosses y = 0.
    /// Allocates: startup only.
    pub fn polygon(points: &[Yz], reference: Option<Yz>) -> Result<Self, ProfileError> {
        if let Some(vertex) = points.iter().position(|p| !p.iter().all(|c| c.abs() <= 1000.0)) {
            return Err(ProfileError::NotFinite { vertex });
        }
        let mut ring = distinct(points);
        if ring.len() < 3 {
            return Err(ProfileError::TooFewPoints { count: ring.len() });
        }
        let (area, centroid) = area_and_centroid(&ring);
        if area < 0.0 {
            ring.reverse();
        }
        let reference = reference.unwrap_or(centroid);
        let (edge, start) = floor_centre(&ring).ok_or(ProfileError::Winding { turns: 0, reference })?;
        let count = ring.len();
        let pieces: Vec<Piece> =
            (1..=count).filter_map(|k| ring.get((edge + k) % count)).map(|p| Piece::LineTo(*p)).collect();
        Self::new(start, &pieces, reference)
    }

    /// Length of the closed curve, m.
    pub fn perimeter_m(&self) -> f64 {
        self.perimeter_m
    }

    /// The point from which all of the wall is visible.
    pub fn reference(&self) -> Yz {
        self.reference
    }

    /// Whether `point` is inside the curve.
    pub fn contains(&self, point: Yz) -> bool {
        let direction = sub(point, self.reference);
        if direction == [0.0, 0.0] {
            return true;
        }
        self.hit(self.reference, direction).is_some_and(|hit| hit.range_m >= 1.0)
    }

    /// First exit from the profile of the ray from `origin` along `direction` (any non-zero length).
    ///
    /// From inside there is always one: where rounding lets a ray slip between two elements, their common vertex is
    /// used. From outside: `None`.
    pub fn cast(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        if !self.contains(origin) {
            return None;
        }
        self.hit(origin, direction)
    }

    /// [`Profile::cast`] without its test of `origin`, for many rays from one point known to be inside.
    pub fn cast_from_inside(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        self.hit(origin, direction)
    }

    /// Arc length of the wall seen from the reference point in the direction of `point`: the coordinate for spacing
    /// when the wall differs from the design. Zero for the reference point itself.
    pub fn arc_of(&self, point: Yz) -> f64 {
        let direction = sub(point, self.reference);
        self.hit(self.reference, direction).map_or(0.0, |hit| hit.arc_m)
    }

    /// Wall point at arc length `arc_m`, taken modulo the perimeter.
    pub fn point_at(&self, arc_m: f64) -> Yz {
        let arc = math::wrap(arc_m, self.perimeter_m);
        let index = self.elements.partition_point(|element| element.arc_m <= arc).saturating_sub(1);
        self.elements.get(index).map_or(self.reference, |element| element.point_at(arc - element.arc_m))
    }

    /// Clock position of an arc length, seen from the reference point looking along the tunnel, to the nearest half
    /// hour: 6 is the floor's centre, 9 the left wall, 12 the crown.
    pub fn clock(&self, arc_m: f64) -> String {
        let place = sub(self.point_at(arc_m), self.reference);
        // Head angle: 0 down, growing to the left.
        let angle = math::wrap(math::atan2(place[0], -place[1]), TAU);
        let half_hours = math::round_to_i64(angle / TAU * 24.0) + 12;
        let half_hours = half_hours.rem_euclid(24);
        let hour = if half_hours / 2 == 0 { 12 } else { half_hours / 2 };
        format!("{hour}:{}", if half_hours % 2 == 0 { "00" } else { "30" })
    }

    /// Upper bound of the distance from `origin` to the wall, m.
    pub fn farthest_m(&self, origin: Yz) -> f64 {
        let reach = |element: &Element| match element.shape {
            Shape::Line => norm(sub(element.start, origin)),
            Shape::Arc { centre, radius_m, .. } => norm(sub(centre, origin)) + radius_m,
        };
        self.elements.iter().map(reach).fold(0.0, f64::max)
    }

    /// Largest distance, m, of the wall from a line through `origin` across the unit vector `direction`, on either side.
    pub fn farthest_along_m(&self, origin: Yz, direction: Yz) -> f64 {
        let farthest_m = |element: &Element| {
            let start_m = dot(sub(element.start, origin), direction).abs();
            let Shape::Arc { centre, radius_m, middle, cos_half, .. } = element.shape else { return start_m };
            let (centre_m, towards) = (dot(sub(centre, origin), direction), dot(middle, direction));
            // Where the arc's tangent runs across the direction, on this side or the other.
            let ahead_m = if towards >= cos_half { (centre_m + radius_m).abs() } else { 0.0 };
            let astern_m = if -towards >= cos_half { (centre_m - radius_m).abs() } else { 0.0 };
            start_m.max(ahead_m).max(astern_m)
        };
        self.elements.iter().map(farthest_m).fold(0.0, f64::max)
    }

    /// Arc lengths of the element boundaries, m.
    #[cfg(test)]
    pub(crate) fn corners_m(&self) -> Vec<f64> {
        self.elements.iter().map(|element| element.arc_m).collect()
    }

    fn hit(&self, origin: Yz, direction: Yz) -> Option<WallHit> {
        if !(direction[0].is_finite() && direction[1].is_finite()) || direction == [0.0, 0.0] {
            return None;
        }
        let mut best: Option<(f64, usize)> = None;
        for (index, element) in self.elements.iter().enumerate() {
            if let Some(t) = element.crossing(origin, direction)
                && best.is_none_or(|(shortest, _)| t < shortest)
            {
                best = Some((t, index));
            }
        }
        let (t, index) = best.or_else(|| self.nearest_vertex(origin, direction))?;
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

    /// For a ray that slipped between two elements: the vertex ahead that is nearest to the ray.
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

    fn check_star_shaped(&self) -> Result<(), ProfileError> {
        let reference = self.reference;
        let mut turned = 0.0;
        for (vertex, element) in self.elements.iter().enumerate() {
            match element.angle_about(reference) {
                Some(angle) => turned += angle,
                None => return Err(ProfileError::NotStarShaped { vertex, reference }),
            }
        }
        let turns = math::round_to_i64(turned / TAU);
        if turns == 1 { Ok(()) } else { Err(ProfileError::Winding { turns, reference }) }
    }
}

impl Element {
    /// Ray parameter where the ray leaves the profile through this element.
    fn crossing(&self, origin: Yz, direction: Yz) -> Option<f64> {
        let (start, end) = (sub(self.start, origin), sub(self.end, origin));
        match self.shape {
            Shape::Line => {
                // A ray leaves with the start on its right and the end on its left. The half-open test uses the same
                // product for the vertex shared by two elements, so that exactly one of them is hit.
                let (right, left) = (cross(direction, start), cross(direction, end));
                if !(right <= 0.0 && left > 0.0) {
                    return None;
                }
                let t = cross(start, sub(self.end, self.start)) / (left - right);
                (t >= 0.0).then_some(t)
            }
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, middle, cos_half } => {
                let offset = sub(origin, centre);
                let a = dot(direction, direction);
                let b = dot(direction, offset);
                let c = dot(offset, offset) - radius_m * radius_m;
                let discriminant = b * b - a * c;
                if discriminant < 0.0 {
                    return None;
                }
                let root = math::sqrt(discriminant);
                let t = if b > 0.0 { -c / (b + root) } else { (root - b) / a };
                if t < 0.0 {
                    return None;
                }
                let hit = [offset[0] + t * direction[0], offset[1] + t * direction[1]];
                let lean = dot(hit, middle) / radius_m - cos_half;
                if lean.abs() > CLEAR {
                    return (lean > 0.0).then_some(t);
                }
                let turned = math::wrap(math::atan2(hit[1], hit[0]) - from_rad, TAU);
                let within = turned <= sweep_rad + ARC_SLACK_RAD || turned >= TAU - ARC_SLACK_RAD;
                within.then_some(t)
            }
        }
    }

    /// Arc length from the element's start to `point` on it.
    fn along(&self, point: Yz) -> f64 {
        match self.shape {
            Shape::Line => norm(sub(point, self.start)),
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, .. } => {
                let from_centre = sub(point, centre);
                let turned = math::wrap(math::atan2(from_centre[1], from_centre[0]) - from_rad, TAU);
                // Just past the end means slightly before the start.
                let turned = if turned > sweep_rad + ARC_SLACK_RAD { 0.0 } else { turned };
                radius_m * turned
            }
        }
    }

    fn point_at(&self, along_m: f64) -> Yz {
        match self.shape {
            Shape::Line => {
                let share = along_m / self.length_m;
                let along = sub(self.end, self.start);
                [self.start[0] + share * along[0], self.start[1] + share * along[1]]
            }
            Shape::Arc { centre, radius_m, from_rad, .. } => {
                let (sin, cos) = math::sin_cos(from_rad + along_m / radius_m);
                [centre[0] + radius_m * cos, centre[1] + radius_m * sin]
            }
        }
    }

    fn normal(&self, point: Yz) -> Yz {
        let outwards = match self.shape {
            Shape::Line => {
                let along = sub(self.end, self.start);
                [along[1], -along[0]]
            }
            Shape::Arc { centre, .. } => sub(point, centre),
        };
        let length = norm(outwards);
        [-outwards[0] / length, -outwards[1] / length]
    }

    /// Angle that this element spans about `reference`, or `None` where it runs backwards anywhere.
    fn angle_about(&self, reference: Yz) -> Option<f64> {
        let (start, end) = (sub(self.start, reference), sub(self.end, reference));
        match self.shape {
            Shape::Line => {
                let angle = math::atan2(cross(start, end), dot(start, end));
                (angle > 0.0).then_some(angle)
            }
            Shape::Arc { centre, radius_m, from_rad, sweep_rad, .. } => {
                // On the arc, forwards means (centre - reference) . e(theta) + radius > 0; checked at 256 steps.
                let shift = sub(centre, reference);
                let steps = 256;
                let mut angle = 0.0;
                let mut before = start;
                for step in 1..=steps {
                    let theta = from_rad + sweep_rad * f64::from(step) / f64::from(steps);
                    let (sin, cos) = math::sin_cos(theta);
                    if shift[0] * cos + shift[1] * sin + radius_m <= 0.0 {
                        return None;
                    }
                    let here = [shift[0] + radius_m * cos, shift[1] + radius_m * sin];
                    angle += math::atan2(cross(before, here), dot(before, here));
                    before = here;
                }
                Some(angle)
            }
        }
    }
}

fn build(start: Yz, piece: Piece) -> Element {
    match piece {
        Piece::LineTo(end) => {
            Element { start, end, arc_m: 0.0, length_m: norm(sub(end, start)), shape: Shape::Line }
        }
        Piece::Arc { centre, sweep_rad } => {
            let from_centre = sub(start, centre);
            let radius_m = norm(from_centre);
            let from_rad = math::atan2(from_centre[1], from_centre[0]);
            let (sin, cos) = math::sin_cos(from_rad + sweep_rad);
            let end = [centre[0] + radius_m * cos, centre[1] + radius_m * sin];
            let (sin_middle, cos_middle) = math::sin_cos(from_rad + sweep_rad / 2.0);
            let middle = [cos_middle, sin_middle];
            let cos_half = math::cos(sweep_rad / 2.0);
            let shape = Shape::Arc { centre, radius_m, from_rad, sweep_rad, middle, cos_half };
            Element { start, end, arc_m: 0.0, length_m: radius_m * sweep_rad, shape }
        }
    }
}

/// The points without repeats of their predecessor (the first follows the last).
fn distinct(points: &[Yz]) -> Vec<Yz> {
    let mut ring: Vec<Yz> = Vec::with_capacity(points.len());
    for point in points {
        if ring.last().is_none_or(|last| norm(sub(*point, *last)) > SAME_POINT_M) {
            ring.push(*point);
        }
    }
    while let (Some(first), Some(last)) = (ring.first(), ring.last())
        && ring.len() > 1
        && norm(sub(*first, *last)) <= SAME_POINT_M
    {
        ring.pop();
    }
    ring
}

/// Signed area and centroid of a polygon.
fn area_and_centroid(ring: &[Yz]) -> (f64, Yz) {
    let origin = ring.first().copied().unwrap_or_default();
    let (mut area2, mut sum) = (0.0, [0.0, 0.0]);
    for (a, b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
        let (a, b) = (sub(*a, origin), sub(*b, origin));
        let w = cross(a, b);
        area2 += w;
        sum = [sum[0] + w * (a[0] + b[0]), sum[1] + w * (a[1] + b[1])];
    }
    let centroid = if area2 == 0.0 {
        origin
    } else {
        [origin[0] + sum[0] / (3.0 * area2), origin[1] + sum[1] / (3.0 * area2)]
    };
    (area2 / 2.0, centroid)
}

/// The lowest crossing of y = 0: index of the edge's first point, and the crossing.
fn floor_centre(ring: &[Yz]) -> Option<(usize, Yz)> {
    let crossing = |(index, (a, b)): (usize, (&Yz, &Yz))| {
        if (a[0] <= 0.0) == (b[0] <= 0.0) {
            return None;
        }
        let share = -a[0] / (b[0] - a[0]);
        Some((index, [0.0, a[1] + share * (b[1] - a[1])]))
    };
    ring.iter()
        .zip(ring.iter().cycle().skip(1))
        .enumerate()
        .filter_map(crossing)
        .min_by(|a, b| a.1[1].total_cmp(&b.1[1]))
}

fn sub(a: Yz, b: Yz) -> Yz {
    [a[0] - b[0], a[1] - b[1]]
}

fn dot(a: Yz, b: Yz) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

fn cross(a: Yz, b: Yz) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

fn norm(a: Yz) -> f64 {
    math::sqrt(dot(a, a))
}
