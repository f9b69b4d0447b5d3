//! Position in the cross-section that best fits the echosounders' ranges to the design profile.

use serde::{Deserialize, Serialize};

use headrace_geometry::frames::{Body, Mount, Rot, Sensor, Tunnel, Vec3};
use headrace_geometry::tunnel::Profile;

/// Minimum cosine of the angle of incidence. Echosounder beams at a more grazing angle are ignored.
const LEAST_COSINE: f64 = 0.1;
/// Change of a beam's range per metre of height, m/m, above which the beam determines the vehicle's height.
const STEEP: f64 = 0.7;
const ROUNDS: usize = 3;

/// A measured range to the wall along the sonar's x axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Echo {
    /// Mount of the sonar.
    pub mount: Mount,
    /// Range computed with the site's speed of sound, m.
    pub range_m: f64,
}

/// A fitted position in the cross-section, and whether echoes determine its height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Coordinates y and z of the position, m.
    pub at_m: [f64; 2],
    /// Whether an echo determines the height of the position.
    pub is_height_seen: bool,
}

/// Fits the position to the echoes by Gauss-Newton iteration, starting at `start`.
///
/// Minimises sum((measured - predicted)^2 / sd^2) plus a prior term with the position `prior` and the standard
/// deviations `prior_sd_m`. The derivative of a range with respect to the position is -n / (n . beam). The iteration
/// stops before a step that leaves the cross-section.
pub fn settle(
    profile: &Profile,
    attitude: Rot<Tunnel, Body>,
    start: [f64; 2],
    (prior, prior_sd_m): ([f64; 2], [f64; 2]),
    echo_sd_m: f64,
    echoes: &(impl Iterator<Item = Echo> + Clone),
) -> Place {
    let mut place = Place { at_m: start, is_height_seen: false };
    let [wy, wz] = prior_sd_m.map(weight);
    for _ in 0..ROUNDS {
        let at = place.at_m;
        let (mut hyy, mut hyz, mut hzz) = (wy, 0.0, wz);
        let (mut gy, mut gz) = (wy * (prior[0] - at[0]), wz * (prior[1] - at[1]));
        for echo in echoes.clone() {
            let offset = attitude * echo.mount.position;
            let beam = attitude * (echo.mount.rotation * Vec3::<Sensor>::new(1.0, 0.0, 0.0));
            let Some(hit) = profile.cast([at[0] + offset.y(), at[1] + offset.z()], [beam.y(), beam.z()])
            else {
                continue;
            };
            let cosine = hit.normal[0] * beam.y() + hit.normal[1] * beam.z();
            if cosine.abs() < LEAST_COSINE {
                continue;
            }
            let slope = [-hit.normal[0] / cosine, -hit.normal[1] / cosine];
            place.is_height_seen |= slope[1].abs() > STEEP;
            let weight = weight(echo_sd_m);
            let residual = echo.range_m - hit.range_m;
            hyy += weight * slope[0] * slope[0];
            hyz += weight * slope[0] * slope[1];
            hzz += weight * slope[1] * slope[1];
            gy += weight * slope[0] * residual;
            gz += weight * slope[1] * residual;
        }
        // The prior term keeps the determinant of the normal equations positive.
        let determinant = hyy * hzz - hyz * hyz;
        debug_assert!(determinant > 0.0, "the prior keeps the determinant positive: {determinant}");
        let moved =
            [at[0] + (hzz * gy - hyz * gz) / determinant, at[1] + (hyy * gz - hyz * gy) / determinant];
        if !profile.contains(moved) {
            break;
        }
        place.at_m = moved;
    }
    place
}

/// Least-squares weight of an observation with the standard deviation `sd_m`.
fn weight(sd_m: f64) -> f64 {
    1.0 / (sd_m * sd_m)
}
