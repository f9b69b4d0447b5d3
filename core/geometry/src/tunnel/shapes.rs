//! Profiles from their dimensions: rectangle, circle, arch, trimmed circle, and the Ceran tunnel of Jorge et al. 2021.

use super::profile::{Piece, Profile, ProfileError};
use crate::math::{self, PI, TAU};

/// Base width of the Ceran tunnel, m (Jorge et al. 2021, §7.3).
const CERAN_BASE_M: f64 = 10.4;
/// Radius of the Ceran tunnel's trimmed circle, m (Jorge et al. 2021, §7.3).
const CERAN_RADIUS_M: f64 = 6.05;
/// Perimeter on the plant's blueprint, m (Jorge et al. 2021, §9.2).
///
/// The base width and radius above give a perimeter of 35.90 m instead.
const CERAN_BLUEPRINT_PERIMETER_M: f64 = 34.17;

/// A rectangle, with its reference point at the centre.
///
/// Errors: dimensions that give no valid profile.
pub fn rectangle(width_m: f64, height_m: f64) -> Result<Profile, ProfileError> {
    let half = width_m / 2.0;
    let corners = [[half, 0.0], [half, height_m], [-half, height_m], [-half, 0.0]];
    Profile::new([0.0, 0.0], &corners.map(Piece::LineTo), [0.0, height_m / 2.0])
}

/// A circle, with its reference point at the centre.
///
/// Errors: dimensions that give no valid profile.
pub fn circle(radius_m: f64) -> Result<Profile, ProfileError> {
    let centre = [0.0, radius_m];
    Profile::new([0.0, 0.0], &[Piece::Arc { centre, sweep_rad: TAU }], centre)
}

/// A tunnel of vertical walls under an arc, as in Jorge et al. 2021, Fig. 2.
///
/// The arc's radius `arch_radius_m` is at least half the width. `height_m` is the height of the crown. The reference
/// point is at half height.
///
/// Errors: dimensions that give no valid profile.
pub fn arch(width_m: f64, height_m: f64, arch_radius_m: f64) -> Result<Profile, ProfileError> {
    let half = width_m / 2.0;
    let centre = [0.0, height_m - arch_radius_m];
    let spring_m = centre[1] + math::sqrt(arch_radius_m * arch_radius_m - half * half);
    let sweep_rad = 2.0 * math::asin(half / arch_radius_m);
    let pieces = [
        Piece::LineTo([half, 0.0]),
        Piece::LineTo([half, spring_m]),
        Piece::Arc { centre, sweep_rad },
        Piece::LineTo([-half, 0.0]),
    ];
    Profile::new([0.0, 0.0], &pieces, [0.0, height_m / 2.0])
}

/// A circle whose lower part is cut off by a flat floor of width `base_m`.
///
/// The reference point is the circle's centre, which is above the floor.
///
/// Errors: dimensions that give no valid profile.
pub fn trimmed_circle(radius_m: f64, base_m: f64) -> Result<Profile, ProfileError> {
    let half = base_m / 2.0;
    let centre_m = math::sqrt(radius_m * radius_m - half * half);
    let sweep_rad = PI + 2.0 * math::asin(centre_m / radius_m);
    let centre = [0.0, centre_m];
    let pieces = [Piece::LineTo([half, 0.0]), Piece::Arc { centre, sweep_rad }, Piece::LineTo([0.0, 0.0])];
    Profile::new([0.0, 0.0], &pieces, centre)
}

/// The Ceran tunnel with the dimensions in Jorge et al. 2021; its perimeter is 35.90 m.
///
/// Errors: none; the dimensions are valid.
pub fn ceran() -> Result<Profile, ProfileError> {
    trimmed_circle(CERAN_RADIUS_M, CERAN_BASE_M)
}

/// The shape of [`ceran`], scaled to the perimeter of the blueprint, 34.17 m.
///
/// Errors: none; the dimensions are valid.
pub fn ceran_blueprint() -> Result<Profile, ProfileError> {
    let scale = CERAN_BLUEPRINT_PERIMETER_M / ceran()?.perimeter_m();
    trimmed_circle(CERAN_RADIUS_M * scale, CERAN_BASE_M * scale)
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod oracle;
