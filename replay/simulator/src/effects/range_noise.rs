//! Noise of measured ranges.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::places::Places;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Rays, Samples, Scenery};
use crate::stages::Stage;

/// Ranges have normally distributed noise, with a constant part and a part proportional to the range.
///
/// The effect acts in the whole tunnel, or in the stretch from `from_m` to `to_m`.
pub(super) struct RangeNoiseKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    sd_m: f64,
    sd_share: f64,
}

#[derive(Component)]
struct RangeNoise {
    places: Places<Parameters>,
    stream: Stream,
}

impl EffectKind for RangeNoiseKind {
    fn name(&self) -> &'static str {
        "range_noise"
    }

    fn summary(&self) -> &'static str {
        "ranges have noise"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let sd_m = table.number("sd_m", 0.0..=1.0)?.unwrap_or(0.0);
            let sd_share = table.number("sd_share", 0.0..=0.5)?.unwrap_or(0.0);
            if sd_m == 0.0 && sd_share == 0.0 {
                return Err(table.invalid("sd_m", "at least one of sd_m and sd_share must be above zero"));
            }
            Ok(Parameters { sd_m, sd_share })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let stream = sim.stream(*source);
            sim.insert(*source, RangeNoise { places: places.clone(), stream });
        }
        sim.system(Stage::Hear, scatter);
        Ok(())
    }
}

fn scatter(
    scenery: Res<'_, Scenery>,
    mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &Rays, &RangeNoise)>,
) {
    for (mut samples, rays, noise) in &mut sonars {
        for ((step, sounding), ray) in samples.steps().zip(&rays.0) {
            let Some(Parameters { sd_m, sd_share }) = noise.places.here(&scenery, ray) else { continue };
            if let Some(range_m) = &mut sounding.range_m {
                let [by, _] = noise.stream.at(step).normal();
                // A range must not become negative, even if the added noise is negative.
                *range_m = (*range_m + by * (sd_m + sd_share * *range_m)).max(0.0);
            }
        }
    }
}
