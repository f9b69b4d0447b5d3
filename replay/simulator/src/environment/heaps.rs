//! Features that displace the wall: bulges, falls of rock from the vault, heaps of debris.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_geometry::tunnel::Profile;

use super::axis::LEAST_RADIUS_HALF_WIDTHS;
use super::bulge::Bulge;
use super::keys::{self, Kind};
use super::placing::Site;
use super::widths::floor_m;

/// Largest displacement of the wall towards the profile's reference point, as a share of the wall's distance from the
/// reference point.
const DEEPEST_SHARE: f64 = 0.8;
/// Largest ratio of the depth of a displaced patch to its length and width. It limits the steepness of the wall to
/// 57.5 degrees.
const DEEPEST_ASPECT: f64 = 1.0;
/// Ratio of the volume of fallen rock to the volume of its cavity.
const LOOSENING: f64 = 1.5;
/// Ratio of the length of the fallen heap to the length of its cavity.
const SPREADING: f64 = 1.5;
/// Number of points across a displaced patch at which the wall's distance is evaluated.
const PLACES: u32 = 64;

/// Area over which the boulders of a heap are scattered.
#[derive(Debug, Clone, Copy)]
pub(super) struct Heap {
    /// Number of the feature that the heap belongs to.
    pub(super) feature: u16,
    /// Chainage of the heap's middle, m.
    pub(super) chainage_m: f64,
    /// Extent of the heap along the tunnel, m.
    pub(super) length_m: f64,
    /// Extent of the heap along the floor, m.
    pub(super) width_m: f64,
}

/// Reads displacements of the wall from the tables of features. Ignores other keys and features.
///
/// Errors: a key is missing or out of range, or the wall is impossible.
pub(super) fn parse(tables: &[Section<'_>], site: &Site<'_>) -> Result<(Vec<Bulge>, Vec<Heap>), ConfigError> {
    let (mut bulges, mut heaps) = (Vec::new(), Vec::new());
    for (number, table) in tables.iter().enumerate() {
        let feature = u16::try_from(number)
            .map_err(|_| table.invalid("kind", "exceeds the limit of 65536 features"))?;
        table.part(|| {
            match keys::kind(table)? {
                Kind::Bulge => add(&mut bulges, parse_bulge(table, site, feature)?, table, site)?,
                Kind::Debris => {
                    let (bulge, heap) = parse_debris(table, site, feature)?;
                    add(&mut bulges, bulge, table, site)?;
                    heaps.push(heap);
                }
                Kind::Fall => {
                    let (cavity, bulge, heap) = parse_fall(table, site, feature)?;
                    add(&mut bulges, cavity, table, site)?;
                    add(&mut bulges, bulge, table, site)?;
                    heaps.push(heap);
                }
                _ => {}
            }
            Ok(())
        })?;
    }
    Ok((bulges, heaps))
}

fn parse_bulge(table: &Section<'_>, site: &Site<'_>, feature: u16) -> Result<Bulge, ConfigError> {
    let (chainage_m, length_m) = keys::extent_m(table, "length_m", site.length_m)?;
    let width_m = keys::length_m(table, "width_m", 0.01..=site.profile.perimeter_m())?;
    let depth_m = keys::length_m(table, "depth_m", -50.0..=50.0)?;
    if depth_m == 0.0 {
        return Err(table.invalid("depth_m", "must not be 0: inwards is positive, outwards negative"));
    }
    let arc_m = table.number("arc_m", -500.0..=500.0)?.unwrap_or_else(|| crown_m(site.profile));
    Ok(Bulge {
        feature,
        chainage_m,
        half_length_m: length_m / 2.0,
        arc_m,
        half_width_m: width_m / 2.0,
        depth_m,
    })
}

fn parse_debris(table: &Section<'_>, site: &Site<'_>, feature: u16) -> Result<(Bulge, Heap), ConfigError> {
    let (chainage_m, length_m) = keys::extent_m(table, "length_m", site.length_m)?;
    let height_m = keys::length_m(table, "height_m", 0.01..=50.0)?;
    let width_m = table.number("width_m", 0.01..=site.profile.perimeter_m())?;
    let width_m = width_m.unwrap_or_else(|| floor_m(site.profile));
    let heap = Heap { feature, chainage_m, length_m, width_m };
    Ok((heap.bulge(height_m), heap))
}

/// Reads a fall of rock: the cavity in the vault, and the heap of rock below it.
fn parse_fall(
    table: &Section<'_>,
    site: &Site<'_>,
    feature: u16,
) -> Result<(Bulge, Bulge, Heap), ConfigError> {
    let mut cavity = parse_bulge(table, site, feature)?;
    if cavity.depth_m < 0.0 {
        return Err(table.invalid("depth_m", "must be more than 0: a fall's cavity goes outwards anyway"));
    }
    let length_m = SPREADING * 2.0 * cavity.half_length_m;
    let heap = Heap { feature, chainage_m: cavity.chainage_m, length_m, width_m: floor_m(site.profile) };
    // Cavity and heap have the same shape. Their volumes are therefore proportional to the products of their extents.
    let volume = cavity.depth_m * cavity.half_length_m * cavity.half_width_m * 4.0;
    let usual_m = LOOSENING * volume / (heap.length_m * heap.width_m);
    let height_m = table.number("heap_height_m", 0.01..=50.0)?.unwrap_or(usual_m);
    cavity.depth_m = -cavity.depth_m;
    Ok((cavity, heap.bulge(height_m), heap))
}

impl Heap {
    fn bulge(&self, height_m: f64) -> Bulge {
        Bulge {
            feature: self.feature,
            chainage_m: self.chainage_m,
            half_length_m: self.length_m / 2.0,
            arc_m: 0.0,
            half_width_m: self.width_m / 2.0,
            depth_m: height_m,
        }
    }
}

/// Adds a bulge to `bulges` if the wall and the earlier bulges leave room for it.
fn add(
    bulges: &mut Vec<Bulge>,
    bulge: Bulge,
    table: &Section<'_>,
    site: &Site<'_>,
) -> Result<(), ConfigError> {
    let refuse = |problem: String| {
        let key = if table.keys().contains(&"height_m") { "height_m" } else { "depth_m" };
        Err(table.invalid(key, &problem))
    };
    let depth_m = bulge.depth_m.abs();
    let (length_m, width_m) = (2.0 * bulge.half_length_m, 2.0 * bulge.half_width_m);
    if depth_m > DEEPEST_ASPECT * length_m.min(width_m) {
        return refuse(format!(
            "makes a patch {depth_m:.3} m deep, {length_m:.3} m long and {width_m:.3} m wide; it must be at least as long \
             and as wide as it is deep"
        ));
    }
    let perimeter_m = site.profile.perimeter_m();
    let near = || bulges.iter().filter(|other| other.overlaps(&bulge, perimeter_m));
    if bulge.depth_m > 0.0 {
        let inwards_m = bulge.depth_m + near().map(|other| other.depth_m.max(0.0)).sum::<f64>();
        let least_m = DEEPEST_SHARE * nearest_wall_m(&bulge, site);
        if inwards_m > least_m {
            return refuse(format!(
                "moves the wall by {inwards_m:.3} m, together with the patches that overlap it; at most {least_m:.3} m is \
                 allowed, so that the wall keeps away from the profile's reference point"
            ));
        }
    } else {
        let outwards_m = near().map(|other| (-other.depth_m).max(0.0)).sum::<f64>() - bulge.depth_m;
        let reach_m = site.half_width_m + outwards_m;
        let curvature_pm = site.axis.largest_curvature_pm();
        if reach_m * LEAST_RADIUS_HALF_WIDTHS * curvature_pm > 1.0 {
            let radius_m = 1.0 / curvature_pm;
            return refuse(format!(
                "lets the tunnel reach {reach_m:.3} m to the side; the tightest bend has a radius of {radius_m:.3} m, and at most half of that is allowed"
            ));
        }
    }
    bulges.push(bulge);
    Ok(())
}

/// Minimum distance from the profile's reference point to the wall that the bulge displaces, before the displacement,
/// m.
fn nearest_wall_m(bulge: &Bulge, site: &Site<'_>) -> f64 {
    let [ry, rz] = site.profile.reference();
    let distance_m = |k: u32| {
        let share = 2.0 * f64::from(k) / f64::from(PLACES) - 1.0;
        let [y, z] = site.profile.point_at(bulge.arc_m + share * bulge.half_width_m);
        math::hypot(y - ry, z - rz)
    };
    let least_m = (0..=PLACES).map(distance_m).fold(f64::INFINITY, f64::min);
    least_m * site.scales.smallest(bulge.begin_m(), bulge.end_m())
}

/// Arc length of the wall vertically above the profile's reference point, m.
fn crown_m(profile: &Profile) -> f64 {
    let [y, z] = profile.reference();
    profile.arc_of([y, z + 1.0])
}
