//! The environment of a simulated vehicle: the tunnel as built, with its contents and openings.
//!
//! The tunnel's frame is Cartesian with its origin at the portal: x along the axis of the first straight part, y left,
//! z up. In and after a bend, chainage and x differ; see [`Axis`].
//!
//! Water is every point that lies in the tube or in a hollow, but not in a solid. A ray from the water extends to the
//! tube's wall, continues through hollows that open at that point, and stops at the first solid. Only boulders and
//! roughness draw random numbers, each from a seed of its own.

mod axis;
mod boulders;
mod bulge;
mod features;
mod heaps;
mod index;
mod keys;
#[cfg(feature = "mesh")]
mod mesh_parts;
#[cfg(not(feature = "mesh"))]
#[path = "no_mesh_parts.rs"]
mod mesh_parts;
#[cfg(feature = "mesh")]
mod meshes;
#[cfg(not(feature = "mesh"))]
#[path = "no_meshes.rs"]
mod meshes;
mod openings;
mod placing;
mod rough;
mod scatter;
mod shapes;
mod stations;
mod steepness;
mod tube;
mod vector;
mod widths;

use headrace_config::{ConfigError, Loader, Section};
use headrace_geometry::frames::{Point3, Tunnel, Vec3};
use headrace_geometry::tunnel::Profile;
use headrace_vehicle::TunnelConfig;

pub use axis::Axis;

use crate::file_loader::FileLoader;
use features::Features;
use index::Index;
use placing::{Placed, Site};
use rough::Roughness;
use shapes::{Hollow, SKIN_M, Solid};
use stations::Scales;
use tube::Tube;
use vector::{Face, Ray, V3};

/// Largest length of a ray, m.
const FARTHEST_M: f64 = 1.0e5;
/// Minimum advance of a ray beyond the end of the previous hollow, m.
const PROGRESS_M: f64 = 1e-9;
/// Maximum number of hollows and stretches of tube that a ray passes through.
const MOST_PASSAGES: usize = 1_000;

/// The environment of a scene: the tunnel with its contents and openings.
#[derive(Debug, Clone)]
pub struct Environment {
    /// Profile in the vehicle file. Arc lengths of wall points are measured on this profile.
    design: Profile,
    tube: Tube,
    rough: Roughness,
    /// Whether the tunnel is straight, exactly as designed, and empty. If so, rays are cast against the profile alone.
    plain: bool,
    solids: Vec<Placed<Solid>>,
    hollows: Vec<Placed<Hollow>>,
    solids_by_chainage: Index,
    hollows_by_chainage: Index,
    names: Vec<String>,
}

/// End of a ray at the wall or at an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Range from the ray's origin, m. On a rough wall, the range includes the roughness.
    pub range_m: f64,
    /// Position of the hit. On a rough wall, the position lies on the smooth wall underneath.
    pub point: Point3<Tunnel>,
    /// Unit normal of the surface at the hit, towards the water.
    pub normal: Vec3<Tunnel>,
    /// Object that the ray hit.
    pub what: What,
}

/// Object that a ray hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The ray hits the tunnel's wall.
    Wall,
    /// The ray hits a feature, given by its number in the scene; see [`Environment::feature_name`].
    Feature(u16),
}

/// Obstacle that stops a ray. Its normal isn't computed yet.
#[derive(Debug, Clone, Copy)]
enum Stop {
    /// The tunnel's wall, with its face if the face is already computed.
    Wall(Option<Face>),
    Hollow {
        normal: V3,
        feature: u16,
    },
    Solid {
        normal: V3,
        feature: u16,
    },
}

/// Stretch of water along a ray, up to an obstacle or the end of the ray.
#[derive(Debug, Clone, Copy)]
struct Reach {
    t_m: f64,
    /// Obstacle that stops the ray; `None` if the ray ends in water.
    stop: Option<Stop>,
    /// Range of chainage that the ray passes, m.
    from_m: f64,
    to_m: f64,
}

impl Environment {
    /// Creates a straight, empty tunnel of the design profile.
    pub fn straight(profile: Profile) -> Self {
        let tube = Tube::new(Axis::straight(), profile.clone(), Scales::default(), Vec::new(), Vec::new());
        Self::new(profile, tube, Roughness::default(), true, Features::default())
    }

    /// Reads a scene's `[tunnel]` table, in which all keys are optional.
    ///
    /// `design` is the profile in the vehicle file, and `length_m` is the tunnel's length. `text` loads the text files
    /// that the table names; `load` loads all other files that it names.
    ///
    /// Errors: a key is missing, unknown or out of range, or the environment is impossible. Allocates: startup only.
    pub fn parse(
        section: Option<Section<'_>>,
        design: &Profile,
        length_m: f64,
        text: Loader<'_>,
        load: FileLoader<'_>,
    ) -> Result<Self, ConfigError> {
        let Some(section) = section else { return Ok(Self::straight(design.clone())) };
        let profile = match section.section("as_built")? {
            Some(as_built) => parse_as_built(&as_built, text)?,
            None => design.clone(),
        };
        let farthest_m = profile.farthest_m(profile.point_at(0.0));
        let scales = Scales::parse(section.sections("stations")?, farthest_m, length_m)?;
        let half_width_m = widths::half_width_m(&profile) * scales.largest();
        let axis = Axis::parse(section.sections("axis")?, half_width_m)?;
        let rough = Roughness::parse(section.sections("rough")?, length_m)?;
        let tables = section.sections("features")?;
        let plain = axis.is_straight() && tables.is_empty() && scales.is_one();
        let site = Site { profile: &profile, scales: &scales, axis: &axis, length_m, half_width_m };
        let (bulges, heaps) = heaps::parse(&tables, &site)?;
        let (walls, bodies) = meshes::parse(&tables, &site, &bulges, load)?;
        let tube = Tube::new(axis, profile, scales, bulges, walls);
        let features = features::parse(tables, &heaps, bodies, &tube, length_m)?;
        section.finish()?;
        Ok(Self::new(design.clone(), tube, rough, plain, features))
    }

    fn new(design: Profile, tube: Tube, rough: Roughness, plain: bool, features: Features) -> Self {
        let Features { names, solids, hollows } = features;
        let solids_by_chainage = Index::new(&solids.iter().map(|s| s.span_m).collect::<Vec<_>>());
        let hollows_by_chainage = Index::new(&hollows.iter().map(|h| h.span_m).collect::<Vec<_>>());
        Self { design, tube, rough, plain, solids, hollows, solids_by_chainage, hollows_by_chainage, names }
    }

    /// Area of the cross-section of the water where the profile is not scaled, m^2.
    pub(crate) fn area_m2(&self) -> f64 {
        const CORNERS: u32 = 1000;
        let profile = self.tube.profile();
        let corner = |k: u32| profile.point_at(profile.perimeter_m() * f64::from(k) / f64::from(CORNERS));
        let twice_m2 = (0..CORNERS).map(|k| {
            let ([a, b], [c, d]) = (corner(k), corner((k + 1) % CORNERS));
            a * d - c * b
        });
        twice_m2.sum::<f64>().abs() / 2.0
    }

    /// Names of the openings in the wall, each with the chainages between which the opening lies, m.
    pub(crate) fn openings(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        self.hollows.iter().map(|hollow| {
            let (from_m, to_m) = hollow.span_m;
            (self.feature_name(hollow.feature), [from_m, to_m])
        })
    }

    /// Chainages between which all bodies lie, m; `None` without bodies. Bodies are boulders, pieces of heaps and other
    /// solids.
    pub(crate) fn rubble_m(&self) -> Option<[f64; 2]> {
        let spans = self.solids.iter().map(|solid| solid.span_m);
        spans.fold(None, |all: Option<[f64; 2]>, (from_m, to_m)| {
            let [first_m, last_m] = all.unwrap_or([from_m, to_m]);
            Some([first_m.min(from_m), last_m.max(to_m)])
        })
    }

    /// Casts a ray from `origin` along the unit vector `direction` to at most `far_m`.
    ///
    /// `None` if the ray hits nothing or `origin` is not in the water. A ray that grazes a displaced or bent wall may
    /// cross up to 0.1 mm of the wall without a hit. All other results are exact. Allocates: no.
    #[inline]
    pub fn cast(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>, far_m: f64) -> Option<Hit> {
        if !self.plain {
            return self.cast_among_features(origin, direction, far_m);
        }
        let hit = self.tube.profile().cast([origin.y(), origin.z()], [direction.y(), direction.z()])?;
        let (range_m, [y, z]) = (hit.range_m, hit.normal);
        let point = origin + direction.scaled(range_m);
        let hit = Hit { range_m, point, normal: Vec3::new(0.0, y, z), what: What::Wall };
        (range_m <= far_m).then(|| self.roughened(hit, direction, || point.x()))
    }

    fn cast_among_features(
        &self,
        origin: Point3<Tunnel>,
        direction: Vec3<Tunnel>,
        far_m: f64,
    ) -> Option<Hit> {
        let ray = ray(origin, direction);
        let reach = self.reach(&ray, far_m)?;
        let point = ray.at(reach.t_m);
        let (normal, what) = match reach.stop? {
            Stop::Wall(face) => {
                let face = face.unwrap_or_else(|| self.tube.face(point));
                (face.normal, face.feature.map_or(What::Wall, What::Feature))
            }
            Stop::Hollow { normal, feature } | Stop::Solid { normal, feature } => {
                (normal, What::Feature(feature))
            }
        };
        let hit = Hit { range_m: reach.t_m, point: to_point(point), normal: to_vec(normal), what };
        Some(if what == What::Wall {
            let chainage_m = || {
                let [chainage_m, ..] = self.axis().chart(hit.point);
                chainage_m
            };
            self.roughened(hit, direction, chainage_m)
        } else {
            hit
        })
    }

    /// Replaces the range to the smooth wall by the range to the rough wall.
    ///
    /// The point stays on the smooth wall, because it must remain certain on which side of the point the water is.
    fn roughened(&self, hit: Hit, direction: Vec3<Tunnel>, chainage_m: impl FnOnce() -> f64) -> Hit {
        let cosine = -direction.dot(&hit.normal);
        let deeper_m = self.rough.deeper_m(hit.point, (hit.range_m, cosine), chainage_m);
        Hit { range_m: hit.range_m + deeper_m, ..hit }
    }

    /// Range to the smooth wall, m. This function is faster than [`Environment::cast`].
    ///
    /// Allocates: no.
    pub fn range_m(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>, far_m: f64) -> Option<f64> {
        if self.plain {
            let hit = self.tube.profile().cast([origin.y(), origin.z()], [direction.y(), direction.z()])?;
            return (hit.range_m <= far_m).then_some(hit.range_m);
        }
        let reach = self.reach(&ray(origin, direction), far_m)?;
        reach.stop.map(|_| reach.t_m)
    }

    /// Whether `point` is in the water.
    pub fn is_water(&self, point: Point3<Tunnel>) -> bool {
        let at = [point.x(), point.y(), point.z()];
        let open = self.tube.contains(at) || self.hollows.iter().any(|hollow| hollow.shape.contains(at));
        open && self.solid_around(at).is_none()
    }

    /// First obstruction between two points, or a hit at zero range if `from` is not in the water.
    pub fn first_obstruction(&self, from: Point3<Tunnel>, to: Point3<Tunnel>) -> Option<Hit> {
        let between = to - from;
        let length_m = between.norm();
        if !self.is_water(from) {
            let back =
                if length_m > 0.0 { between.scaled(-1.0 / length_m) } else { Vec3::new(0.0, 0.0, 1.0) };
            let inside = self.solid_around([from.x(), from.y(), from.z()]);
            let what = inside.map_or(What::Wall, What::Feature);
            return Some(Hit { range_m: 0.0, point: from, normal: back, what });
        }
        if length_m > 0.0 { self.cast(from, between.scaled(1.0 / length_m), length_m) } else { None }
    }

    /// The axis of the tunnel.
    pub fn axis(&self) -> &Axis {
        self.tube.axis()
    }

    /// Arc length of a point on the unrolled wall of the design profile, m.
    ///
    /// The point is projected along the ray from the reference point of its cross-section. Source:
    /// docs/reference/glossary.md, "Tunnel and wall".
    pub fn arc_m(&self, point: Point3<Tunnel>) -> f64 {
        let [_, y, z] = self.axis().chart(point);
        self.design.arc_of([y, z])
    }

    /// Names of the features in the order of the scene.
    pub fn features(&self) -> &[String] {
        &self.names
    }

    /// Name of a feature; empty if the number is unknown.
    pub fn feature_name(&self, index: u16) -> &str {
        self.names.get(usize::from(index)).map_or("", String::as_str)
    }

    /// Stretch of water along the ray, up to an obstacle or to `far_m`; `None` if the ray starts outside the water.
    fn reach(&self, ray: &Ray, far_m: f64) -> Option<Reach> {
        let far_m = far_m.min(FARTHEST_M);
        let mut reach = match self.tube.leave(ray, 0.0, far_m) {
            Some(passage) => {
                let [a, b] = passage.chainages_m;
                let stop = passage.wall.then_some(Stop::Wall(passage.face));
                Reach { t_m: passage.t_m, stop, from_m: a.min(b), to_m: a.max(b) }
            }
            None => self.start_in_hollow(ray)?,
        };
        if !self.hollows.is_empty() && reach.stop.is_some() {
            self.go_on_through_hollows(ray, far_m, &mut reach);
        }
        for number in self.solids_by_chainage.near(reach.from_m, reach.to_m) {
            let Some(solid) = self.solids.get(*number as usize) else { continue };
            if let Some((t_m, normal)) = solid.shape.meet(ray).filter(|(t_m, _)| *t_m < reach.t_m) {
                reach.t_m = t_m;
                reach.stop = Some(Stop::Solid { normal, feature: solid.feature });
            }
        }
        // A range of zero means that the ray starts inside a solid.
        let in_solid = reach.t_m <= 0.0 && matches!(reach.stop, Some(Stop::Solid { .. }));
        (!in_solid).then_some(reach)
    }

    fn start_in_hollow(&self, ray: &Ray) -> Option<Reach> {
        let around = |hollow: &&Placed<Hollow>| hollow.shape.contains(ray.origin);
        let hollow = self.hollows.iter().find(around)?;
        // The reported wall is provisional. It makes the caller search for hollows at range 0, so that the caller finds
        // the hollow that contains the origin.
        Some(Reach { t_m: 0.0, stop: Some(Stop::Wall(None)), from_m: hollow.span_m.0, to_m: hollow.span_m.1 })
    }

    /// Extends a ray from the end of the tube through the hollows there, and through any tube beyond the hollows.
    fn go_on_through_hollows(&self, ray: &Ray, far_m: f64, reach: &mut Reach) {
        for _ in 0..MOST_PASSAGES {
            let before_m = reach.t_m;
            let Some(hollow) = self.longest_hollow(ray, reach) else { return };
            let (t_m, normal, hollow) = hollow;
            reach.t_m = t_m.min(far_m);
            reach.stop = (t_m <= far_m).then_some(Stop::Hollow { normal, feature: hollow.feature });
            reach.from_m = reach.from_m.min(hollow.span_m.0);
            reach.to_m = reach.to_m.max(hollow.span_m.1);
            if reach.stop.is_none() {
                return;
            }
            // A hollow may end on the tube's wall itself. The search for the tube therefore starts `SKIN_M` farther on.
            if let Some(passage) = self.tube.leave(ray, reach.t_m + SKIN_M, far_m)
                && passage.t_m > reach.t_m + PROGRESS_M
            {
                let [a, b] = passage.chainages_m;
                reach.t_m = passage.t_m;
                reach.stop = passage.wall.then_some(Stop::Wall(passage.face));
                reach.from_m = reach.from_m.min(a).min(b);
                reach.to_m = reach.to_m.max(a).max(b);
            }
            if reach.stop.is_none() || reach.t_m <= before_m + PROGRESS_M {
                return;
            }
        }
    }

    /// Finds, among the hollows at the end of the ray, the hollow in which the ray gets farthest. Returns the range of
    /// the hollow's end, the normal there, and the hollow.
    fn longest_hollow(&self, ray: &Ray, reach: &Reach) -> Option<(f64, V3, &Placed<Hollow>)> {
        let on_wall = matches!(reach.stop, Some(Stop::Wall(_))) && reach.t_m > 0.0;
        // The index lists hollows by the chainage of their openings. Deeper in the rock, a ray may pass into any other
        // hollow, so all hollows are searched there.
        let (near, all) = if on_wall {
            (self.hollows_by_chainage.near(reach.from_m, reach.to_m), &[][..])
        } else {
            (&[][..], self.hollows.as_slice())
        };
        let near = near.iter().filter_map(|number| self.hollows.get(*number as usize));
        near.chain(all)
            .filter_map(|hollow| {
                hollow.shape.leave(ray, reach.t_m).map(|(t_m, normal)| (t_m, normal, hollow))
            })
            .filter(|(t_m, ..)| *t_m > reach.t_m + PROGRESS_M)
            .max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Number of the feature whose solid contains `point`; `None` if no solid contains it.
    fn solid_around(&self, point: V3) -> Option<u16> {
        let [chainage_m, ..] = self.axis().chart(to_point(point));
        let near = self.solids_by_chainage.near(chainage_m, chainage_m).iter();
        let mut solids = near.filter_map(|number| self.solids.get(*number as usize));
        solids.find(|solid| solid.shape.contains(point)).map(|solid| solid.feature)
    }
}

fn parse_as_built(section: &Section<'_>, load: Loader<'_>) -> Result<Profile, ConfigError> {
    if section.keys().contains(&"length_m") {
        return Err(section.invalid("length_m", "isn't allowed here; the vehicle file gives the length"));
    }
    Ok(TunnelConfig::from_section(section, load)?.profile)
}

fn ray(origin: Point3<Tunnel>, direction: Vec3<Tunnel>) -> Ray {
    Ray {
        origin: [origin.x(), origin.y(), origin.z()],
        direction: [direction.x(), direction.y(), direction.z()],
    }
}

fn to_point([x, y, z]: V3) -> Point3<Tunnel> {
    Point3::new(x, y, z)
}

fn to_vec([x, y, z]: V3) -> Vec3<Tunnel> {
    Vec3::new(x, y, z)
}

#[cfg(test)]
mod tests;
