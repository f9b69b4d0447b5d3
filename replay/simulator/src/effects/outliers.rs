//! Outliers: returns that are unrelated to the wall.

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

/// Some returns are unrelated to the wall. Their range is uniformly distributed.
///
/// Echosounders in a tunnel give such outliers. Keys, with defaults in brackets:
/// - `from_m` and `to_m` of the stretch in which they occur.
/// - `share`, the share of outliers among the returns, from 0 (excluded) to 1 (0.08).
/// - the nearest range `near_m` (0.3) and the farthest `far_m` (a head's range setting in the scene's water; 30 for an
///   echosounder), from 0 to 200 m.
///
/// Source: the share is that of the logs of VITA 1, as in the project's scene vita1-field; 30 m is a Ping1D's usual
/// scan.
pub(super) struct OutliersKind;

/// Farthest range of an echosounder's outliers by default, m.
const ECHOSOUNDER_FAR_M: f64 = 30.0;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    share: f64,
    near_m: f64,
    far_m: Option<f64>,
}

#[derive(Component)]
struct Outliers {
    places: Places<Strays>,
    stream: Stream,
}

/// Outliers in a stretch: their share of the returns, and the limits of their ranges, m.
#[derive(Debug, Clone, Copy)]
struct Strays {
    share: f64,
    between_m: [f64; 2],
}

impl EffectKind for OutliersKind {
    fn name(&self) -> &'static str {
        "outliers"
    }

    fn summary(&self) -> &'static str {
        "some returns have random ranges"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let share = table.number("share", 0.0..=1.0)?.unwrap_or(0.08);
            if share == 0.0 {
                return Err(table.invalid("share", "must be above zero"));
            }
            let near_m = table.number("near_m", 0.0..=200.0)?.unwrap_or(0.3);
            let far_m = table.number("far_m", 0.0..=200.0)?;
            if far_m.is_some_and(|far_m| far_m <= near_m) {
                return Err(table.invalid("far_m", &format!("must be above near_m, which is {near_m}")));
            }
            Ok(Parameters { share, near_m, far_m })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let facts = sim.facts();
            let head = facts.sensors.get(*source).and_then(|sensor| sensor.head);
            let usual_m = head.map_or(ECHOSOUNDER_FAR_M, |spec| spec.reach_m(facts.sound_speed_mps)[1]);
            let far_m = |parameters: &Parameters| parameters.far_m.unwrap_or(usual_m);
            if let Some(none) = places.all().find(|parameters| far_m(parameters) <= parameters.near_m) {
                let (near_m, far_m) = (none.near_m, far_m(none));
                let problem = format!(
                    "has near_m = {near_m}, which must be below the sensor's farthest range, {far_m} m"
                );
                return Err(SceneError::Effect { effect: OutliersKind.name(), problem });
            }
            let places = places.map(|it| Strays { share: it.share, between_m: [it.near_m, far_m(it)] });
            let stream = sim.stream(*source);
            sim.insert(*source, Outliers { places, stream });
        }
        sim.system(Stage::Hear, stray);
        Ok(())
    }
}

fn stray(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, (&mut Samples<Sounding>, &Rays, &Outliers)>) {
    for (mut samples, rays, Outliers { places, stream }) in &mut sonars {
        for ((step, sounding), ray) in samples.steps().zip(&rays.0) {
            let Some(Strays { share, between_m: [near_m, far_m] }) = places.here(&scenery, ray) else {
                continue;
            };
            let [chance, place] = stream.at(step).uniform();
            if chance < *share && sounding.range_m.is_some() {
                sounding.range_m = Some(near_m + place * (far_m - near_m));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use crate::testing::{Dive, assert_share};

    #[test]
    fn outliers_have_the_given_share_and_uniformly_distributed_ranges() {
        let dive = Dive { seconds: 1000.0, ..Dive::with_sounder() };
        let (base, dived) = (dive.dive(""), dive.dive("[effects.outliers]\nshare = 0.2\nfar_m = 20.3"));
        let pairs = || base.ranges_m(0).into_iter().zip(dived.ranges_m(0));
        let strays: Vec<f64> = pairs().filter(|(was, is)| was != is).filter_map(|(_, is)| is).collect();
        assert_share(strays.len(), base.rows.len(), 0.2);
        let count = strays.len() as f64;
        let (least, most) = (
            strays.iter().copied().reduce(f64::min).unwrap(),
            strays.iter().copied().reduce(f64::max).unwrap(),
        );
        assert!(least >= 0.3 && most <= 20.3 && most - least > 19.9);
        let mean_m = strays.iter().sum::<f64>() / count;
        let variance_m2 = strays.iter().map(|m| (m - mean_m) * (m - mean_m)).sum::<f64>() / count;
        // Outliers are uniformly distributed over 20 m, so their variance is 400 / 12 and their fourth moment 20^4 /
        // 80.
        assert!((mean_m - 10.3).abs() < 5.0 * math::sqrt(400.0 / 12.0 / count));
        let kurtosis_m4 = 160_000.0 / 80.0 - (400.0 / 12.0) * (400.0 / 12.0);
        assert!((variance_m2 - 400.0 / 12.0).abs() < 5.0 * math::sqrt(kurtosis_m4 / count));
    }

    #[test]
    fn default_outliers_stay_within_the_range_setting() {
        let mut dive = Dive::with_head();
        dive.tunnel = "profile = \"rectangle\"\nwidth_m = 40\nheight_m = 5";
        let (base, dived) = (dive.dive(""), dive.dive("[effects.outliers]"));
        let (was, is) = (base.ranges_m(0), dived.ranges_m(0));
        assert!(was.iter().any(Option::is_none));
        assert!(was.iter().zip(&is).all(|(was, is)| was.is_none() == is.is_none()));
        let strays = was.iter().zip(&is).filter(|(was, is)| was != is);
        assert!(strays.map(|(_, is)| is.unwrap()).all(|range_m| (0.3..=10.0).contains(&range_m)));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_sounder().assert_slices_dont_matter("[effects.outliers]");
    }

    #[test]
    fn invalid_shares_and_ranges_are_refused() {
        let refusal = |keys: &str| Dive::with_sounder().refusal(&format!("[effects.outliers]\n{keys}"));
        assert!(refusal("share = 1.5").contains("from 0 to 1"));
        assert!(refusal("share = 0").contains("above zero"));
        assert!(refusal("near_m = 5\nfar_m = 4").contains("must be above near_m"));
        assert!(refusal("near_m = 40").contains("below the sensor's farthest range, 30 m"));
    }
}
