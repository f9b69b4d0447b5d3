//! Boulders: single boulders, fields of boulders, and the pieces of a heap.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::tunnel::WallPoint;

use super::heaps::Heap;
use super::keys;
use super::placing::{Ground, Placed};
use super::scatter::Scatter;
use super::shapes::Solid;
use super::vector::Frame;
use super::widths::floor_m;

/// Allowed diameters of a boulder, m.
const SIZE_M: core::ops::RangeInclusive<f64> = 0.01..=20.0;
/// Default share of a boulder's thickness that lies below the wall.
const SUNK: f64 = 0.3;
/// Minimum ratio of width to length, and of thickness to width, of a scattered boulder.
const FLATTEST: f64 = 0.5;

/// A boulder: an ellipsoid on the wall.
struct Boulder {
    chainage_m: f64,
    arc_m: f64,
    /// Full diameters of the boulder, m: along the tunnel, along the wall, and across the wall.
    size_m: [f64; 3],
    /// Rotation of the boulder about the wall's normal, radians.
    yaw_rad: f64,
    sunk: f64,
}

/// Parameters of a field of random boulders.
struct Field {
    from_m: f64,
    to_m: f64,
    /// Extent of the field along the wall, m. The field's middle is on the floor's centre.
    width_m: f64,
    count: i64,
    size_m: [f64; 2],
    sunk: f64,
    seed: u64,
}

/// Reads one boulder.
///
/// Errors: a key is missing or out of range.
pub(super) fn one(
    table: &Section<'_>,
    ground: Ground<'_>,
    feature: u16,
) -> Result<Placed<Solid>, ConfigError> {
    let boulder = Boulder {
        chainage_m: keys::chainage_m(table, ground.length_m)?,
        arc_m: table.number("arc_m", -500.0..=500.0)?.unwrap_or(0.0),
        size_m: parse_size(table)?,
        yaw_rad: table.number("yaw_deg", -360.0..=360.0)?.unwrap_or(0.0).to_radians(),
        sunk: parse_sunk(table)?,
    };
    Ok(boulder.placed(ground, feature))
}

/// Reads a field of boulders on the floor.
///
/// Errors: a key is missing or out of range.
pub(super) fn many(
    table: &Section<'_>,
    ground: Ground<'_>,
    feature: u16,
) -> Result<Vec<Placed<Solid>>, ConfigError> {
    let from_m = keys::length_m(table, "from_m", 0.0..=ground.length_m)?;
    let to_m = keys::length_m(table, "to_m", 0.0..=ground.length_m)?;
    if to_m <= from_m {
        return Err(table.invalid("to_m", "must be more than from_m"));
    }
    let profile = ground.tube.profile();
    let width_m = table.number("width_m", 0.0..=profile.perimeter_m())?;
    let field = Field {
        from_m,
        to_m,
        width_m: width_m.unwrap_or_else(|| floor_m(profile)),
        count: table.required("count", table.integer("count", 1..=100_000)?)?,
        size_m: table.required("size_m", parse_sizes(table)?)?,
        sunk: parse_sunk(table)?,
        seed: keys::seed(table)?,
    };
    Ok(field.scatter(ground, feature))
}

/// Reads the pieces of a heap, which are scattered over the inner half of the heap.
///
/// Errors: a key is missing or out of range.
pub(super) fn pieces(
    table: &Section<'_>,
    ground: Ground<'_>,
    heap: Option<&Heap>,
) -> Result<Vec<Placed<Solid>>, ConfigError> {
    let count = table.integer("pieces", 0..=10_000)?.unwrap_or(0);
    let size_m = parse_sizes(table)?.unwrap_or([0.1, 0.3]);
    let (sunk, seed) = (parse_sunk(table)?, keys::seed(table)?);
    let Some(heap) = heap else { return Ok(Vec::new()) };
    let field = Field {
        from_m: heap.chainage_m - heap.length_m / 4.0,
        to_m: heap.chainage_m + heap.length_m / 4.0,
        width_m: heap.width_m / 2.0,
        count,
        size_m,
        sunk,
        seed,
    };
    Ok(field.scatter(ground, heap.feature))
}

impl Boulder {
    fn placed(&self, ground: Ground<'_>, feature: u16) -> Placed<Solid> {
        let half = self.size_m.map(|diameter| diameter / 2.0);
        let (wall, [ny, nz]) = ground.tube.wall_place(WallPoint { x_m: self.chainage_m, arc_m: self.arc_m });
        let above_m = half[2] * (1.0 - 2.0 * self.sunk);
        let section = ground.frame(self.chainage_m, [wall[0] + above_m * ny, wall[1] + above_m * nz]);
        // Axes of the boulder. Its thickness is along the wall's normal. Its length and width start along the tunnel
        // and along the wall, and are rotated about the normal.
        let normal = section.outwards([0.0, ny, nz]);
        let (sin, cos) = math::sin_cos(self.yaw_rad);
        let length = section.outwards([cos, -sin * nz, sin * ny]);
        let width = section.outwards([-sin, -cos * nz, cos * ny]);
        let frame = Frame { origin: section.origin, axes: [length, width, normal] };
        let reach_m = half.iter().copied().fold(0.0, f64::max);
        let span_m = ground.span_m(self.chainage_m, reach_m);
        Placed { shape: Solid::Ellipsoid(frame, half), feature, span_m }
    }
}

impl Field {
    fn scatter(&self, ground: Ground<'_>, feature: u16) -> Vec<Placed<Solid>> {
        let mut scatter = Scatter(self.seed);
        (0..self.count).map(|_| self.boulder(&mut scatter).placed(ground, feature)).collect()
    }

    /// The next random boulder. The logarithm of its size is uniformly distributed.
    fn boulder(&self, scatter: &mut Scatter) -> Boulder {
        let chainage_m = scatter.between(self.from_m, self.to_m);
        let arc_m = scatter.between(-self.width_m / 2.0, self.width_m / 2.0);
        let [least_m, most_m] = self.size_m;
        let size_m = least_m * power(most_m / least_m, scatter.share());
        let width_m = size_m * scatter.between(FLATTEST, 1.0);
        let thickness_m = width_m * scatter.between(FLATTEST, 1.0);
        Boulder {
            chainage_m,
            arc_m,
            size_m: [size_m, width_m, thickness_m],
            yaw_rad: scatter.between(0.0, TAU),
            sunk: self.sunk,
        }
    }
}

/// Raises `base` to `exponent` in [0, 1) with square roots. Square roots are rounded exactly, so the result is the same
/// on all machines.
fn power(base: f64, exponent: f64) -> f64 {
    let (mut result, mut root, mut rest) = (1.0, base, exponent);
    for _ in 0..53 {
        root = math::sqrt(root);
        rest *= 2.0;
        if rest >= 1.0 {
            rest -= 1.0;
            result *= root;
        }
    }
    result
}

/// Reads `size_m` of a single boulder, which is one diameter or three.
fn parse_size(table: &Section<'_>) -> Result<[f64; 3], ConfigError> {
    let wanted = format!(
        "must be a diameter from {} to {}, or three: along the tunnel, along the wall, across the wall",
        SIZE_M.start(),
        SIZE_M.end()
    );
    let sizes = table.number_or_numbers("size_m", SIZE_M, &wanted)?;
    match table.required("size_m", sizes)?.as_slice() {
        [size_m] => Ok([*size_m; 3]),
        [along_m, across_m, thick_m] => Ok([*along_m, *across_m, *thick_m]),
        _ => Err(table.invalid("size_m", &wanted)),
    }
}

/// Reads `size_m` of scattered boulders, which is the smallest and the largest diameter.
fn parse_sizes(table: &Section<'_>) -> Result<Option<[f64; 2]>, ConfigError> {
    match table.numbers("size_m", SIZE_M)?.as_deref() {
        None => Ok(None),
        Some([least_m, most_m]) if least_m <= most_m => Ok(Some([*least_m, *most_m])),
        Some(_) => Err(table.invalid("size_m", "must be two numbers [least, most]")),
    }
}

fn parse_sunk(table: &Section<'_>) -> Result<f64, ConfigError> {
    Ok(table.number("sunk", 0.0..=0.9)?.unwrap_or(SUNK))
}
