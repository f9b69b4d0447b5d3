//! Deviations from the design, interpolated on the unrolled wall: linearly over the Delaunay triangles of the samples.

use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;
use spade::{DelaunayTriangulation, FloatTriangulation, HasPosition, Point2, Triangulation};

use super::Xyz;
use super::wall::Stretch;
use crate::Spread;

/// Coordinates closer to zero than this become zero, because the triangulation's exact predicates refuse values below
/// 1e-142.
const TINY_M: f64 = 1e-100;

/// A sample on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Deviation {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length at which the ray from the reference point through the sample meets the design wall, m.
    pub arc_m: f64,
    /// Distance of the sample beyond the design wall, along the ray from the reference point, m.
    pub deviation_m: f64,
}

impl Deviation {
    /// The deviation of a position in the tunnel from the design wall.
    pub(crate) fn of(profile: &Profile, place: Xyz) -> Self {
        let centre = profile.reference();
        let direction = [place[1] - centre[0], place[2] - centre[1]];
        let length_m = math::hypot(direction[0], direction[1]);
        let hit = profile.cast_from_inside(centre, direction);
        // The profile returns the range in units of the direction's length.
        let (arc_m, wall_m) = hit.map_or((0.0, 0.0), |hit| (hit.arc_m, hit.range_m * length_m));
        Self { x_m: place[0], arc_m, deviation_m: length_m - wall_m }
    }
}

#[derive(Debug, Clone, Copy)]
struct Vertex {
    at: Point2<f64>,
    deviation_m: f64,
}

impl HasPosition for Vertex {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// A reason why samples can't be triangulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the samples can't be triangulated: {why}")]
pub struct ChartError {
    why: String,
}

/// The wall interpolated between samples.
pub(crate) struct Chart {
    triangles: DelaunayTriangulation<Vertex>,
    perimeter_m: f64,
}

/// Differences of the interpolated wall from the true wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ChartSpread {
    /// Absolute differences, measured along rays from the reference point.
    pub spread: Spread,
    /// Number of positions outside the samples' hull, which have no interpolated value.
    pub uncovered: usize,
}

impl Chart {
    /// Triangulates samples. If two samples have the same position, the later one is used.
    ///
    /// Errors: a coordinate that isn't finite, or is beyond 1e60.
    pub(crate) fn new(perimeter_m: f64, samples: &[Deviation]) -> Result<Self, ChartError> {
        let vertices = samples.iter().flat_map(|s| images(perimeter_m, s)).collect();
        let triangles = DelaunayTriangulation::bulk_load(vertices);
        let triangles = triangles.map_err(|why| ChartError { why: why.to_string() })?;
        Ok(Self { triangles, perimeter_m })
    }

    /// The wall's deviation at (x, arc length), m; `None` outside the samples' hull.
    pub(crate) fn deviation_m(&self, x_m: f64, arc_m: f64) -> Option<f64> {
        let at = Point2::new(plain(x_m), plain(math::wrap(arc_m, self.perimeter_m)));
        self.triangles.barycentric().interpolate(|vertex| vertex.data().deviation_m, at)
    }

    /// Differences from the true wall over a stretch. `reference` returns the true deviation at (x, arc length), m.
    pub(crate) fn compare(&self, stretch: &Stretch, reference: impl Fn(f64, f64) -> f64) -> ChartSpread {
        let mut uncovered = 0;
        let differences = stretch.places(self.perimeter_m).filter_map(|(x, sigma)| {
            let here = self.deviation_m(x, sigma);
            uncovered += usize::from(here.is_none());
            here.map(|deviation| deviation - reference(x, sigma))
        });
        let spread = Spread::of(differences);
        ChartSpread { spread, uncovered }
    }
}

/// The sample and its periodic image on the other side of the seam.
///
/// The images extend the wall by half a perimeter on either side. No triangle bridges such a wide gap.
fn images(perimeter_m: f64, sample: &Deviation) -> [Vertex; 2] {
    let sigma = math::wrap(sample.arc_m, perimeter_m);
    let other = if sigma < perimeter_m / 2.0 { sigma + perimeter_m } else { sigma - perimeter_m };
    [sigma, other].map(|sigma| Vertex {
        at: Point2::new(plain(sample.x_m), plain(sigma)),
        deviation_m: sample.deviation_m,
    })
}

fn plain(coordinate: f64) -> f64 {
    if coordinate.abs() < TINY_M { 0.0 } else { coordinate }
}

#[cfg(test)]
mod tests {
    use super::super::wall;
    use super::*;
    use headrace_geometry::tunnel::shapes;

    fn lattice(perimeter_m: f64, value: impl Fn(f64, f64) -> f64) -> Vec<Deviation> {
        let at = |i: i32, k: i32| {
            let (x, s) = (f64::from(i) * 0.5, f64::from(k) / 40.0 * perimeter_m);
            Deviation { x_m: x, arc_m: s, deviation_m: value(x, s) }
        };
        (0..=20).flat_map(|i| (0..40).map(move |k| (i, k))).map(|(i, k)| at(i, k)).collect()
    }

    #[test]
    fn deviation_linear_in_chainage_is_interpolated_exactly_across_the_seam() {
        let chart = Chart::new(20.0, &lattice(20.0, |x, _| 0.1 * x - 0.3)).unwrap();
        let stretch = Stretch { from_m: 0.0, to_m: 10.0, step_m: 0.07 };
        let compared = chart.compare(&stretch, |x, _| 0.1 * x - 0.3);
        assert_eq!(compared.uncovered, 0);
        assert!(compared.spread.max_m < 1e-12, "{compared:?}");
    }

    #[test]
    fn interpolation_error_of_a_wavy_wall_is_near_its_theoretical_bound() {
        let wave = |_: f64, s: f64| 0.2 * math::sin(s / 20.0 * math::TAU);
        let chart = Chart::new(20.0, &lattice(20.0, wave)).unwrap();
        let stretch = Stretch { from_m: 0.0, to_m: 10.0, step_m: 0.05 };
        let compared = chart.compare(&stretch, wave);
        // The interpolation error is at most f'' s^2 / 8: f'' is the second derivative, s the step of half a metre.
        let bound = 0.2 * (math::TAU / 20.0) * (math::TAU / 20.0) * 0.25 / 8.0;
        assert!(compared.spread.max_m < bound * 1.01 && compared.spread.max_m > bound * 0.8, "{compared:?}");
    }

    #[test]
    fn boulder_between_samples_counts_as_an_error_of_its_full_height() {
        let chart = Chart::new(20.0, &lattice(20.0, |_, _| 0.0)).unwrap();
        let boulder = |x: f64, s: f64| if math::hypot(x - 5.25, s - 10.25) < 0.2 { -0.3 } else { 0.0 };
        let compared = chart.compare(&Stretch { from_m: 1.0, to_m: 9.0, step_m: 0.05 }, boulder);
        assert!((compared.spread.max_m - 0.3).abs() < 1e-12);
    }

    #[test]
    fn position_made_with_a_deviation_has_that_deviation() {
        let profile = shapes::ceran_blueprint().unwrap();
        for k in 0..300 {
            let (sigma, off) = (f64::from(k) * 0.113, math::sin(f64::from(k)) * 0.4);
            let there = Deviation::of(&profile, wall::place(&profile, 3.0, sigma, off));
            assert!((there.deviation_m - off).abs() < 1e-9, "{there:?}");
            assert!(math::wrap_signed(there.arc_m - sigma, profile.perimeter_m()).abs() < 1e-9);
        }
    }

    #[test]
    fn chart_has_no_value_outside_its_samples() {
        let chart = Chart::new(20.0, &lattice(20.0, |_, _| 1.0)).unwrap();
        assert_eq!(chart.deviation_m(-0.1, 3.0), None);
        assert_eq!(Chart::new(20.0, &[]).unwrap().deviation_m(1.0, 1.0), None);
        let twin = Deviation { x_m: 1e-200, arc_m: -1e-200, deviation_m: 2.0 };
        let one = Chart::new(20.0, &[twin; 5]).unwrap();
        assert_eq!(one.deviation_m(5.0, 5.0), None);
        let bad = Deviation { x_m: f64::NAN, ..twin };
        assert!(Chart::new(20.0, &[bad]).is_err());
    }
}
