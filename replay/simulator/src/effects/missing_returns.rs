//! Pings without a return.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::geometry::squareness;
use super::occlusion::Stopped;
use super::places::Places;
use super::runs::Runs;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Ray, Rays, Samples, Scenery};
use crate::stages::Stage;

/// Some pings get no return: a random share of all pings, singly or in runs; pings at grazing incidence; and pings at
/// far walls.
///
/// The three parts are independent of each other, and at least one is required. Keys, with defaults in brackets:
/// - `from_m` and `to_m` of the stretch in which returns are lost.
/// - `share`, the share of pings lost at random, from 0 to 0.95 (0). `mean_run`, the mean number of consecutive lost
///   pings, up to 10,000. It is at least 1 and at least share / (1 - share). The default 1 / (1 - share) makes pings
///   independent.
/// - `grazing_from_deg` and `grazing_to_deg`, the incidence above which some pings are lost, and the incidence from
///   which all are lost; from 0, perpendicular to the wall, to 90.
/// - `far_from_m` and `far_to_m`, the range above which some pings are lost, and the range from which all are lost;
///   from 0 to 200 m.
///
/// Between the two values of a pair the share grows linearly; equal values give a sharp edge. Source: runs after
/// Gilbert, "Capacity of a burst-noise channel", Bell System Technical Journal 39, 1960.
pub(super) struct MissingReturnsKind;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters {
    runs: Option<Runs>,
    grazing: Option<Ramp>,
    far: Option<Ramp>,
}

/// Share of lost pings: 0 up to `from`, 1 from `to` on, and linear in between.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ramp {
    from: f64,
    to: f64,
}

#[derive(Component)]
struct MissingReturns {
    places: Places<Parameters>,
    stream: Stream,
    /// Whether the previous ping was lost in a run of lost pings; `None` before the first ping.
    in_run: Option<bool>,
}

impl Ramp {
    fn share(&self, at: f64) -> f64 {
        if at >= self.to {
            return 1.0;
        }
        ((at - self.from) / (self.to - self.from)).max(0.0)
    }
}

impl EffectKind for MissingReturnsKind {
    fn name(&self) -> &'static str {
        "missing_returns"
    }

    fn summary(&self) -> &'static str {
        "some pings have no return: at random, in runs, at grazing angles or at long range"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let parameters = Parameters {
                runs: Runs::read(table)?,
                grazing: ramp(table, ["grazing_from_deg", "grazing_to_deg"], 90.0)?,
                far: ramp(table, ["far_from_m", "far_to_m"], 200.0)?,
            };
            if parameters == (Parameters { runs: None, grazing: None, far: None }) {
                let problem = "at least one is needed: a share above zero, grazing_from_deg or far_from_m";
                return Err(table.invalid("share", problem));
            }
            Ok(parameters)
        })?))
    }
}

fn ramp(table: &Section<'_>, keys: [&'static str; 2], most: f64) -> Result<Option<Ramp>, ConfigError> {
    let [from, to] = [table.number(keys[0], 0.0..=most)?, table.number(keys[1], 0.0..=most)?];
    match (from, to) {
        (None, None) => Ok(None),
        (Some(from), Some(to)) if to < from => {
            Err(table.invalid(keys[1], &format!("must not be below {}, which is {from}", keys[0])))
        }
        (Some(from), Some(to)) => Ok(Some(Ramp { from, to })),
        (None, Some(_)) => Err(table.invalid(keys[0], &format!("is missing; it is needed with {}", keys[1]))),
        (Some(_), None) => Err(table.invalid(keys[1], &format!("is missing; it is needed with {}", keys[0]))),
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let stream = sim.stream(*source);
            sim.insert(*source, MissingReturns { places: places.clone(), stream, in_run: None });
        }
        sim.system(Stage::Hear, lose);
        Ok(())
    }
}

impl Parameters {
    /// Whether the ping of a step gets no return. Must be called once per step, in order. `in_run` tells the next call
    /// whether a run of lost pings is under way.
    fn loses(&self, in_run: &mut Option<bool>, drawn: [f64; 2], ray: &Ray, echo: Echo) -> bool {
        let [first, second] = drawn;
        let runs = self.runs.is_some_and(|runs| runs.next(*in_run, first));
        *in_run = Some(runs);
        let share =
            |ramp: Option<Ramp>, at: Option<f64>| ramp.zip(at).map_or(0.0, |(ramp, at)| ramp.share(at));
        // The incidence counts only for walls. A part of the vehicle has no known incidence.
        let hit = ray.hit.filter(|_| self.grazing.is_some() && !echo.stopped);
        let incidence_deg = hit.map(|hit| math::acos(squareness(ray.direction, hit.normal)).to_degrees());
        let stays = (1.0 - share(self.grazing, incidence_deg)) * (1.0 - share(self.far, echo.range_m));
        runs || second >= stays
    }
}

/// The echo of a ping before this effect changes it.
#[derive(Debug, Clone, Copy)]
struct Echo {
    range_m: Option<f64>,
    /// Whether the echo comes from a part of the vehicle.
    stopped: bool,
}

type Losing<'a> = (&'a mut Samples<Sounding>, &'a Rays, &'a mut MissingReturns, Option<&'a Stopped>);

fn lose(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Losing<'_>>) {
    for (mut samples, rays, mut missing, stopped) in &mut sonars {
        let MissingReturns { places, stream, in_run } = &mut *missing;
        for (number, ((step, sounding), ray)) in samples.steps().zip(&rays.0).enumerate() {
            let Some(parameters) = places.here(&scenery, ray) else {
                *in_run = None;
                continue;
            };
            let echo = Echo { range_m: sounding.range_m, stopped: Stopped::has(stopped, number) };
            if parameters.loses(in_run, stream.at(step).uniform(), ray, echo) {
                sounding.range_m = None;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Dive, assert_share};

    fn lost(dive: &Dive, keys: &str) -> Vec<bool> {
        let dived = dive.dive(&format!("[effects.missing_returns]\n{keys}"));
        dived.ranges_m(0).iter().map(Option::is_none).collect()
    }

    #[test]
    fn share_of_independently_lost_returns_is_as_configured() {
        let dive = Dive { seconds: 500.0, ..Dive::with_head() };
        let lost = lost(&dive, "share = 0.3");
        assert_share(lost.iter().filter(|lost| **lost).count(), lost.len(), 0.3);
        let after: Vec<bool> = lost.windows(2).filter(|pair| pair[0]).map(|pair| pair[1]).collect();
        assert_share(after.iter().filter(|lost| **lost).count(), after.len(), 0.3);
    }

    #[test]
    fn runs_of_lost_returns_have_the_given_mean_length_and_share() {
        let (share, mean) = (0.2, 8.0);
        let dive = Dive { seconds: 2000.0, ..Dive::with_head() };
        let lost = lost(&dive, "share = 0.2\nmean_run = 8");
        let runs: Vec<usize> = lost
            .chunk_by(|a, b| a == b)
            .filter(|run| run.first() == Some(&true))
            .map(<[bool]>::len)
            .collect();
        let (count, whole) = (runs.len() as f64, lost.len() as f64);
        // Run lengths are geometrically distributed, with variance mean (mean - 1).
        let found = runs.iter().sum::<usize>() as f64 / count;
        assert!((found - mean).abs() < 5.0 * math::sqrt(mean * (mean - 1.0) / count), "{found}");
        assert_share(runs.iter().filter(|run| **run == 1).count(), runs.len(), 1.0 / mean);
        // The variance of the lost share is that of independent pings times (1 + r) / (1 - r), where r is the
        // correlation of the Markov chain.
        let correlation = Runs::new(share, mean).correlation();
        let variance = share * (1.0 - share) / whole * (1.0 + correlation) / (1.0 - correlation);
        let found = runs.iter().sum::<usize>() as f64 / whole;
        assert!((found - share).abs() < 5.0 * math::sqrt(variance), "{found}");
    }

    #[test]
    fn grazing_pings_are_lost_by_their_incidence() {
        let dive = Dive { seconds: 500.0, ..Dive::with_head() };
        let effects = "[effects.missing_returns]\ngrazing_from_deg = 20\ngrazing_to_deg = 40";
        let mut bands = [(0, 0, 0.0); 10];
        for row in &dive.dive(effects).rows {
            let (hit, _) = row.wall().unwrap();
            let headrace_sensor::measurement::Sounding { angle_rad, range_m, .. } =
                row.sounding.unwrap().measured;
            // The tunnel is a rectangle, so a beam's incidence is its angle to the vertical or to the horizontal.
            let across = math::sin(angle_rad).abs();
            let square = if hit.normal.z().abs() > 0.5 { math::cos(angle_rad).abs() } else { across };
            let incidence_deg = math::acos(square).to_degrees();
            let ramp = ((incidence_deg - 20.0) / 20.0).clamp(0.0, 1.0);
            let band = &mut bands[usize::try_from(math::floor_to_i64(incidence_deg / 5.1)).unwrap()];
            *band = (band.0 + usize::from(range_m.is_none()), band.1 + 1, band.2 + ramp);
        }
        for (lost, of, expected) in bands.into_iter().filter(|(_, of, _)| *of > 0) {
            let probability = expected / of as f64;
            assert_share(lost, of, probability);
        }
        assert!(bands[0].1 > 0 && bands[8].1 > 0);
    }

    #[test]
    fn loss_ramp_of_zero_length_is_a_sharp_edge() {
        let dive = Dive::with_head();
        let base = dive.dive("").ranges_m(0);
        let lost = lost(&dive, "far_from_m = 3\nfar_to_m = 3");
        for (was, lost) in base.iter().zip(lost) {
            assert_eq!(lost, was.unwrap() >= 3.0);
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.missing_returns]\nshare = 0.3\nmean_run = 20");
    }

    #[test]
    fn impossible_parameters_of_lost_returns_are_refused() {
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.missing_returns]\n{keys}"));
        assert!(refusal("").contains("a share above zero, grazing_from_deg or far_from_m"));
        assert!(refusal("share = 0.99").contains("from 0 to 0.95"));
        assert!(refusal("share = 0.9\nmean_run = 2").contains("must be at least 9.00"));
        assert!(refusal("mean_run = 2").contains("only with a share"));
        assert!(refusal("grazing_from_deg = 50").contains("is needed with grazing_from_deg"));
        assert!(refusal("far_from_m = 9\nfar_to_m = 8").contains("must not be below far_from_m"));
        assert!(refusal("share = 0.1\nshares = 0.1").contains("is not a key here"));
    }
}
