//! `[tunnel]` of a vehicle or scene file: a profile by name and dimensions, and a length.

use headrace_config::{ConfigError, Loader, Section};
use headrace_geometry::math;
use headrace_geometry::tunnel::{Profile, Yz, shapes};

/// The `[tunnel]` table: profile and length of the tunnel.
#[derive(Debug, Clone, PartialEq)]
pub struct TunnelConfig {
    /// Name of the profile in the vehicle or scene file.
    pub name: String,
    /// Design profile of the cross-section.
    pub profile: Profile,
    /// Length along the tunnel's axis from the portal at chainage 0, m.
    pub length_m: f64,
}

impl TunnelConfig {
    /// Reads a tunnel's table, except the keys that concern the site.
    ///
    /// Errors: a key that is missing, unknown or out of range, or dimensions without a valid profile.
    pub fn from_section(section: &Section<'_>, load: Loader<'_>) -> Result<Self, ConfigError> {
        let length_m = section.number("length_m", 0.1..=1.0e5)?.unwrap_or(10_000.0);
        let shape = section.required("profile", section.choice("profile", &SHAPES)?)?;
        let name = section.text("profile")?;
        debug_assert!(name.is_some(), "profile {shape:?} has a name");
        let name = name.unwrap_or_default();
        let profile = parse(section, shape, load);
        section.finish()?;
        Ok(Self { name, profile: profile?, length_m })
    }
}

#[derive(Debug, Clone, Copy)]
enum Shape {
    Ceran,
    CeranBlueprint,
    Rectangle,
    Circle,
    Arch,
    TrimmedCircle,
    Polyline,
}

const SHAPES: [(&str, Shape); 7] = [
    ("ceran", Shape::Ceran),
    ("ceran-blueprint", Shape::CeranBlueprint),
    ("rectangle", Shape::Rectangle),
    ("circle", Shape::Circle),
    ("arch", Shape::Arch),
    ("trimmed_circle", Shape::TrimmedCircle),
    ("polyline", Shape::Polyline),
];

const DIMENSION_M: core::ops::RangeInclusive<f64> = 0.1..=200.0;

/// Reads the dimensions of a profile from a `[tunnel]` table.
///
/// Errors: a key that is missing or out of range, or dimensions without a valid profile.
fn parse(section: &Section<'_>, shape: Shape, load: Loader<'_>) -> Result<Profile, ConfigError> {
    let dimension = |key| section.required(key, section.number(key, DIMENSION_M)?);
    let profile = match shape {
        Shape::Ceran => shapes::ceran(),
        Shape::CeranBlueprint => shapes::ceran_blueprint(),
        Shape::Rectangle => {
            let (width, height) = (dimension("width_m"), dimension("height_m"));
            shapes::rectangle(width?, height?)
        }
        Shape::Circle => shapes::circle(dimension("radius_m")?),
        Shape::Arch => {
            let (width, height) = (dimension("width_m"), dimension("height_m"));
            let radius = dimension("arch_radius_m")?;
            let (width, height) = (width?, height?);
            if radius < width / 2.0 || radius - math::sqrt(radius * radius - width * width / 4.0) > height {
                let problem = "must be at least width_m / 2; the arc must also not be higher than height_m";
                return Err(section.invalid("arch_radius_m", problem));
            }
            shapes::arch(width, height, radius)
        }
        Shape::TrimmedCircle => {
            let (radius, base) = (dimension("radius_m"), dimension("base_m"));
            let (radius, base) = (radius?, base?);
            if base >= 2.0 * radius {
                return Err(section.invalid("base_m", "must be less than 2 radius_m"));
            }
            shapes::trimmed_circle(radius, base)
        }
        Shape::Polyline => {
            let file = section.required("file", section.text("file")?)?;
            let reference = match section.numbers("reference_m", -200.0..=200.0)?.as_deref() {
                None => None,
                Some([y, z]) => Some([*y, *z]),
                Some(_) => return Err(section.invalid("reference_m", "must be two numbers [y, z]")),
            };
            let text = load(&file).map_err(|why| section.invalid("file", &why))?;
            let (points, lines) = parse_points(&text).map_err(|why| section.invalid("file", &why))?;
            let profile = Profile::polygon(&points, reference);
            return profile.map_err(|why| match why.vertex().and_then(|vertex| lines.get(vertex)) {
                Some(line) => section.invalid("file", &format!("line {line}: {why}")),
                None => section.invalid("file", &why.to_string()),
            });
        }
    };
    profile.map_err(|why| section.invalid("profile", &why.to_string()))
}

/// Maximum number of points of a profile: one point per millimetre on a perimeter of 100 m.
const MOST_POINTS: usize = 100_000;

/// Reads a polyline with one line `y_m,z_m` per vertex.
///
/// Returns the vertices and their line numbers. Skips lines that start with #, and the first line if it is not a
/// vertex.
fn parse_points(text: &str) -> Result<(Vec<Yz>, Vec<usize>), String> {
    let (mut points, mut lines) = (Vec::new(), Vec::new());
    for (number, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let mut fields = line.split(',').map(|field| field.trim().parse::<f64>().ok());
        match (fields.next().flatten(), fields.next().flatten(), fields.next()) {
            (Some(_), Some(_), None) if points.len() >= MOST_POINTS => {
                return Err(format!("has more than {MOST_POINTS} points, the limit for a profile"));
            }
            (Some(y), Some(z), None) => {
                points.push([y, z]);
                lines.push(number + 1);
            }
            _ if number == 0 => {}
            _ => {
                let start: String = line.chars().take(60).collect();
                return Err(format!("line {} is {start:?}; expected two numbers: y_m,z_m", number + 1));
            }
        }
    }
    Ok((points, lines))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_in_polyline_vertices_name_their_line() {
        let read = parse_points("y_m,z_m\n1, 2\n# floor\n-1,2\n").unwrap();
        assert_eq!(read, (vec![[1.0, 2.0], [-1.0, 2.0]], vec![2, 4]));
        assert_eq!(parse_points(&"1,2\n".repeat(MOST_POINTS)).unwrap().0.len(), MOST_POINTS);
        let words = parse_points(&"1,2\n".repeat(MOST_POINTS + 1)).unwrap_err();
        assert!(words.starts_with("has more than 100000 points"), "{words}");
        assert!(parse_points(&format!("1,2\n{}", "3".repeat(1 << 20))).unwrap_err().len() < 200);
        assert_eq!(
            parse_points("1,2\n3;4\n").unwrap_err(),
            "line 2 is \"3;4\"; expected two numbers: y_m,z_m"
        );
    }
}
