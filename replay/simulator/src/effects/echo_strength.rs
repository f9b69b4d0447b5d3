//! Decides whether a head detects an echo, by the echo's strength.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_sampling::head::HeadSpec;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::squareness;
use super::occlusion::Stopped;
use super::places::Places;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Rays, Samples, Scenery};
use crate::stages::Stage;
pub(crate) use sonar::{Silt, Sonar, frequency_of_khz, pulse_of_us, water_absorption_dbpm};

mod sonar;

/// A head detects an echo that is louder than the noise and, after amplification, louder than its threshold.
///
/// The echo of a rough wall is the sum of many echoes. Its power is exponentially distributed about the mean given by
/// the sonar equation. A ping therefore gets a return with probability exp(-1 / m), where m is the mean power divided
/// by the power that is just detected.
///
/// Keys, with defaults in brackets, in addition to `from_m` and `to_m` of the stretch:
/// - the water's `temperature_degc`, 0 to 40 (10), and its silt, `silt_gpl` in grams per litre, 0 to 100 (0), with
///   grains of radius `grain_um`, 0.5 to 100 (10). Water and silt absorb sound.
/// - the wall's backscatter relative to rough rock, `wall_db`, -60 to 20 (0).
/// - the head's settings: `frequency_khz`, 600 to 1000 (that of its beam's width), `pulse_us`, 10 to 1000 (that of its
///   range setting), `gain_db`, 0 to 40 (20), `log_gain_db`, 10 to 40 (20), and `absorption_dbpm`, 0 to 2.55 (0.6 above
///   837 kHz, else 0.2).
///
/// Source: the sonar equation and Lambert's law after Urick, "Principles of underwater sound", ch. 2 and 8; figures of
/// the 881L family where [`sonar`] names them.
pub(super) struct EchoStrengthKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    temperature_degc: f64,
    silt: Silt,
    wall_db: f64,
    frequency_khz: Option<f64>,
    pulse_us: Option<f64>,
    gain_db: f64,
    log_gain_db: f64,
    absorption_dbpm: Option<f64>,
}

#[derive(Component)]
struct EchoStrength {
    places: Places<Sonar>,
    stream: Stream,
}

impl EffectKind for EchoStrengthKind {
    fn name(&self) -> &'static str {
        "echo_strength"
    }

    fn summary(&self) -> &'static str {
        "weak echoes aren't detected: at long range, at grazing angles or through silt"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &[Sense::Head], |table| {
            let or = |key, allowed, usual| Ok(table.number(key, allowed)?.unwrap_or(usual));
            Ok(Parameters {
                temperature_degc: or("temperature_degc", 0.0..=40.0, 10.0)?,
                silt: Silt {
                    gpl: or("silt_gpl", 0.0..=100.0, 0.0)?,
                    grain_m: or("grain_um", 0.5..=100.0, 10.0)? * 1e-6,
                },
                wall_db: or("wall_db", -60.0..=20.0, 0.0)?,
                frequency_khz: table.number("frequency_khz", 600.0..=1000.0)?,
                pulse_us: table.number("pulse_us", 10.0..=1000.0)?,
                gain_db: or("gain_db", 0.0..=40.0, 20.0)?,
                log_gain_db: or("log_gain_db", 10.0..=40.0, 20.0)?,
                absorption_dbpm: table.number("absorption_dbpm", 0.0..=2.55)?,
            })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let sound_mps = sim.facts().sound_speed_mps;
            let Some(spec) = sim.facts().sensors.get(*source).and_then(|sensor| sensor.head) else {
                continue;
            };
            let places = places.map(|parameters| parameters.sonar(&spec, sound_mps));
            let stream = sim.stream(*source);
            sim.insert(*source, EchoStrength { places, stream });
        }
        sim.system(Stage::Hear, detect);
        Ok(())
    }
}

impl Parameters {
    fn sonar(&self, spec: &HeadSpec, sound_mps: f64) -> Sonar {
        let frequency_khz = self.frequency_khz.unwrap_or_else(|| frequency_of_khz(spec.beam_rad));
        Sonar {
            beam_rad: spec.beam_rad,
            pulse_s: self.pulse_us.unwrap_or_else(|| pulse_of_us(spec.range_m[1])) * 1e-6,
            sound_mps,
            absorbed_dbpm: water_absorption_dbpm(frequency_khz, self.temperature_degc)
                + self.silt.absorption_dbpm(frequency_khz, sound_mps),
            wall_db: self.wall_db,
            gain_db: self.gain_db,
            log_gain_db: self.log_gain_db,
            made_up_dbpm: self.absorption_dbpm.unwrap_or_else(|| sonar::usual_absorption_dbpm(frequency_khz)),
        }
    }
}

type Detecting<'a> = (&'a mut Samples<Sounding>, &'a Rays, &'a EchoStrength, Option<&'a Stopped>);

fn detect(scenery: Res<'_, Scenery>, mut heads: Query<'_, '_, Detecting<'_>>) {
    for (mut samples, rays, echoes, stopped) in &mut heads {
        for (number, ((step, sounding), ray)) in samples.steps().zip(&rays.0).enumerate() {
            // Echoes of the vehicle's own parts are always strong enough, so this system skips them.
            let Some(hit) = ray.hit.filter(|_| !Stopped::has(stopped, number)) else { continue };
            let Some(sonar) = echoes.places.here(&scenery, ray) else { continue };
            let [chance, _] = echoes.stream.at(step).uniform();
            let square = squareness(ray.direction, hit.normal);
            if chance >= sonar.detected(hit.range_m, square) {
                sounding.range_m = None;
            }
        }
    }
}

#[cfg(test)]
mod tests;
