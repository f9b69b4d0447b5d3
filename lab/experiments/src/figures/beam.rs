//! Figure 15: flat wall covered by a beam.

use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, shapes};
use headrace_sampling::section::{beam_width_m, footprint_m};
use headrace_simulator::effects::Cone;

use crate::ExperimentError;

/// Widths of the 881L's beam at 1 MHz and at 600 kHz, degrees (Jorge et al. 2021, §6).
const BEAMS_DEG: [f64; 2] = [1.4, 2.4];
/// Largest range setting of the paper's experiments, m.
const RANGE_M: f64 = 10.0;
/// Number of points of each footprint curve.
const POINTS: u32 = 60;
/// Number of rays of a simulated beam: the largest number that a scene allows.
const RAYS: usize = 64;
/// The footprint is also simulated for every curve point whose number is a multiple of `SIMULATED`.
const SIMULATED: u32 = 6;

/// Data of Figure 15.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Footprints {
    /// Footprints of a beam perpendicular to a wall, as functions of the range to the wall, m.
    pub by_range: Vec<Footprint>,
    /// Footprints on the floor, as functions of the beam's angle from straight down, degrees.
    pub by_angle: Vec<Footprint>,
    /// Height of the head above the floor, m.
    pub height_m: f64,
    /// Direction of the floor's corner, degrees from straight down.
    pub corner_deg: f64,
    /// The largest range shown, m.
    pub range_m: f64,
}

/// The footprints of one beam.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Footprint {
    /// The beam's full width, degrees.
    pub beam_deg: f64,
    /// Range or angle, and the length of the footprint by the formula, m.
    pub points: Vec<[f64; 2]>,
    /// Range or angle, and the extent of the hits of simulated rays on the wall, m.
    pub simulated: Vec<[f64; 2]>,
}

/// Computes the footprints for the blueprint's tunnel.
///
/// Errors: none in practice.
pub(crate) fn footprints() -> Result<Footprints, ExperimentError> {
    let profile = shapes::ceran_blueprint()?;
    let [_, height_m] = profile.reference();
    let half_m = floor_half_m(&profile);
    let corner_deg = math::atan2(half_m, height_m).to_degrees();
    let curve =
        |beam_deg: f64, most: f64, first: u32, of: &dyn Fn(f64) -> Result<[f64; 2], ExperimentError>| {
            let (mut points, mut simulated) = (Vec::new(), Vec::new());
            for number in first..=POINTS {
                let at = most * f64::from(number) / f64::from(POINTS);
                let [formula_m, rays_m] = of(at)?;
                points.push([at, formula_m]);
                if number % SIMULATED == 0 {
                    simulated.push([at, rays_m]);
                }
            }
            Ok::<_, ExperimentError>(Footprint { beam_deg, points, simulated })
        };
    let (mut by_range, mut by_angle) = (Vec::new(), Vec::new());
    for beam_deg in BEAMS_DEG {
        let beam_rad = f64::to_radians(beam_deg);
        by_range.push(curve(beam_deg, RANGE_M, 1, &|range_m| {
            Ok([beam_width_m(range_m, beam_rad)?, met_m(range_m, 0.0, beam_rad)])
        })?);
        by_angle.push(curve(beam_deg, corner_deg, 0, &|angle_deg| {
            let angle_rad = angle_deg.to_radians();
            Ok([footprint_m(height_m, angle_rad, beam_rad)?, met_m(height_m, angle_rad, beam_rad)])
        })?);
    }
    Ok(Footprints { by_range, by_angle, height_m, corner_deg, range_m: RANGE_M })
}

/// Returns half the width of a flat floor, found by bisection.
fn floor_half_m(profile: &Profile) -> f64 {
    let (mut floor_m, mut wall_m) = (0.0, profile.perimeter_m() / 2.0);
    for _ in 0..60 {
        let middle_m = f64::midpoint(floor_m, wall_m);
        let flat = profile.point_at(middle_m)[1] < 1e-9;
        *(if flat { &mut floor_m } else { &mut wall_m }) = middle_m;
    }
    profile.point_at(floor_m)[0].abs()
}

/// Extent of a simulated beam's hits on a flat wall, in the plane of rotation, m.
fn met_m(distance_m: f64, angle_rad: f64, beam_rad: f64) -> f64 {
    let (sine, cosine) = math::sin_cos(angle_rad);
    let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
    for [middle, _, across] in Cone::new(beam_rad, RAYS).parts() {
        // Rotates the ray by the beam's angle, from straight down towards the side.
        let (down, aside) = (middle * cosine - across * sine, middle * sine + across * cosine);
        let at = distance_m * aside / down;
        (least, most) = (least.min(at), most.max(at));
    }
    most - least
}
