//! The environment of a simulated vehicle: the tunnel as built, and what lies in it and opens from it.
//!
//! The tunnel's frame is Cartesian with its origin at the portal: x along the axis where that is straight, y left, z up.
//! Where the axis bends, chainage and x differ; see [`Axis`].
//!
//! Water is (tube or hollows) without solids. A ray from the water goes to the tube's wall, on through the hollows that
//! open there, and stops at the first solid before. Nothing here draws random numbers but boulders, from a seed.

mod axis;
mod boulders;
mod bulge;
mod face;
mod features;
mod frame;
mod ground;
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
mod shapes;
mod stations;
mod steepness;
mod tube;
mod vector;
mod widths;

use headrace_config::Loader;
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Point3, Tunnel, Vec3};
use headrace_geometry::tunnel::Profile;
use headrace_vehicle::TunnelConfig;

pub use axis::Axis;

use crate::files::FileLoader;
use face::Face;
use features::Features;
use index::Index;
use placing::{Placed, Site};
use shapes::{Hollow, SKIN_M, Solid};
use stations::Scales;
use tube::Tube;
use vector::{Ray, V3};

/// Rays are followed no farther than this, m.
const FARTHEST_M: f64 = 1.0e5;
/// Water on from the end of the last hollow must go farther than this, m.
const PROGRESS_M: f64 = 1e-9;
/// Hollows and stretches of tube that a ray may go through.
const MOST_PASSAGES: usize = 1_000;

/// The environment of a scene.
#[derive(Debug, Clone)]
pub struct Environment {
    /// What the vehicle believes, in whose chart places of the wall are told.
    design: Profile,
    tube: Tube,
    /// Straight, as designed, and empty: then the profile alone says it all.
    plain: bool,
    solids: Vec<Placed<Solid>>,
    hollows: Vec<Placed<Hollow>>,
    solids_by_chainage: Index,
    hollows_by_chainage: Index,
    names: Vec<String>,
}

/// Where a ray ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance, m.
    pub range_m: f64,
    /// The place.
    pub point: Point3<Tunnel>,
    /// Unit normal there, towards the water.
    pub normal: Vec3<Tunnel>,
    /// What is there.
    pub what: What,
}

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// The tunnel's wall.
    Wall,
    /// A feature, by its number in the scene; see [`Environment::feature_name`].
    Feature(u16),
}

/// What stops a ray, before its normal is worked out.
#[derive(Debug, Clone, Copy)]
enum Stop {
    /// The tunnel's, and what it is there when that is known already.
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

/// How far a ray has water.
#[derive(Debug, Clone, Copy)]
struct Reach {
    t_m: f64,
    /// What is there; none when it is still water.
    stop: Option<Stop>,
    /// The chainages that it has passed, m.
    from_m: f64,
    to_m: f64,
}

impl Environment {
    /// A straight tunnel of the design profile, and nothing in it.
    pub fn straight(profile: Profile) -> Self {
        let tube = Tube::new(Axis::straight(), profile.clone(), Scales::default(), Vec::new(), Vec::new());
        Self::new(profile, tube, true, Features::default())
    }

    /// Reads a scene's `[tunnel]` table, all of whose keys may be left out. `design` is the vehicle file's profile, and
    /// `length_m` the tunnel's length. `text` gives the text of a file that the table names, `load` the content of one that
    /// needn't be text.
    ///
    /// Errors: the first key that is missing, unknown or out of range, or what it describes can't be.
    /// Allocates: startup only.
    pub fn parse(
        section: Option<Section<'_>>,
        design: &Profile,
        length_m: f64,
        text: Loader<'_>,
        load: FileLoader<'_>,
    ) -> Result<Self, ConfigError> {
        let Some(section) = section else { return Ok(Self::straight(design.clone())) };
        let profile = match section.section("as_built")? {
            Some(as_built) => parse_as_built(as_built, text)?,
            None => design.clone(),
        };
        let farthest_m = profile.farthest_m(profile.point_at(0.0));
        let scales = Scales::parse(section.sections("stations")?, farthest_m, length_m)?;
        let half_width_m = widths::half_width_m(&profile) * scales.largest();
        let axis = Axis::parse(section.sections("axis")?, half_width_m)?;
        let tables = section.sections("features")?;
        let plain = axis.is_straight() && tables.is_empty() && scales.is_one();
        let site = Site { profile: &profile, scales: &scales, axis: &axis, length_m, half_width_m };
        let (bulges, heaps) = heaps::parse(&tables, &site)?;
        let (walls, bodies) = meshes::parse(&tables, &site, &bulges, load)?;
        let tube = Tube::new(axis, profile, scales, bulges, walls);
        let features = features::parse(tables, &heaps, bodies, &tube, length_m)?;
        section.finish()?;
        Ok(Self::new(design.clone(), tube, plain, features))
    }

    fn new(design: Profile, tube: Tube, plain: bool, features: Features) -> Self {
        let Features { names, solids, hollows } = features;
        let solids_by_chainage = Index::new(&solids.iter().map(|s| s.span_m).collect::<Vec<_>>());
        let hollows_by_chainage = Index::new(&hollows.iter().map(|h| h.span_m).collect::<Vec<_>>());
        Self { design, tube, plain, solids, hollows, solids_by_chainage, hollows_by_chainage, names }
    }

    /// What the ray from `origin` along the unit vector `direction` meets within `far_m`; `None` where there is nothing,
    /// or when the origin isn't in the water.
    ///
    /// A ray that grazes what is displaced or bent may cross up to 0.1 mm of it unnoticed; elsewhere it is exact.
    /// Allocates: no.
    #[inline]
    pub fn cast(&self, origin: Point3<Tunnel>, direction: Vec3<Tunnel>, far_m: f64) -> Option<Hit> {
        if !self.plain {
            return self.cast_among_features(origin, direction, far_m);
        }
        let hit = self.tube.profile().cast([origin.y(), origin.z()], [direction.y(), direction.z()])?;
        let (range_m, [y, z]) = (hit.range_m, hit.normal);
        (range_m <= far_m).then(|| Hit {
            range_m,
            point: origin + direction.scaled(range_m),
            normal: Vec3::new(0.0, y, z),
            what: What::Wall,
        })
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
        Some(Hit { range_m: reach.t_m, point: to_point(point), normal: to_vec(normal), what })
    }

    /// The distance of [`Environment::cast`] alone, m, for less.
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

    /// What stands between two places; when `from` isn't in the water itself, a hit at no distance.
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

    /// The axis.
    pub fn axis(&self) -> &Axis {
        self.tube.axis()
    }

    /// Arc length of a place on the unrolled wall of the design profile, m: the ray from its reference point, in the axis's
    /// chart.
    ///
    /// Source: metrics.md, "The unrolled wall".
    pub fn arc_m(&self, point: Point3<Tunnel>) -> f64 {
        let [_, y, z] = self.axis().chart(point);
        self.design.arc_of([y, z])
    }

    /// Names of the features, in the order of the scene.
    pub fn features(&self) -> &[String] {
        &self.names
    }

    /// Name of a feature; empty for a number that isn't one's.
    pub fn feature_name(&self, index: u16) -> &str {
        self.names.get(usize::from(index)).map_or("", String::as_str)
    }

    /// How far the ray has water, at most to `far_m`, and what is there; `None` from outside the water.
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
        // Met at once: the ray begins inside.
        let in_solid = reach.t_m <= 0.0 && matches!(reach.stop, Some(Stop::Solid { .. }));
        (!in_solid).then_some(reach)
    }

    fn start_in_hollow(&self, ray: &Ray) -> Option<Reach> {
        let around = |hollow: &&Placed<Hollow>| hollow.shape.contains(ray.origin);
        let hollow = self.hollows.iter().find(around)?;
        // The wall behind it is no wall, since the loop that goes on from here finds the hollow first.
        Some(Reach { t_m: 0.0, stop: Some(Stop::Wall(None)), from_m: hollow.span_m.0, to_m: hollow.span_m.1 })
    }

    /// From where the tube ends, through the hollows there, and through what tube they lead back to.
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
            // A hollow may end on the wall itself: the tube begins a hair farther on.
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

    /// Of the hollows at the ray's end, the one that leads farthest on: to where, the normal there, and which.
    fn longest_hollow(&self, ray: &Ray, reach: &Reach) -> Option<(f64, V3, &Placed<Hollow>)> {
        let on_wall = matches!(reach.stop, Some(Stop::Wall(_))) && reach.t_m > 0.0;
        // The index knows hollows by where they open into the tunnel; deeper in the rock, each may meet any other.
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

    /// The feature whose solid holds a place.
    fn solid_around(&self, point: V3) -> Option<u16> {
        let [chainage_m, ..] = self.axis().chart(to_point(point));
        let near = self.solids_by_chainage.near(chainage_m, chainage_m).iter();
        let mut solids = near.filter_map(|number| self.solids.get(*number as usize));
        solids.find(|solid| solid.shape.contains(point)).map(|solid| solid.feature)
    }
}

fn parse_as_built(section: Section<'_>, load: Loader<'_>) -> Result<Profile, ConfigError> {
    if section.keys().contains(&"length_m") {
        return Err(section.invalid("length_m", "isn't wanted here; the vehicle file gives the length"));
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
