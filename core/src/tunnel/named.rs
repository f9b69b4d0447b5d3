//! Profiles by name and dimensions, as vehicle files give them.

use super::profile::{Piece, Profile, ProfileError, Yz};
use crate::config::vehicle::Loader;
use crate::config::{ConfigError, Section};
use crate::math::{self, PI, TAU};

/// Base of the Ceran tunnel, m (the paper's §7.3).
const CERAN_BASE_M: f64 = 10.4;
/// Radius of the Ceran tunnel's trimmed circle, m (the paper's §7.3).
const CERAN_RADIUS_M: f64 = 6.05;
/// Perimeter on the plant's blueprint, m (the paper's §9.2), which the dimensions above don't give (35.90 m).
const CERAN_BLUEPRINT_PERIMETER_M: f64 = 34.17;

/// A rectangle, its reference point in the middle.
///
/// Errors: dimensions that make no profile.
pub fn rectangle(width_m: f64, height_m: f64) -> Result<Profile, ProfileError> {
    let half = width_m / 2.0;
    let corners = [[half, 0.0], [half, height_m], [-half, height_m], [-half, 0.0]];
    Profile::new([0.0, 0.0], &corners.map(Piece::LineTo), [0.0, height_m / 2.0])
}

/// A circle, its reference point in the middle.
///
/// Errors: dimensions that make no profile.
pub fn circle(radius_m: f64) -> Result<Profile, ProfileError> {
    let centre = [0.0, radius_m];
    Profile::new([0.0, 0.0], &[Piece::Arc { centre, sweep_rad: TAU }], centre)
}

/// The paper's Fig. 2: upright walls under an arc of radius `arch_radius_m` >= width / 2; `height_m` is that of the
/// crown. The reference point is half way up.
///
/// Errors: dimensions that make no profile.
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

/// A circle with its lower part cut off by a flat floor of width `base_m`; the reference point is the circle's centre,
/// which is above the floor.
///
/// Errors: dimensions that make no profile.
pub fn trimmed_circle(radius_m: f64, base_m: f64) -> Result<Profile, ProfileError> {
    let half = base_m / 2.0;
    let centre_m = math::sqrt(radius_m * radius_m - half * half);
    let sweep_rad = PI + 2.0 * math::asin(centre_m / radius_m);
    let centre = [0.0, centre_m];
    let pieces = [Piece::LineTo([half, 0.0]), Piece::Arc { centre, sweep_rad }, Piece::LineTo([0.0, 0.0])];
    Profile::new([0.0, 0.0], &pieces, centre)
}

/// The tunnel of the paper with its stated dimensions: perimeter 35.90 m.
///
/// Errors: none that can occur.
pub fn ceran() -> Result<Profile, ProfileError> {
    trimmed_circle(CERAN_RADIUS_M, CERAN_BASE_M)
}

/// The same shape, scaled to the perimeter of the blueprint, 34.17 m.
///
/// Errors: none that can occur.
pub fn ceran_blueprint() -> Result<Profile, ProfileError> {
    let scale = CERAN_BLUEPRINT_PERIMETER_M / ceran()?.perimeter_m();
    trimmed_circle(CERAN_RADIUS_M * scale, CERAN_BASE_M * scale)
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    Ceran,
    CeranBlueprint,
    Rectangle,
    Circle,
    Arch,
    TrimmedCircle,
    Polyline,
}

const KINDS: [(&str, Kind); 7] = [
    ("ceran", Kind::Ceran),
    ("ceran-blueprint", Kind::CeranBlueprint),
    ("rectangle", Kind::Rectangle),
    ("circle", Kind::Circle),
    ("arch", Kind::Arch),
    ("trimmed_circle", Kind::TrimmedCircle),
    ("polyline", Kind::Polyline),
];

const DIMENSION_M: core::ops::RangeInclusive<f64> = 0.1..=200.0;

/// Reads `profile` and its dimensions from a `[tunnel]` table; gives the profile's name too.
///
/// Errors: a key missing or out of range, or dimensions that make no profile.
pub(crate) fn parse(section: &Section<'_>, load: Loader<'_>) -> Result<(String, Profile), ConfigError> {
    let kind = section.required("profile", section.choice("profile", &KINDS)?)?;
    let name = section.text("profile")?.unwrap_or_default();
    let dimension = |key| section.required(key, section.number(key, DIMENSION_M)?);
    let profile = match kind {
        Kind::Ceran => ceran(),
        Kind::CeranBlueprint => ceran_blueprint(),
        Kind::Rectangle => rectangle(dimension("width_m")?, dimension("height_m")?),
        Kind::Circle => circle(dimension("radius_m")?),
        Kind::Arch => {
            let (width, height) = (dimension("width_m")?, dimension("height_m")?);
            let radius = dimension("arch_radius_m")?;
            if radius < width / 2.0 || radius - math::sqrt(radius * radius - width * width / 4.0) > height {
                let problem = "must be at least width_m / 2, and the arc no higher than height_m";
                return Err(section.invalid("arch_radius_m", problem));
            }
            arch(width, height, radius)
        }
        Kind::TrimmedCircle => {
            let (radius, base) = (dimension("radius_m")?, dimension("base_m")?);
            if base >= 2.0 * radius {
                return Err(section.invalid("base_m", "must be less than 2 radius_m"));
            }
            trimmed_circle(radius, base)
        }
        Kind::Polyline => {
            let file = section.required("file", section.text("file")?)?;
            let reference = match section.numbers("reference_m", -200.0..=200.0)?.as_deref() {
                None => None,
                Some([y, z]) => Some([*y, *z]),
                Some(_) => return Err(section.invalid("reference_m", "must be two numbers [y, z]")),
            };
            let text = load(&file).map_err(|why| section.invalid("file", &why))?;
            let points = parse_points(&text).map_err(|why| section.invalid("file", &why))?;
            Profile::polygon(&points, reference)
        }
    };
    let profile = profile.map_err(|why| section.invalid("profile", &why.to_string()))?;
    Ok((name, profile))
}

/// Reads a polyline: a line `y_m,z_m` a vertex; a first line of other text and lines that begin with # are passed over.
fn parse_points(text: &str) -> Result<Vec<Yz>, String> {
    let mut points = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split(',').map(|field| field.trim().parse::<f64>().ok());
        match (fields.next().flatten(), fields.next().flatten(), fields.next()) {
            (Some(y), Some(z), None) => points.push([y, z]),
            _ if number == 0 => {}
            _ => return Err(format!("line {} of it is {line:?}; wanted is y_m,z_m", number + 1)),
        }
    }
    Ok(points)
}

#[cfg(test)]
mod tests;
