//! Meshes in a scene: bodies in the water, and walls in place of the tube's wall.
//!
//! The axes of a mesh are those of the tunnel at the origin of the mesh: x along the tunnel, y left, z up, metres.

use std::sync::Arc;

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_geometry::tunnel::Yz;

use super::bulge::Bulge;
use super::keys::{self, Kind};
use super::mesh_parts::{MeshBody, MeshWall};
use super::placing::{Placed, Site, span_m};
use super::shapes::Solid;
use super::vector::Frame;
use crate::file_loader::FileLoader;
use crate::mesh::{self, Mesh, Role};

/// Allowed chainage of the origin of a mesh, m. The origin of a survey may be far away.
const CHAINAGE_M: core::ops::RangeInclusive<f64> = -1.0e5..=1.0e5;
/// Allowed position of the origin of a mesh across the tunnel, m.
const ACROSS_M: core::ops::RangeInclusive<f64> = -1000.0..=1000.0;
/// Minimum length of a mesh that is a stretch of wall, m.
const SHORTEST_M: f64 = 0.01;

/// Position of the origin of a mesh in the tunnel.
struct Place {
    chainage_m: f64,
    across_m: Yz,
}

/// Reads the meshes among the tables of features: walls and bodies. Ignores other features.
///
/// Errors: a key is missing or out of range, a file is not a mesh, or the position of a mesh is impossible. Allocates:
/// startup only, like [`Mesh::new`].
pub(super) fn parse(
    tables: &[Section<'_>],
    site: &Site<'_>,
    bulges: &[Bulge],
    load: FileLoader<'_>,
) -> Result<(Vec<MeshWall>, Vec<Placed<Solid>>), ConfigError> {
    let (mut walls, mut bodies) = (Vec::new(), Vec::new());
    for (feature, table) in (0_u16..).zip(tables) {
        if keys::kind(table)? != Kind::Mesh {
            continue;
        }
        let roles = [("body", Role::Body), ("wall", Role::Wall)];
        match table.choice("role", &roles)?.unwrap_or(Role::Body) {
            Role::Body => bodies.push(parse_body(table, site, feature, load)?),
            Role::Wall => {
                let wall = parse_wall(table, site, feature, load)?;
                check(&wall, table, site, bulges, &walls)?;
                walls.push(wall);
            }
        }
    }
    Ok((walls, bodies))
}

fn parse_body(
    table: &Section<'_>,
    site: &Site<'_>,
    feature: u16,
    load: FileLoader<'_>,
) -> Result<Placed<Solid>, ConfigError> {
    let Place { chainage_m, across_m } = Place::parse(table, site)?;
    let yaw_rad = table.number("yaw_deg", -360.0..=360.0)?.unwrap_or(0.0).to_radians();
    let mesh = read(table, Role::Body, load)?;
    let (sin, cos) = math::sin_cos(yaw_rad);
    let section = Frame::across(site.axis.station(chainage_m), across_m);
    let ahead = section.outwards([cos, sin, 0.0]);
    let left = section.outwards([-sin, cos, 0.0]);
    let frame = Frame { axes: [ahead, left, section.axes[2]], ..section };
    let (low, high) = mesh.bounds();
    let corners = [(low[0], low[1]), (low[0], high[1]), (high[0], low[1]), (high[0], high[1])];
    let along_m = corners.map(|(x, y)| x * cos - y * sin);
    let back_m = along_m.iter().copied().fold(f64::INFINITY, f64::min);
    let ahead_m = along_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (from_m, to_m) = (chainage_m + back_m, chainage_m + ahead_m);
    if from_m < 0.0 || to_m > site.length_m {
        let why = format!("reaches out of the tunnel, which goes from 0 to {} m", site.length_m);
        return Err(misplaced(table, (from_m, to_m), &why));
    }
    // In a bend, the chainage of a mesh's corner doesn't follow from the corner's x. The mesh is therefore assumed to
    // reach as far ahead and behind as its farthest corner is from the origin.
    let reach_m = corners.iter().map(|(x, y)| math::hypot(*x, *y)).fold(0.0, f64::max);
    let reach_m = if site.axis.is_straight() { [back_m, ahead_m] } else { [-reach_m, reach_m] };
    let span_m = span_m(site.axis, chainage_m, reach_m);
    Ok(Placed { shape: Solid::Mesh(MeshBody { frame, mesh: Arc::new(mesh) }), feature, span_m })
}

fn parse_wall(
    table: &Section<'_>,
    site: &Site<'_>,
    feature: u16,
    load: FileLoader<'_>,
) -> Result<MeshWall, ConfigError> {
    let Place { chainage_m, across_m } = Place::parse(table, site)?;
    if table.keys().contains(&"yaw_deg") {
        return Err(table.invalid("yaw_deg", "applies to a body only; a wall follows the axis"));
    }
    let mesh = read(table, Role::Wall, load)?;
    let x_m = mesh.closed_m();
    let (from_m, to_m) = (chainage_m + x_m.0, chainage_m + x_m.1);
    if to_m - from_m < SHORTEST_M {
        let problem =
            format!("has {:.3} m of wall along x; at least {SHORTEST_M} m is needed", to_m - from_m);
        return Err(table.invalid("file", &problem));
    }
    // The origin may lie beyond a bend of the axis. The x-axis of the mesh continues straight.
    let (_, piece) = site.axis.piece_at(f64::midpoint(from_m, to_m));
    let frame = Frame::across(piece.station(chainage_m), across_m);
    Ok(MeshWall { feature, from_m, to_m, x_m, frame, mesh: Arc::new(mesh) })
}

/// Checks that the tunnel around a mesh is straight and keeps its plain profile.
///
/// Errors: the mesh lies outside the tunnel, meets a bend, or overlaps a change of the wall.
fn check(
    wall: &MeshWall,
    table: &Section<'_>,
    site: &Site<'_>,
    bulges: &[Bulge],
    others: &[MeshWall],
) -> Result<(), ConfigError> {
    let refuse = |why: &str| Err(misplaced(table, wall.span_m(), why));
    let overlaps = |from_m: f64, to_m: f64| from_m < wall.to_m && wall.from_m < to_m;
    if !overlaps(0.0, site.length_m) {
        return refuse(&format!("is outside the tunnel, which goes from 0 to {} m", site.length_m));
    }
    let bend = |from_m, to_m, curvature_pm| curvature_pm != 0.0 && overlaps(from_m, to_m);
    if site.axis.pieces().iter().any(|piece| bend(piece.from_m, piece.to_m, piece.curvature_pm())) {
        return refuse("meets a bend of the axis; a mesh can be the wall of a straight stretch only");
    }
    // If a point is farther from the axis than the radius of a bend, its nearest point of the axis may be in the bend.
    let (low, high) = wall.mesh.bounds();
    let (_, piece) = site.axis.piece_at(wall.from_m);
    let left_m = piece.left_of([wall.frame.origin[0], wall.frame.origin[1]]);
    let aside_m = (left_m + low[1]).abs().max((left_m + high[1]).abs());
    if aside_m * site.axis.largest_curvature_pm() > 1.0 {
        let radius_m = 1.0 / site.axis.largest_curvature_pm();
        return refuse(&format!(
            "goes {aside_m:.3} m to the side, farther than the radius of the tightest bend, {radius_m:.3} m"
        ));
    }
    let mut stations = site.scales.breaks();
    let is_within = |at_m: f64| (wall.from_m..=wall.to_m).contains(&at_m);
    if let Some(at_m) = stations.find(|at_m| is_within(*at_m)) {
        return refuse(&format!(
            "contains the station at {at_m} m; the profile must have a constant scale there"
        ));
    }
    if site.scales.slope_pm(wall.from_m, wall.to_m) != 0.0 {
        return refuse(
            "lies between stations of different scale; the profile must have a constant scale there",
        );
    }
    if let Some(bulge) = bulges.iter().find(|bulge| overlaps(bulge.begin_m(), bulge.end_m())) {
        return refuse(&format!("overlaps tunnel.features[{}], which displaces the wall", bulge.feature));
    }
    if let Some(other) = others.iter().find(|other| overlaps(other.from_m, other.to_m)) {
        return refuse(&format!("overlaps the mesh of tunnel.features[{}]", other.feature));
    }
    Ok(())
}

impl Place {
    fn parse(table: &Section<'_>, site: &Site<'_>) -> Result<Self, ConfigError> {
        let chainage_m = table.number("chainage_m", CHAINAGE_M)?.unwrap_or(0.0);
        let [floor_y, floor_z] = site.profile.point_at(0.0);
        let [y, z] = match table.numbers("across_m", ACROSS_M)?.as_deref() {
            None => [0.0, 0.0],
            Some([y, z]) => [*y, *z],
            Some(_) => return Err(table.invalid("across_m", "must be two numbers [left, up]")),
        };
        Ok(Self { chainage_m, across_m: [floor_y + y, floor_z + z] })
    }
}

/// Loads the mesh from the file that the key `file` of a table names.
fn read(table: &Section<'_>, role: Role, load: FileLoader<'_>) -> Result<Mesh, ConfigError> {
    let name = table.required("file", table.text("file")?)?;
    let refuse = |why: &str| table.invalid("file", why);
    if !name.to_ascii_lowercase().ends_with(".ply") {
        return Err(refuse("must end in .ply"));
    }
    let bytes = load(&name).map_err(|why| refuse(&why))?;
    let triangles = mesh::read(&bytes).map_err(|error| refuse(&error.to_string()))?;
    Mesh::new(triangles, role).map_err(|error| refuse(&error.to_string()))
}

/// Creates an error about the position of a mesh.
fn misplaced(table: &Section<'_>, (from_m, to_m): (f64, f64), why: &str) -> ConfigError {
    let key = if table.keys().contains(&"chainage_m") { "chainage_m" } else { "file" };
    table.invalid(key, &format!("the mesh, from {from_m:.3} to {to_m:.3} m, {why}"))
}
