//! Echoes heard through side lobes.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Tunnel, Vec3};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::{square_to, squareness};
use super::occlusion::Stopped;
use super::places::Places;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::environment::Environment;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Ray, Rays, Reach, Samples, Scenery};
use crate::stages::Stage;

/// Some ranges come from side lobes that meet the wall nearer and more perpendicularly than the beam.
///
/// There are four side lobes, two in the plane of turning and two across that plane. With the probability `share`, the
/// sonar reports the shortest range of these lobes. Keys, with defaults in brackets:
/// - `from_m` and `to_m` of the stretch in which this happens.
/// - `angle_deg`, the angle of the side lobes from the beam's axis, from 0.1 to 80 (1.59 times the beam's width).
/// - `share`, the probability, from 0 (excluded) to 1 (0.05).
///
/// Source: the first side lobe of a circular piston, ka sin x = 5.136 against 1.616 at half power (Urick, "Principles
/// of underwater sound", ch. 3). The side lobe is 17.6 dB weaker than the beam, so it matters where the wall reflects
/// the beam itself away.
pub(super) struct SideLobesKind;

/// Angle from the beam's axis to the first side lobe, as a multiple of the beam's full width.
const LOBE_WIDTHS: f64 = 5.136 / 1.616 / 2.0;
/// Full width of an echosounder's beam, degrees; see the effect beam_cone.
const ECHOSOUNDER_DEG: f64 = 30.0;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    angle_deg: Option<f64>,
    share: f64,
}

#[derive(Component)]
struct SideLobes {
    places: Places<Lobes>,
    stream: Stream,
}

/// Side lobes in a stretch of the tunnel: their angle from the beam's axis, and the share of pings in which they are
/// heard.
#[derive(Debug, Clone, Copy)]
struct Lobes {
    angle_rad: f64,
    share: f64,
}

impl EffectKind for SideLobesKind {
    fn name(&self) -> &'static str {
        "side_lobes"
    }

    fn summary(&self) -> &'static str {
        "a nearer wall beside the beam is detected instead of the wall within it"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let share = table.number("share", 0.0..=1.0)?.unwrap_or(0.05);
            if share == 0.0 {
                return Err(table.invalid("share", "must be above zero"));
            }
            Ok(Parameters { angle_deg: table.number("angle_deg", 0.1..=80.0)?, share })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let head = sim.facts().sensors.get(*source).and_then(|sensor| sensor.head);
            let beam_rad = head.map_or(ECHOSOUNDER_DEG.to_radians(), |spec| spec.beam_rad);
            let places = places.map(|Parameters { angle_deg, share }| Lobes {
                angle_rad: angle_deg.map_or(LOBE_WIDTHS * beam_rad, f64::to_radians),
                share: *share,
            });
            let stream = sim.stream(*source);
            sim.insert(*source, SideLobes { places, stream });
        }
        sim.system(Stage::Hear, hear_lobes);
        Ok(())
    }
}

/// Shortest range of a side lobe, m. Only those lobes count that meet the wall nearer than `near_m` and more
/// perpendicularly than the beam's axis.
fn lobe_m(environment: &Environment, ray: &Ray, angle_rad: f64, near_m: f64) -> Option<f64> {
    let least = ray.hit.map_or(0.0, |hit| squareness(ray.direction, hit.normal));
    let (sine, cosine) = math::sin_cos(angle_rad);
    let [first, second] = square_to(ray.direction);
    let lobe = |across: Vec3<Tunnel>| {
        let direction = ray.direction.scaled(cosine) + across.scaled(sine);
        let hit = environment.cast(ray.origin, direction, near_m)?;
        (squareness(direction, hit.normal) > least).then_some(hit.range_m)
    };
    let lobes = [first, -first, second, -second];
    lobes.into_iter().filter_map(lobe).filter(|range_m| *range_m < near_m).min_by(f64::total_cmp)
}

type Lobed<'a> = (&'a mut Samples<Sounding>, &'a Rays, &'a Reach, &'a SideLobes, Option<&'a Stopped>);

fn hear_lobes(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Lobed<'_>>) {
    for (mut samples, rays, reach, lobes, stopped) in &mut sonars {
        for (number, ((step, sounding), ray)) in samples.steps().zip(&rays.0).enumerate() {
            let Some(Lobes { angle_rad, share }) = lobes.places.here(&scenery, ray) else { continue };
            let [chance, _] = lobes.stream.at(step).uniform();
            if chance >= *share || Stopped::has(stopped, number) {
                continue;
            }
            let near_m = sounding.range_m.unwrap_or(reach.0);
            let heard_m = lobe_m(&scenery.environment, ray, *angle_rad, near_m);
            sounding.range_m = heard_m.or(sounding.range_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Dive, assert_share};

    #[test]
    fn inner_side_lobe_of_oblique_beam_is_heard() {
        let dive = Dive::with_head();
        let effects = "[effects.side_lobes]\nangle_deg = 8\nshare = 1";
        let lobe_rad = f64::to_radians(8.0);
        let mut heard = 0;
        for ((angle_rad, range_m), was) in
            dive.dive(effects).soundings(0).into_iter().zip(dive.dive("").ranges_m(0))
        {
            let (range_m, was_m) = (range_m.unwrap(), was.unwrap());
            // Beams within 50 degrees of the perpendicular to the floor hit the floor. Within 42 degrees, all their
            // lobes hit it too.
            let off_rad = math::wrap_signed(angle_rad, math::TAU).abs();
            if off_rad.to_degrees() < 42.0 {
                // A lobe nearer to the perpendicular than the beam has the shorter range and the smaller incidence.
                let inner_rad = (off_rad - lobe_rad).abs();
                let expected_m = if inner_rad < off_rad { 2.5 / math::cos(inner_rad) } else { was_m };
                assert!((range_m - expected_m).abs() < 1e-9, "{}", off_rad.to_degrees());
                heard += usize::from(range_m < was_m);
            }
            assert!(range_m <= was_m);
        }
        assert!(heard > 80, "{heard}");
    }

    #[test]
    fn side_lobes_are_heard_only_in_the_given_share_of_oblique_beams() {
        let dive = Dive { seconds: 500.0, ..Dive::with_head() };
        let (mut oblique, mut taken) = (0, 0);
        for row in &dive.dive("[effects.side_lobes]\nshare = 0.2").rows {
            let off_deg =
                math::wrap_signed(row.sounding.unwrap().measured.angle_rad, math::TAU).abs().to_degrees();
            if (2.0..45.0).contains(&off_deg) {
                (oblique, taken) = (oblique + 1, taken + usize::from(!row.causes.is_empty()));
            }
            assert!(off_deg > 0.5 || row.causes.is_empty());
        }
        assert_share(taken, oblique, 0.2);
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.side_lobes]\nshare = 0.5");
    }

    #[test]
    fn missing_share_and_extreme_angles_are_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.side_lobes]\n{keys}"));
        assert!(refusal("share = 0").contains("must be above zero"));
        assert!(refusal("angle_deg = 90").contains("from 0.1 to 80"));
        assert!(refusal("level = 0.1").contains("is not a key here"));
    }
}
