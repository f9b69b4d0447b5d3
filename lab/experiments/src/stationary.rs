//! Perimeter of the cross-section from a turn of a stationary vehicle, with a beam of finite width (Jorge et al. 2021,
//! §9.2).

use headrace_geometry::math::{self, PI, TAU};
use headrace_geometry::tunnel::shapes;
use serde::Serialize;

use crate::ExperimentError;
use crate::perimeter::{self, Ping, Settings};

/// Width of the beam at 1 MHz, degrees.
const BEAM_DEG: f64 = 1.4;
/// Number of rays per simulated beam.
const RAYS: i32 = 61;
/// Number of pings per turn in mode SLOW.
const PINGS: i32 = 1200;
/// Perimeter measured in the paper, m.
const PAPER_M: f64 = 33.09;

/// The perimeter by several methods, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Perimeter {
    /// Perimeter of the blueprint's profile.
    pub nominal_m: f64,
    /// Perimeter measured in the paper.
    pub paper_m: f64,
    /// Perimeter by the paper's method: the skeleton of the echo image, with steps of 1 or sqrt 2 pixels.
    pub skeleton_m: f64,
    /// Perimeter by the same skeleton, with lengths corrected for the staircase of pixels.
    pub skeleton_smooth_m: f64,
    /// Perimeter of a polygon through the first return of each beam.
    pub first_returns_m: f64,
    /// Perimeter of a polygon through the mean range of each beam.
    pub mean_ranges_m: f64,
    /// Perimeter of a polygon through the hits of ideal rays, without beam width.
    pub rays_m: f64,
}

/// Computes the perimeter on the blueprint's profile.
///
/// Errors: none in practice.
pub(crate) fn perimeter() -> Result<Perimeter, ExperimentError> {
    let profile = shapes::ceran_blueprint()?;
    let centre = profile.reference();
    let range_m = |angle_rad: f64| {
        let (sin, cos) = math::sin_cos(angle_rad);
        profile.cast_from_inside(centre, [sin, -cos]).map_or(0.0, |hit| hit.range_m)
    };
    // Rays are spread evenly over the beam's disc. Rays tilted ahead or astern have longer ranges to the same wall.
    let golden_rad = PI * (3.0 - math::sqrt(5.0));
    let cone = |angle_rad: f64| -> Vec<f64> {
        let ray = |number: i32| {
            let radius =
                math::sqrt((f64::from(number) + 0.5) / f64::from(RAYS)) * f64::to_radians(BEAM_DEG) / 2.0;
            let (sin, cos) = math::sin_cos(golden_rad * f64::from(number));
            let (ahead, aside) = (radius * cos, radius * sin);
            range_m(angle_rad + aside) / math::cos(ahead)
        };
        (0..RAYS).map(ray).collect()
    };
    let pings: Vec<Ping> = (0..PINGS)
        .map(|number| {
            let angle_rad = TAU * f64::from(number) / f64::from(PINGS);
            Ping { angle_rad, ranges_m: cone(angle_rad) }
        })
        .collect();
    let rays: Vec<(f64, f64)> = pings.iter().map(|ping| (ping.angle_rad, range_m(ping.angle_rad))).collect();
    let chain = perimeter::skeleton(&pings, &Settings::of_paper())?;
    Ok(Perimeter {
        nominal_m: profile.perimeter_m(),
        paper_m: PAPER_M,
        skeleton_m: chain.steps_m,
        skeleton_smooth_m: chain.corrected_m,
        first_returns_m: perimeter::polygon_m(&perimeter::least_ranges(&pings))?,
        mean_ranges_m: perimeter::polygon_m(&perimeter::mean_ranges(&pings))?,
        rays_m: perimeter::polygon_m(&rays)?,
    })
}
