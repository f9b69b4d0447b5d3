//! Occlusion of beams by parts of the vehicle.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Body, Mount, Vec3, head_direction};
use headrace_sampling::occlusion::Obstacle;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::{Echosounder, Mounted, Samples};
use crate::stages::Stage;

/// Parts of the vehicle occlude beams. Bodies of other heads, boxes of the hull and the tether return an echo instead
/// of the wall.
///
/// If the part is nearer than the sonar's least range, there is no return. Keys, with defaults in brackets:
/// - `heads` (true), `hull` (true) and `tether` (false): whether these occlude beams.
/// - for the tether, which is a straight cylinder: `tether_from_m`, its start in the body's frame (required);
///   `tether_towards`, its direction ([-1, 0, 0], aft); `tether_length_m`, from 0.1 to 500 (20); `tether_radius_m`,
///   from 0.001 to 0.1 (0.006).
///
/// Only the beam's axis is tested. A wide beam is therefore occluded over the same angle as a narrow one, and not
/// gradually. A body doesn't occlude a head inside it, so idealised heads in one place don't occlude each other.
///
/// Source: core/sampling/src/occlusion.rs, in which the planner uses the same bodies.
pub(super) struct OcclusionKind;

#[derive(Debug, Clone)]
struct Parameters {
    heads: bool,
    hull: bool,
    tether: Option<Obstacle>,
}

#[derive(Component)]
struct Occlusion {
    obstacles: Vec<Obstacle>,
}

/// For each beam of the present slice, whether a part of the vehicle stops the beam before the wall. Effects that run
/// later use this list.
#[derive(Debug, Clone, Default, Component)]
pub(super) struct Stopped(Vec<bool>);

impl Stopped {
    /// Whether a part of the vehicle stops the beam of a sample. False for a sonar on which the effect occlusion
    /// doesn't act.
    pub(super) fn has(stopped: Option<&Self>, sample: usize) -> bool {
        stopped.and_then(|stopped| stopped.0.get(sample)).copied().unwrap_or(false)
    }
}

impl EffectKind for OcclusionKind {
    fn name(&self) -> &'static str {
        "occlusion"
    }

    fn summary(&self) -> &'static str {
        "other heads, the hull and the tether block beams"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            let flag = |key, usual| table.boolean(key).map(|flag| flag.unwrap_or(usual));
            let parameters =
                Parameters { heads: flag("heads", true)?, hull: flag("hull", true)?, tether: tether(table)? };
            if !parameters.heads && !parameters.hull && parameters.tether.is_none() {
                return Err(table.invalid_itself("has neither heads, hull nor tether that occlude beams"));
            }
            Ok(parameters)
        })?))
    }
}

fn tether(table: &Section<'_>) -> Result<Option<Obstacle>, ConfigError> {
    let there = table.boolean("tether")?.unwrap_or(false);
    let from = table.triple("tether_from_m", -20.0..=20.0)?;
    let towards = table.triple("tether_towards", -1.0e3..=1.0e3)?;
    let length = table.number("tether_length_m", 0.1..=500.0)?;
    let radius = table.number("tether_radius_m", 0.001..=0.1)?;
    if !there {
        let keys = ["tether_from_m", "tether_towards", "tether_length_m", "tether_radius_m"];
        let given = [from.is_some(), towards.is_some(), length.is_some(), radius.is_some()];
        let idle = keys.iter().zip(given).find(|(_, given)| *given);
        return idle
            .map_or(Ok(None), |(key, _)| Err(table.invalid(key, "has an effect only with tether = true")));
    }
    let vector = |[x, y, z]: [f64; 3]| Vec3::<Body>::new(x, y, z);
    let from = vector(table.required("tether_from_m", from)?);
    let towards = vector(towards.unwrap_or([-1.0, 0.0, 0.0]));
    if towards.norm() < 1e-6 {
        return Err(table.invalid("tether_towards", "must be a direction of some length"));
    }
    let along = towards.scaled(length.unwrap_or(20.0) / towards.norm());
    Ok(Some(Obstacle::Cylinder { from, along, radius_m: radius.unwrap_or(0.006) }))
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let obstacles = parameters.obstacles(*source, sim.facts());
            sim.insert(*source, Occlusion { obstacles });
            sim.insert(*source, Stopped::default());
        }
        sim.system(Stage::Look, stop);
        Ok(())
    }
}

impl Parameters {
    /// Parts of the vehicle that may occlude a sonar.
    fn obstacles(&self, source: usize, facts: &Facts) -> Vec<Obstacle> {
        let others = facts.sensors.iter().enumerate().filter(|(other, _)| self.heads && *other != source);
        let bodies = others.filter_map(|(_, sensor)| sensor.head.as_ref().map(Obstacle::of_head));
        let hull = facts.hull.iter().copied().filter(|_| self.hull);
        bodies.chain(hull).chain(self.tether).collect()
    }
}

impl Occlusion {
    /// Range of the first obstacle that a beam meets, m. `None` if the beam meets none.
    fn range_m(&self, mount: &Mount, direction: Vec3<Body>) -> Option<f64> {
        let entered =
            self.obstacles.iter().filter_map(|obstacle| obstacle.enters_m(mount.position, direction));
        entered.min_by(f64::total_cmp)
    }
}

type Occluded<'a> =
    (&'a mut Samples<Sounding>, &'a Mounted, &'a Occlusion, &'a mut Stopped, Option<&'a Echosounder>);

fn stop(mut sonars: Query<'_, '_, Occluded<'_>>) {
    for (mut samples, Mounted(mount), occlusion, mut stopped, echosounder) in &mut sonars {
        stopped.0.clear();
        for sounding in &mut samples.list {
            let beam = match echosounder {
                Some(_) => Vec3::new(1.0, 0.0, 0.0),
                None => head_direction(sounding.angle_rad),
            };
            let obstacle_m = occlusion.range_m(mount, mount.rotation * beam);
            let first = obstacle_m.filter(|near_m| sounding.range_m.is_none_or(|wall_m| *near_m < wall_m));
            stopped.0.push(first.is_some());
            sounding.range_m = first.or(sounding.range_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use crate::testing::Dive;

    fn side_by_side() -> Dive {
        Dive::with_heads(&[[0.5, 0.15, 0.0], [0.5, -0.15, 0.0]])
    }

    #[test]
    fn neighbour_occludes_an_angle_of_two_asin_radius_over_distance() {
        let dive = side_by_side();
        let scene = dive.scene("").unwrap();
        let radius_m = scene.facts.sensors[1].head.unwrap().body.radius_m;
        let (base, dived) = (dive.dive(""), dive.dive("[effects.occlusion]"));
        let half_rad = math::asin(radius_m / 0.3);
        let mut hidden = 0;
        for ((angle_rad, range_m), wall_m) in dived.soundings(0).into_iter().zip(base.ranges_m(0)) {
            // The other head is to the right of the tested head, at 270 degrees.
            let off_rad = math::wrap_signed(angle_rad - 1.5 * math::PI, math::TAU);
            if off_rad.abs() < half_rad {
                // Range at which the beam meets a circle of this radius, whose centre is 0.3 m from the sonar.
                let across_m = 0.3 * math::sin(off_rad);
                let depth_m = math::sqrt(radius_m * radius_m - across_m * across_m);
                let near_m = 0.3 * math::cos(off_rad) - depth_m;
                assert!((range_m.unwrap() - near_m).abs() < 1e-12);
                hidden += 1;
            } else {
                assert_eq!(range_m, wall_m);
            }
        }
        assert!(hidden > 10, "{hidden}");
        assert!(dived.rows.iter().all(|row| row.wall().is_some()));
    }

    #[test]
    fn heads_in_one_place_do_not_occlude_each_other() {
        let dive = Dive::with_heads(&[[0.0; 3], [0.0; 3]]);
        assert_eq!(dive.dive("").messages, dive.dive("[effects.occlusion]").messages);
    }

    #[test]
    fn hull_and_tether_occlude_only_if_enabled() {
        let below = Dive {
            vehicle: "[[hull]]\nleast_m = [-1, -0.3, -1]\nmost_m = [1, 0.3, -0.5]",
            ..Dive::with_head()
        };
        let nearest = |effects: &str| {
            let ranges_m = below.dive(effects).ranges_m(0);
            ranges_m.into_iter().flatten().reduce(f64::min).unwrap()
        };
        assert!((nearest("[effects.occlusion]") - 0.5).abs() < 1e-12);
        let tether = "[effects.occlusion]\nhull = false\ntether = true\ntether_from_m = [0, 0, 0.4]\n\
                      tether_towards = [0, 0, 2]\ntether_radius_m = 0.05\n";
        assert!((nearest(tether) - 0.4).abs() < 1e-12);
        let along = "[effects.occlusion]\nhull = false\ntether = true\ntether_from_m = [0.5, 0, 1]\n\
                     tether_radius_m = 0.05\n";
        assert!((nearest(along) - 0.95).abs() < 1e-12);
        assert!((nearest("[effects.occlusion]\nhull = false") - 2.5).abs() < 1e-12);
    }

    #[test]
    fn echosounder_is_occluded_along_its_own_axis() {
        let mut dive = Dive::with_sounder();
        dive.vehicle = "[[hull]]\nleast_m = [-1, 0.4, -1]\nmost_m = [1, 0.8, 1]";
        let ranges_m = dive.dive("[effects.occlusion]").ranges_m(0);
        assert!(ranges_m.iter().all(|range_m| (range_m.unwrap() - 0.4).abs() < 1e-12));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        side_by_side().assert_slices_dont_matter("[effects.occlusion]");
    }

    #[test]
    fn occlusion_without_obstacles_is_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.occlusion]\n{keys}"));
        assert!(refusal("heads = false\nhull = false").contains("has neither"));
        assert!(refusal("tether = true").contains("tether_from_m"));
        assert!(refusal("tether_length_m = 3").contains("only with tether = true"));
        let nowhere = "tether = true\ntether_from_m = [0, 0, 1]\ntether_towards = [0, 0, 0]";
        assert!(refusal(nowhere).contains("direction of some length"));
        assert!(refusal("boulders = true").contains("is not a key here"));
    }
}
