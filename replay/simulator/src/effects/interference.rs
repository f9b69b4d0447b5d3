//! Interference between heads that share a frequency.

mod pings;

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Point3, Tunnel};
use headrace_geometry::math;
use headrace_geometry::time::MonoNs;
use headrace_sampling::head::HeadSpec;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::between_rad;
use super::occlusion::Stopped;
use super::targets::PerSensor;
use super::targets::targets;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Ray, Rays, Samples, Scenery, Slice, Source};
use crate::stages::Stage;
use pings::{Ping, Pings};

/// Heads that share a frequency hear each other. A head takes the first sound after its own ping as its echo.
///
/// Another head's ping arrives by reflection at the point where the other beam meets the wall, or directly if the other
/// beam points at this head's body. The ping's apparent range is (c (t_other - t_own) + path) / 2, with the speed of
/// sound c and the times t of both pings. The head reports the apparent range if it is less than the range of the
/// head's own echo, and not less than the head's least range.
///
/// The ping is always heard if it arrives within this head's beam. Otherwise it is heard through side lobes with the
/// probability `share`. A wall point is within the beam if its angle from the axis is at most half the beam's width
/// plus a margin. The other head is within the beam if its angle is at most half the beam's width plus half the angular
/// size of the other head's body.
///
/// Keys, with defaults in brackets:
/// - `sensors`, two or more heads that share a frequency (all heads). There is one table per frequency.
/// - `share`, the probability of hearing through side lobes, from 0 to 1 (0).
/// - `margin_deg`, from 0 to 45. The default is half the other head's beam width, since the insonified patch is that
///   wide.
///
/// Heads whose bodies overlap are idealised. They don't hear each other. Pings of another head that begin while a head
/// is already listening are extrapolated from the two pings before. The extrapolation is wrong for one or two pings
/// when a head reverses.
///
/// Source: Jorge et al. 2021, §10; core/sampling/src/interference.rs, in which the planner uses the same two paths.
pub(super) struct InterferenceKind;

/// Upper bound of the distance between heads, m. Vehicle files place each head within 20 m of the body's origin in x, y
/// and z, so two heads are at most 69.3 m apart.
const APART_M: f64 = 70.0;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    /// Number of the group to which the head belongs. Heads in one group share a frequency.
    frequency: usize,
    share: f64,
    margin_rad: Option<f64>,
}

/// A head in a group of heads that share a frequency.
#[derive(Component)]
struct Hears {
    parameters: Parameters,
    spec: HeadSpec,
    stream: Stream,
    pings: Pings,
}

impl EffectKind for InterferenceKind {
    fn name(&self) -> &'static str {
        "interference"
    }

    fn summary(&self) -> &'static str {
        "heads on the same frequency receive each other's pings"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let mut frequency = 0;
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Head], |table| {
            frequency += 1;
            let mut sensors = targets(table, facts, &[Sense::Head])?;
            sensors.dedup();
            if sensors.len() < 2 {
                return Err(table.invalid_itself("has one head; at least two are needed"));
            }
            let share = table.number("share", 0.0..=1.0)?.unwrap_or(0.0);
            let margin_rad = table.number("margin_deg", 0.0..=45.0)?.map(f64::to_radians);
            Ok(Parameters { frequency, share, margin_rad })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let Some(spec) = sim.facts().sensors.get(*source).and_then(|sensor| sensor.head) else {
                continue;
            };
            let stream = sim.stream(*source);
            let hears = Hears { parameters: *parameters, spec, stream, pings: Pings::default() };
            sim.insert(*source, hears);
        }
        sim.system(Stage::Hear, remember);
        sim.system(Stage::Hear, listen);
        Ok(())
    }
}

/// Adds the pings of the present slice to their heads' lists, and drops old pings that no head can hear any more.
fn remember(
    slice: Res<'_, Slice>,
    scenery: Res<'_, Scenery>,
    mut heads: Query<'_, '_, (&Samples<Sounding>, &Rays, &mut Hears, Option<&Stopped>)>,
) {
    for (samples, rays, mut hears, stopped) in &mut heads {
        let rings_s = (2.0 * hears.rings_m() + APART_M) / scenery.site.sound_speed_mps;
        hears.pings.forget(slice.from, rings_s);
        for (number, (sounding, ray)) in samples.list.iter().zip(&rays.0).enumerate() {
            hears.pings.add(Ping::new(sounding.at, ray, Stopped::has(stopped, number)));
        }
    }
}

type Listening<'a> = (&'a Source, &'a mut Samples<Sounding>, &'a Rays, &'a Hears, Option<&'a Stopped>);

fn listen(
    scenery: Res<'_, Scenery>,
    others: Query<'_, '_, (&Source, &Hears)>,
    mut heads: Query<'_, '_, Listening<'_>>,
) {
    let sound_mps = scenery.site.sound_speed_mps;
    for (source, mut samples, rays, hears, stopped) in &mut heads {
        let [near_m, far_m] = hears.spec.reach_m(sound_mps);
        for (number, ((step, sounding), ray)) in samples.steps().zip(&rays.0).enumerate() {
            let mut ear = Ear {
                scenery: &scenery,
                hears,
                at: sounding.at,
                ray,
                stopped: Stopped::has(stopped, number),
                step,
                within_m: [near_m, sounding.range_m.unwrap_or(far_m)],
                heard: false,
            };
            for (other, sounds) in &others {
                if other != source && sounds.parameters.frequency == hears.parameters.frequency {
                    ear.hear(u64::from(other.0), sounds);
                }
            }
            if ear.heard {
                sounding.range_m = Some(ear.within_m[1]);
            }
        }
    }
}

/// A head that listens for echoes after its own ping.
struct Ear<'a> {
    scenery: &'a Scenery,
    hears: &'a Hears,
    at: MonoNs,
    ray: &'a Ray,
    stopped: bool,
    step: u64,
    /// Least and largest range at which the head takes a sound as its echo, m. Each sound that the head takes lowers
    /// its largest range.
    within_m: [f64; 2],
    /// Whether this head has taken another head's ping as its echo.
    heard: bool,
}

impl Ear<'_> {
    /// Listens for the pings of another head.
    fn hear(&mut self, other: u64, sounds: &Hears) {
        let apart_m = (sounds.spec.mount.position + -self.hears.spec.mount.position).norm();
        if apart_m <= sounds.spec.body.radius_m.max(self.hears.spec.body.radius_m) {
            return;
        }
        let sound_mps = self.scenery.site.sound_speed_mps;
        let earliest_s = -(2.0 * sounds.rings_m() + apart_m) / sound_mps;
        let latest_s = 2.0 * self.within_m[1] / sound_mps;
        let far_m = sounds.rings_m();
        for ping in sounds.pings.around(self.at, earliest_s, latest_s) {
            let ping = ping.seen(&self.scenery.environment, far_m);
            let later_m = ping.at.since(self.at).as_secs_f64() * sound_mps;
            self.by_the_wall(other, sounds, &ping, later_m);
            self.straight(other, sounds, &ping, later_m);
        }
    }

    /// Considers a ping that arrives by reflection at the wall.
    fn by_the_wall(&mut self, other: u64, sounds: &Hears, ping: &Ping, later_m: f64) {
        let Some(wall) = ping.wall else { return };
        let range_m = (later_m + (wall - ping.origin).norm() + (wall - self.ray.origin).norm()) / 2.0;
        if !self.comes_first(range_m) {
            return;
        }
        let Parameters { share, margin_rad, .. } = self.hears.parameters;
        let margin_rad = margin_rad.unwrap_or(sounds.spec.beam_rad / 2.0);
        let within = !self.stopped && self.off_rad(wall) <= self.hears.spec.beam_rad / 2.0 + margin_rad;
        if within || self.hears.stream.block(self.step, other).uniform()[0] < share {
            self.take(range_m);
        }
    }

    /// Considers a ping that arrives directly, from a head whose beam points at this head.
    fn straight(&mut self, other: u64, sounds: &Hears, ping: &Ping, later_m: f64) {
        let way_m = (ping.origin - self.ray.origin).norm();
        let range_m = f64::midpoint(later_m, way_m);
        if !self.comes_first(range_m) {
            return;
        }
        let half_rad =
            |beam: &HeadSpec, body: &HeadSpec| beam.beam_rad / 2.0 + math::asin(body.body.radius_m / way_m);
        let (own, theirs) = (&self.hears.spec, &sounds.spec);
        if between_rad(ping.direction, self.ray.origin - ping.origin) > half_rad(theirs, own) {
            return;
        }
        let within = self.off_rad(ping.origin) <= half_rad(own, theirs);
        if within || self.hears.stream.block(self.step, other).uniform()[1] < self.hears.parameters.share {
            self.take(range_m);
        }
    }

    /// Whether a sound with this apparent range arrives before all sounds heard so far. Sounds with a range below the
    /// head's least range don't count.
    fn comes_first(&self, range_m: f64) -> bool {
        range_m >= self.within_m[0] && range_m < self.within_m[1]
    }

    fn take(&mut self, range_m: f64) {
        (self.within_m[1], self.heard) = (range_m, true);
    }

    /// Angle of a point from the beam's axis, radians.
    fn off_rad(&self, place: Point3<Tunnel>) -> f64 {
        between_rad(self.ray.direction, place - self.ray.origin)
    }
}

impl Hears {
    /// Upper bound of the distance to a wall that still reflects this head's sound audibly, m.
    fn rings_m(&self) -> f64 {
        // The factor 1.5 allows for another speed of sound. It is larger than the ratio of any two speeds of sound in
        // water.
        self.spec.range_m[1] * 1.5
    }
}

#[cfg(test)]
mod tests;
