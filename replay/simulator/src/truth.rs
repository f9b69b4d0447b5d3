//! Ground truth: for each measurement, the vehicle's pose, the point of the wall that the beam hits, and the changes by
//! effects.

use bevy_ecs::entity::Entity;
use bevy_ecs::prelude::World;
use headrace_geometry::frames::{Point3, Pose, Tunnel, Vec3};
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::{GroundVelocity, Inertia, Measurement, Payout, Pressure, Sounding};

use crate::environment::Hit;
use crate::notes::{Note, Notes};
use crate::sensing::{Echosounder, Rays, Samples, Scenery, Source};

/// Ground truth of one measurement.
#[derive(Debug, Clone, PartialEq)]
pub struct TruthRow {
    /// Time of the measurement.
    pub at: MonoNs,
    /// Number of the sensor in the vehicle file.
    pub source: u16,
    /// Quantity that the sensor measures.
    pub sense: Sense,
    /// Number of the measurement among all measurements of its sensor.
    pub number: u64,
    /// True pose of the vehicle.
    pub pose: Pose,
    /// True chainage of the vehicle, m.
    pub chainage_m: f64,
    /// Ground truth of the ping, if the sensor is a sonar.
    pub sounding: Option<SoundingTruth>,
    /// Changes of the measurement by effects, in order.
    pub causes: Vec<Cause>,
}

/// Ground truth of a ping, with its measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SoundingTruth {
    /// Measurement of the ping: true and reported beam angle, and range.
    pub measured: Sounding,
    /// True position of the sonar.
    pub origin: Point3<Tunnel>,
    /// Direction of the beam's axis, a unit vector.
    pub direction: Vec3<Tunnel>,
    /// True hit of the beam's axis, and the hit's arc length on the design profile, m; `None` if the beam hits nothing.
    pub wall: Option<(Hit, f64)>,
}

impl TruthRow {
    /// Hit of the beam's axis, and the hit's arc length on the design profile, m; `None` for a sensor other than a
    /// sonar.
    pub fn wall(&self) -> Option<(Hit, f64)> {
        self.sounding.and_then(|sounding| sounding.wall)
    }
}

impl SoundingTruth {
    /// The point at the measured range on the true beam axis.
    pub fn measured_point(&self) -> Option<Point3<Tunnel>> {
        self.measured.range_m.map(|range_m| self.origin + self.direction.scaled(range_m))
    }
}

/// A change of a measurement by an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cause {
    /// Index of the effect in the scene's list of effects.
    pub effect: u16,
    /// Name of the value that the effect changed, with its unit.
    pub what: &'static str,
    /// The value before the change; NaN if there was none.
    pub from: f64,
    /// The value after the change.
    pub to: f64,
}

/// Adds the ground truth of the slice's measurements to `rows`, sensor by sensor.
pub(crate) fn collect(world: &mut World, entities: &[Entity], rows: &mut Vec<TruthRow>) {
    let mut notes =
        world.get_resource_mut::<Notes>().map(|mut notes| std::mem::take(&mut notes.0)).unwrap_or_default();
    notes.sort_by_key(|note| (note.source, note.sample));
    let Some(scenery) = world.get_resource::<Scenery>() else { return };
    for entity in entities {
        let Some(Source(source)) = world.get::<Source>(*entity).copied() else { continue };
        let from = notes.partition_point(|note| note.source < source);
        let to = notes.partition_point(|note| note.source <= source);
        let base = Base { scenery, source, notes: notes.get(from..to).unwrap_or_default() };
        if let (Some(samples), Some(rays)) =
            (world.get::<Samples<Sounding>>(*entity), world.get::<Rays>(*entity))
        {
            let echosounder = world.get::<Echosounder>(*entity).is_some();
            let sense = if echosounder { Sense::Echosounder } else { Sense::Head };
            for (row, (sounding, ray)) in base.rows(samples, sense).zip(samples.list.iter().zip(&rays.0)) {
                let wall = ray.hit.map(|hit| (hit, scenery.environment.arc_m(hit.point)));
                let (measured, origin, direction) = (*sounding, ray.origin, ray.direction);
                let sounding = Some(SoundingTruth { measured, origin, direction, wall });
                rows.push(TruthRow { sounding, ..row });
            }
        }
        if let Some(samples) = world.get::<Samples<Pressure>>(*entity) {
            rows.extend(base.rows(samples, Sense::Depth));
        }
        if let Some(samples) = world.get::<Samples<Inertia>>(*entity) {
            rows.extend(base.rows(samples, Sense::Inertial));
        }
        if let Some(samples) = world.get::<Samples<GroundVelocity>>(*entity) {
            rows.extend(base.rows(samples, Sense::Velocity));
        }
        if let Some(samples) = world.get::<Samples<Payout>>(*entity) {
            rows.extend(base.rows(samples, Sense::Tether));
        }
    }
}

struct Base<'a> {
    scenery: &'a Scenery,
    source: u16,
    notes: &'a [Note],
}

impl<'a> Base<'a> {
    fn rows<M: Measurement>(
        &'a self,
        samples: &'a Samples<M>,
        sense: Sense,
    ) -> impl Iterator<Item = TruthRow> + 'a {
        (samples.first..).zip(samples.list.iter().enumerate()).map(move |(number, (sample, measured))| {
            let at = measured.at();
            let from = self.notes.partition_point(|note| note.sample < sample);
            let notes = self.notes.iter().skip(from).take_while(|note| note.sample == sample);
            let cause =
                |note: &Note| Cause { effect: note.effect, what: note.what, from: note.from, to: note.to };
            TruthRow {
                at,
                source: self.source,
                sense,
                number,
                pose: self.scenery.pose(at),
                chainage_m: self.scenery.chainage_m(at),
                sounding: None,
                causes: notes.map(cause).collect(),
            }
        })
    }
}
