//! Reads the `[[tunnel.features]]` tables of a scene.

use headrace_config::{ConfigError, Section};

use super::heaps::Heap;
use super::keys::{self, Kind};
use super::placing::{Ground, Placed};
use super::shapes::{Hollow, Solid};
use super::tube::Tube;
use super::{boulders, openings};

/// All features of a tunnel except displaced wall.
#[derive(Debug, Clone, Default)]
pub(super) struct Features {
    pub(super) names: Vec<String>,
    pub(super) solids: Vec<Placed<Solid>>,
    pub(super) hollows: Vec<Placed<Hollow>>,
}

/// Reads all features except displaced wall, and checks that no key is left over.
///
/// [`super::heaps`] has already read the displaced wall, and [`super::meshes`] the meshes. `bodies` are the meshes in
/// the water.
///
/// Errors: a key is missing, unknown or out of range, or a feature is impossible.
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
        table.part(|| features.add(&table, number, ground, heaps))?;
    }
    Ok(features)
}

impl Features {
    fn add(
        &mut self,
        table: &Section<'_>,
        number: u16,
        ground: Ground<'_>,
        heaps: &[Heap],
    ) -> Result<(), ConfigError> {
        let kind = keys::kind(table)?;
        self.names.push(keys::name(table, number)?);
        match kind {
            Kind::Bulge | Kind::Mesh => {}
            Kind::Boulder => self.solids.push(boulders::one(table, ground, number)?),
            Kind::Boulders => self.solids.extend(boulders::many(table, ground, number)?),
            Kind::Debris | Kind::Fall => {
                let heap = heaps.iter().find(|heap| heap.feature == number);
                self.solids.extend(boulders::pieces(table, ground, heap)?);
            }
            Kind::RockTrap => {
                let ditch = openings::rock_trap(table, ground, number)?;
                self.hollows.push(opening(ground, table, ditch)?);
            }
            Kind::SideTunnel => {
                let aside = openings::side_tunnel(table, ground, number)?;
                self.hollows.push(opening(ground, table, aside)?);
            }
            Kind::Gate => {
                let (slot, bulkhead) = openings::gate(table, ground, number)?;
                self.hollows.push(opening(ground, table, slot)?);
                self.solids.extend(bulkhead);
            }
        }
        table.finish()
    }
}

/// Returns the hollow `hollow` if it opens from the tube's wall.
///
/// Errors: the hollow opens from a mesh.
fn opening(
    ground: Ground<'_>,
    table: &Section<'_>,
    hollow: Placed<Hollow>,
) -> Result<Placed<Hollow>, ConfigError> {
    let (from_m, to_m) = hollow.span_m;
    let Some(mesh) = ground.tube.mesh_within(from_m, to_m) else { return Ok(hollow) };
    let problem = format!(
        "opens within {from_m:.3} to {to_m:.3} m, where the wall is the mesh of tunnel.features[{mesh}]"
    );
    Err(table.invalid("chainage_m", &problem))
}
