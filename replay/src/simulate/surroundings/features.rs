//! The `[[tunnel.features]]` of a scene.

use headrace_config::{ConfigError, Section};
use headrace_geometry::tunnel::Profile;

use super::axis::Axis;
use super::heaps::Heap;
use super::shapes::{Frame, Hollow, Solid};
use super::stations::Scales;
use super::tube::Tube;
use super::{boulders, openings};

/// Places at which a profile's extent is taken.
const PLACES: u32 = 2_000;
/// What the places between may add to a half-width.
const WIDTH_MARGIN: f64 = 1.001;
/// A floor is flat as far as it rises by less than this, m.
const FLAT_M: f64 = 1e-3;
/// In a bend, what is as far to the inside as is allowed spans as much more chainage than of its own length.
const BEND: f64 = 2.0;

/// What a feature is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Boulder,
    Boulders,
    Bulge,
    Debris,
    Fall,
    Gate,
    Mesh,
    RockTrap,
    SideTunnel,
}

const KINDS: [(&str, Kind); 9] = [
    ("boulder", Kind::Boulder),
    ("boulders", Kind::Boulders),
    ("bulge", Kind::Bulge),
    ("debris", Kind::Debris),
    ("fall", Kind::Fall),
    ("gate", Kind::Gate),
    ("mesh", Kind::Mesh),
    ("rock_trap", Kind::RockTrap),
    ("side_tunnel", Kind::SideTunnel),
];

/// A shape, the feature that it belongs to, and the chainages that it reaches into, m.
#[derive(Debug, Clone)]
pub(super) struct Placed<S> {
    pub(super) shape: S,
    pub(super) feature: u16,
    pub(super) span_m: (f64, f64),
}

/// All that isn't wall.
#[derive(Debug, Clone, Default)]
pub(super) struct Features {
    pub(super) names: Vec<String>,
    pub(super) solids: Vec<Placed<Solid>>,
    pub(super) hollows: Vec<Placed<Hollow>>,
}

/// The tunnel before anything displaces its wall.
#[derive(Clone, Copy)]
pub(super) struct Site<'a> {
    pub(super) profile: &'a Profile,
    pub(super) scales: &'a Scales,
    pub(super) axis: &'a Axis,
    pub(super) length_m: f64,
    /// How far the largest section reaches to the sides of the axis, m.
    pub(super) half_width_m: f64,
}

/// The tunnel that features are placed in.
#[derive(Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) tube: &'a Tube,
    pub(super) length_m: f64,
}

/// Reads what isn't wall from the tables, whose wall [`super::heaps`] and [`super::meshes`] have read, and checks that no
/// key is left over. `bodies` are those that are meshes.
///
/// Errors: the first key that is missing, unknown or out of range, or what it describes can't be.
pub(super) fn parse(
    tables: Vec<Section<'_>>,
    heaps: &[Heap],
    bodies: Vec<Placed<Solid>>,
    tube: &Tube,
    length_m: f64,
) -> Result<Features, ConfigError> {
    let ground = Ground { tube, length_m };
    let mut features = Features { solids: bodies, ..Features::default() };
    for (number, table) in (0_u16..).zip(tables) {
        let kind = kind(&table)?;
        features.names.push(name(&table, number)?);
        match kind {
            Kind::Bulge | Kind::Mesh => {}
            Kind::Boulder => features.solids.push(boulders::one(&table, ground, number)?),
            Kind::Boulders => features.solids.extend(boulders::many(&table, ground, number)?),
            Kind::Debris | Kind::Fall => {
                let heap = heaps.iter().find(|heap| heap.feature == number);
                features.solids.extend(boulders::pieces(&table, ground, heap)?);
            }
            Kind::RockTrap => {
                let ditch = openings::rock_trap(&table, ground, number)?;
                features.hollows.push(ground.opening(&table, ditch)?);
            }
            Kind::SideTunnel => {
                let aside = openings::side_tunnel(&table, ground, number)?;
                features.hollows.push(ground.opening(&table, aside)?);
            }
            Kind::Gate => {
                let (slot, bulkhead) = openings::gate(&table, ground, number)?;
                features.hollows.push(ground.opening(&table, slot)?);
                features.solids.extend(bulkhead);
            }
        }
        table.finish()?;
    }
    Ok(features)
}

/// What a table's feature is.
///
/// Errors: the key is missing or another word.
pub(super) fn kind(table: &Section<'_>) -> Result<Kind, ConfigError> {
    table.required("kind", table.choice("kind", &KINDS)?)
}

/// Its name, or its kind and number.
fn name(table: &Section<'_>, number: u16) -> Result<String, ConfigError> {
    let given = table.text("name")?;
    if given.as_ref().is_some_and(|name| name.is_empty() || name.len() > 64) {
        return Err(table.invalid("name", "must have 1 to 64 letters"));
    }
    let kind = table.text("kind")?.unwrap_or_default();
    Ok(given.unwrap_or_else(|| format!("{kind}_{number}")))
}

/// The `chainage_m` of a feature's middle, m.
///
/// Errors: missing, or outside the tunnel.
pub(super) fn chainage_m(table: &Section<'_>, length_m: f64) -> Result<f64, ConfigError> {
    table.required("chainage_m", table.number("chainage_m", 0.0..=length_m)?)
}

/// A length that a feature must have.
///
/// Errors: missing or outside `allowed`.
pub(super) fn length_m(
    table: &Section<'_>,
    key: &'static str,
    allowed: core::ops::RangeInclusive<f64>,
) -> Result<f64, ConfigError> {
    table.required(key, table.number(key, allowed)?)
}

/// `chainage_m` and the extent `key` along the tunnel of a feature that must lie in the tunnel with all its length.
///
/// Errors: missing, out of range, or it reaches out of the tunnel.
pub(super) fn extent_m(
    table: &Section<'_>,
    key: &'static str,
    tunnel_m: f64,
) -> Result<(f64, f64), ConfigError> {
    let middle_m = chainage_m(table, tunnel_m)?;
    let extent_m = length_m(table, key, 0.01..=1000.0)?;
    if middle_m - extent_m / 2.0 < 0.0 || middle_m + extent_m / 2.0 > tunnel_m {
        let problem = format!("reaches out of the tunnel, which goes from 0 to {tunnel_m} m");
        return Err(table.invalid(key, &problem));
    }
    Ok((middle_m, extent_m))
}

impl Ground<'_> {
    /// The axis's frame at `chainage_m`: along the tunnel, left, up; the origin at place (y, z) of the section.
    pub(super) fn frame(&self, chainage_m: f64, [y, z]: [f64; 2]) -> Frame {
        Frame::across(self.tube.axis().station(chainage_m), [y, z])
    }

    /// The chainages within `reach_m` of a place of the tunnel at `chainage_m`, m.
    pub(super) fn span_m(&self, chainage_m: f64, reach_m: f64) -> (f64, f64) {
        span_m(self.tube.axis(), chainage_m, [-reach_m, reach_m])
    }

    /// The hollow, if the wall that it opens from is the tube's.
    fn opening(&self, table: &Section<'_>, hollow: Placed<Hollow>) -> Result<Placed<Hollow>, ConfigError> {
        let (from_m, to_m) = hollow.span_m;
        let Some(mesh) = self.tube.mesh_within(from_m, to_m) else { return Ok(hollow) };
        let problem = format!(
            "opens within {from_m:.3} to {to_m:.3} m, where the wall is the mesh of tunnel.features[{mesh}]"
        );
        Err(table.invalid("chainage_m", &problem))
    }
}

/// The chainages of what lies within `reach_m` (least, largest) along the axis's direction at `chainage_m`, m.
pub(super) fn span_m(axis: &Axis, chainage_m: f64, reach_m: [f64; 2]) -> (f64, f64) {
    let [back_m, ahead_m] = reach_m.map(|reach_m| if axis.is_straight() { reach_m } else { BEND * reach_m });
    (chainage_m + back_m, chainage_m + ahead_m)
}

/// The largest distance of the wall from the axis, to either side, m.
pub(super) fn half_width_m(profile: &Profile) -> f64 {
    WIDTH_MARGIN * places(profile).map(|[y, _]| y.abs()).fold(0.0, f64::max)
}

/// The width of a flat floor that is about as far to the left of its centre as to the right, m; `None` where it is curved.
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
