//! Speed of sound that changes with height in the tunnel.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::places::Places;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::{Rays, Samples, Scenery};
use crate::stages::Stage;

/// The speed of sound changes linearly with the height above the tunnel's floor, as in water with warm layers above
/// cold layers.
///
/// Devices compute ranges with the vehicle file's speed. The error of a range depends on the mean slowness along the
/// path. Keys, with defaults in brackets, besides `from_m` and `to_m` of the stretch: the speed at the floor,
/// `floor_mps`, from 1300 to 1700 (the file's), and its change per metre of height, `per_metre_mps`, from -50 to 50
/// (0). A difference of one degree changes the speed by about 4 m/s.
///
/// Bending of the ray isn't simulated. The ray's radius of curvature is the speed divided by the gradient: 300 m at 5
/// m/s per metre, or 2 degrees over 10 m of range. Source: Urick, "Principles of underwater sound", ch. 5 (travel time
/// in a constant gradient).
pub(super) struct SoundSpeedProfileKind;

/// Relative difference below which two speeds of sound count as equal.
const SAME: f64 = 1e-9;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    floor_mps: f64,
    per_metre_mps: f64,
    /// Speed of sound in the vehicle file, m/s.
    assumed_mps: f64,
}

#[derive(Component)]
struct SoundSpeedProfile(Places<Parameters>);

impl EffectKind for SoundSpeedProfileKind {
    fn name(&self) -> &'static str {
        "sound_speed_profile"
    }

    fn summary(&self) -> &'static str {
        "the speed of sound is higher in warm water above than in cold water below"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let floor_mps = table.number("floor_mps", 1300.0..=1700.0)?;
            let per_metre_mps = table.number("per_metre_mps", -50.0..=50.0)?;
            if floor_mps.is_none() && per_metre_mps.is_none() {
                return Err(table.invalid("floor_mps", "is missing; give floor_mps, per_metre_mps or both"));
            }
            Ok(Parameters {
                floor_mps: floor_mps.unwrap_or(facts.sound_speed_mps),
                per_metre_mps: per_metre_mps.unwrap_or(0.0),
                assumed_mps: facts.sound_speed_mps,
            })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            sim.insert(*source, SoundSpeedProfile(places.clone()));
        }
        sim.system(Stage::Hear, rescale);
        Ok(())
    }
}

impl Parameters {
    /// Ratio of reported to true range for a sonar at height `from_z_m` and an echo from height `to_z_m`.
    fn scale(&self, from_z_m: f64, to_z_m: f64) -> f64 {
        // Far above or below the floor, a linear profile would reach zero. Speeds are therefore never below a third of
        // the speed at the floor.
        let at_mps = |z_m: f64| (self.floor_mps + self.per_metre_mps * z_m).max(self.floor_mps / 3.0);
        let [from_mps, to_mps] = [from_z_m, to_z_m].map(at_mps);
        let faster = to_mps / from_mps - 1.0;
        let slowness = if faster.abs() < SAME { 1.0 } else { math::ln(1.0 + faster) / faster };
        self.assumed_mps / from_mps * slowness
    }
}

fn rescale(
    scenery: Res<'_, Scenery>,
    mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &Rays, &SoundSpeedProfile)>,
) {
    for (mut samples, rays, SoundSpeedProfile(places)) in &mut sonars {
        for (sounding, ray) in samples.list.iter_mut().zip(&rays.0) {
            let (Some(range_m), Some(profile)) = (&mut sounding.range_m, places.here(&scenery, ray)) else {
                continue;
            };
            let from_m = ray.origin.z();
            *range_m *= profile.scale(from_m, from_m + ray.direction.z() * *range_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Dive;

    /// Compares the ranges with the travel time summed over ten thousand pieces of the path.
    #[test]
    fn reported_ranges_are_travel_time_times_the_configured_speed() {
        let mut dive = Dive::with_head();
        dive.vehicle = "[water]\nsound_speed_mps = 1447";
        for (keys, floor_mps, per_metre) in [
            ("floor_mps = 1430\nper_metre_mps = 4", 1430.0, 4.0),
            ("per_metre_mps = -12", 1447.0, -12.0),
            ("floor_mps = 1480", 1480.0, 0.0),
        ] {
            let (plain, with) = (dive.dive(""), dive.dive(&format!("[effects.sound_speed_profile]\n{keys}")));
            for (row, seen) in plain.rows.iter().zip(with.ranges_m(0)).step_by(7) {
                let sounding = row.sounding.unwrap();
                let range_m = sounding.measured.range_m.unwrap();
                let parts = 10_000;
                let slowness = |part: i32| {
                    let way_m = range_m * (f64::from(part) + 0.5) / f64::from(parts);
                    1.0 / (floor_mps + per_metre * (sounding.origin.z() + sounding.direction.z() * way_m))
                };
                let mean = (0..parts).map(slowness).sum::<f64>() / f64::from(parts);
                let expected_m = range_m * mean * 1447.0;
                assert!((seen.unwrap() - expected_m).abs() < 1e-8, "{keys}: {seen:?} {expected_m}");
            }
        }
    }

    /// At a gradient of -50 m/s per metre, the speed would be zero about thirty metres up. The mean slowness is
    /// therefore computed with speeds of at least a third of the speed at the floor.
    #[test]
    fn speed_of_sound_never_falls_below_a_third_of_the_speed_at_the_tunnel_floor() {
        let profile = Parameters { floor_mps: 1440.0, per_metre_mps: -50.0, assumed_mps: 1440.0 };
        let expected = 1.5 * math::ln(3.0);
        for height_m in [20.0, 40.0, 400.0] {
            let scale = profile.scale(0.0, height_m);
            assert!((scale / expected - 1.0).abs() < 0.01, "{height_m} m: {scale}, not {expected}");
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.sound_speed_profile]\nper_metre_mps = 3");
        let refusal = Dive::with_head().refusal("[effects.sound_speed_profile]");
        assert!(refusal.contains("is missing; give floor_mps, per_metre_mps or both"), "{refusal}");
    }
}
