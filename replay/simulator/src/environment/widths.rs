//! Width of a tunnel profile.

use headrace_geometry::tunnel::Profile;

/// Number of points at which a profile's extent is evaluated.
const PLACES: u32 = 2_000;
/// Factor by which a half-width is enlarged, because the wall may be farther out between the evaluated points.
const WIDTH_MARGIN: f64 = 1.001;
/// Largest difference in height within a floor that counts as flat, m.
const FLAT_M: f64 = 1e-3;
/// Largest distance of the wall from the axis, to either side, m.
pub(super) fn half_width_m(profile: &Profile) -> f64 {
    WIDTH_MARGIN * places(profile).map(|[y, _]| y.abs()).fold(0.0, f64::max)
}

/// Width of the floor, m. For a curved floor, a quarter of the perimeter.
pub(super) fn floor_m(profile: &Profile) -> f64 {
    flat_floor_m(profile).unwrap_or(profile.perimeter_m() / 4.0)
}

/// Width of a flat floor that extends about equally to both sides of its centre, m; `None` if the floor is curved.
pub(super) fn flat_floor_m(profile: &Profile) -> Option<f64> {
    let floor_m = profile.point_at(0.0)[1];
    let flat = |place: &[f64; 2]| place[1] < floor_m + FLAT_M;
    let to_left = places(profile).take_while(flat).map(|place| place[0].abs()).last()?;
    let to_right = mirrored(profile).take_while(flat).map(|place| place[0].abs()).last()?;
    let half_m = to_left.min(to_right);
    (half_m > 0.1 * half_width_m(profile)).then_some(2.0 * half_m)
}

fn places(profile: &Profile) -> impl Iterator<Item = [f64; 2]> + '_ {
    (0..PLACES).map(|k| profile.point_at(profile.perimeter_m() * f64::from(k) / f64::from(PLACES)))
}

fn mirrored(profile: &Profile) -> impl Iterator<Item = [f64; 2]> + '_ {
    (0..PLACES).map(|k| profile.point_at(-profile.perimeter_m() * f64::from(k) / f64::from(PLACES)))
}
