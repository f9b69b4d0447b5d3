//! Largest empty circles on an unrolled wall, from all samples at once.
//!
//! Candidate centres are the Voronoi vertices of a Delaunay triangulation with exact predicates, and the points where
//! Voronoi edges cross the ends of a section. Unlike the program, it uses no cells and no search radius.

use headrace_geometry::math;
use spade::{DelaunayTriangulation, HasPosition, Point2, Triangulation};

use crate::error::TruthError;

/// Coordinates smaller than this are set to zero, because the exact predicates accept no nonzero value below 1e-142.
const TINY_M: f64 = 1e-100;
/// Largest rounding error of a circumradius or a circumcentre, m.
const ROUNDING_M: f64 = 1e-6;

/// A place on the unrolled wall: chainage and arc length, m.
pub type Place = [f64; 2];

#[derive(Clone, Copy)]
struct Vertex(Point2<f64>);

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.0
    }
}

/// An empty circle on the unrolled wall: it contains no samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Centre of the circle: chainage and arc length, m.
    pub centre: Place,
    /// Radius of the circle, m.
    pub radius_m: f64,
}

/// All samples of a dive on a wall with cyclic arc length. The default has no samples.
#[derive(Default)]
pub struct Wall {
    perimeter_m: f64,
    samples: Vec<Place>,
    /// The samples, and copies of them one perimeter before and one perimeter after, sorted by arc length.
    images: Vec<Place>,
    /// Empty circles through three samples, the largest first.
    circles: Vec<Circle>,
}

impl Wall {
    /// Builds the wall from samples (chainage and arc length, m) on this perimeter, m.
    ///
    /// Errors: a coordinate isn't a number, or is too large for any wall.
    pub fn new(samples: impl IntoIterator<Item = Place>, perimeter_m: f64) -> Result<Self, TruthError> {
        let samples: Vec<Place> =
            samples.into_iter().map(|[x, sigma]| [x, math::wrap(sigma, perimeter_m)]).collect();
        let shifted = |by_m: f64| samples.iter().map(move |[x, sigma]| [*x, sigma + by_m]);
        let mut images: Vec<Place> = [-perimeter_m, 0.0, perimeter_m].into_iter().flat_map(shifted).collect();
        images.sort_unstable_by(|a, b| a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0])));
        images.dedup();
        let circles = circles(&images, perimeter_m)?;
        Ok(Self { perimeter_m, samples, images, circles })
    }

    /// Distance from a place to the nearest sample, m; infinite without samples.
    pub fn clear_m(&self, [x, sigma]: Place) -> f64 {
        let distance = |sample: &Place| {
            math::hypot(sample[0] - x, math::wrap_signed(sample[1] - sigma, self.perimeter_m))
        };
        self.samples.iter().map(distance).fold(f64::INFINITY, f64::min)
    }

    /// The largest empty circle with its centre between two chainages; `None` without samples.
    pub fn largest(&self, from_m: f64, to_m: f64) -> Option<Circle> {
        let ends = [self.largest_on(from_m)?, self.largest_on(to_m)?];
        let mut best = if ends[0].radius_m >= ends[1].radius_m { ends[0] } else { ends[1] };
        for circle in self.circles.iter().filter(|circle| (from_m..to_m).contains(&circle.centre[0])) {
            if circle.radius_m + ROUNDING_M < best.radius_m {
                break;
            }
            let radius_m = self.clear_m(circle.centre);
            if radius_m > best.radius_m {
                best = Circle { radius_m, ..*circle };
            }
        }
        Some(best)
    }

    /// Hole diameter D of a stretch between two chainages, m: the diameter of the stretch's largest empty circle. It is
    /// infinite without samples.
    pub fn hole_m(&self, from_m: f64, to_m: f64) -> f64 {
        self.largest(from_m, to_m).map_or(f64::INFINITY, |circle| 2.0 * circle.radius_m)
    }

    /// The largest empty circle with its centre at one chainage. Its centre is equally far from two samples, at the
    /// highest point of the lower envelope of the distances to all samples.
    pub fn largest_on(&self, x_m: f64) -> Option<Circle> {
        // As functions of arc length, the squared distances to the samples are parabolas of the same shape. Each pair
        // of them therefore crosses once.
        let mut envelope: Vec<(f64, f64)> = Vec::new();
        let crossing = |left: &(f64, f64), right: &(f64, f64)| {
            0.5 * (left.0 + right.0) + (right.1 - left.1) / (2.0 * (right.0 - left.0))
        };
        for [x, sigma] in &self.images {
            let next = (*sigma, (x - x_m) * (x - x_m));
            if let Some(last) = envelope.last().filter(|last| last.0 >= next.0) {
                if last.1 <= next.1 {
                    continue;
                }
                envelope.pop();
            }
            while let [.., before, last] = envelope.as_slice()
                && crossing(last, &next) <= crossing(before, last)
            {
                envelope.pop();
            }
            envelope.push(next);
        }
        let highest = envelope
            .windows(2)
            .map(|pair| {
                let sigma = crossing(&pair[0], &pair[1]);
                (sigma, (sigma - pair[0].0) * (sigma - pair[0].0) + pair[0].1)
            })
            .filter(|(sigma, _)| (-ROUNDING_M..self.perimeter_m + ROUNDING_M).contains(sigma))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let sigma = math::wrap(highest?.0, self.perimeter_m);
        Some(Circle { centre: [x_m, sigma], radius_m: self.clear_m([x_m, sigma]) })
    }
}

/// Circumcircles of a Delaunay triangulation, limited to those with a centre on the wall. The largest comes first.
fn circles(images: &[Place], perimeter_m: f64) -> Result<Vec<Circle>, TruthError> {
    let tidy = |value: f64| if value.abs() < TINY_M { 0.0 } else { value };
    let vertices = images.iter().map(|[x, sigma]| Vertex(Point2::new(tidy(*x), tidy(*sigma)))).collect();
    let refused = |why: spade::InsertionError| {
        let what = format!("{} places on a wall", images.len());
        TruthError::Oracle { what, why: why.to_string() }
    };
    let triangles: DelaunayTriangulation<Vertex> =
        DelaunayTriangulation::bulk_load(vertices).map_err(refused)?;
    let mut circles: Vec<Circle> = triangles
        .inner_faces()
        .filter_map(|face| circle(face.positions().map(|at| [at.x, at.y])))
        // Where arc length jumps from the perimeter to 0, rounding may move the centre of a circle to either side of
        // the jump. The tolerance keeps at least one of two circles: the circle itself, or its copy on the other side.
        .filter(|circle| (-ROUNDING_M..perimeter_m + ROUNDING_M).contains(&circle.centre[1]))
        .map(|Circle { centre: [x, sigma], radius_m }| Circle {
            centre: [x, math::wrap(sigma, perimeter_m)],
            radius_m,
        })
        .collect();
    circles.sort_unstable_by(|a, b| b.radius_m.total_cmp(&a.radius_m));
    Ok(circles)
}

/// The circle through three places; `None` if the places are collinear within rounding.
fn circle([a, b, c]: [Place; 3]) -> Option<Circle> {
    let [b, c] = [b, c].map(|p| [p[0] - a[0], p[1] - a[1]]);
    let [bb, cc] = [b, c].map(|p| p[0] * p[0] + p[1] * p[1]);
    let twice = 2.0 * (b[0] * c[1] - b[1] * c[0]);
    let centre = [(c[1] * bb - b[1] * cc) / twice, (b[0] * cc - c[0] * bb) / twice];
    let radius_m = math::hypot(centre[0], centre[1]);
    radius_m.is_finite().then(|| Circle { centre: [a[0] + centre[0], a[1] + centre[1]], radius_m })
}
