//! Disturbance of compasses by steel in the lining.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::Rot;
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Inertia;
use headrace_sensor::reading::Level;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::targets;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Samples, Scenery};
use crate::stages::Stage;

/// Length of the stretches into which the tunnel is divided, m. Each stretch contains at most one random disturbance.
const CELL_M: f64 = 1.0;

/// Steel turns the attitude of an inertial unit about the vertical.
///
/// The turn is a raised cosine of the vehicle's chainage, largest in the middle of the disturbance. `places` are tables
/// of `chainage_m` (the middle), `length_m` and `deg`, positive to the left. `per_100m` adds disturbances at random
/// places, each `length_m` long (5 by default). Their angles are uniformly distributed, up to `up_to_deg` (10 by
/// default) either way. Disturbances belong to the tunnel: all units see the same disturbances. Overlapping
/// disturbances add up.
pub(super) struct MagneticDisturbanceKind;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Place {
    chainage_m: f64,
    length_m: f64,
    pull_rad: f64,
}

#[derive(Debug, Clone, Default)]
struct Disturbance {
    units: Vec<usize>,
    given: Vec<Place>,
    per_100m: f64,
    up_to_rad: f64,
    length_m: f64,
    tunnel_m: f64,
}

/// Disturbances, sorted by the chainage of their middle.
#[derive(Clone, Component)]
struct Steel {
    places: Vec<Place>,
    longest_m: f64,
}

impl EffectKind for MagneticDisturbanceKind {
    fn name(&self) -> &'static str {
        "magnetic_disturbance"
    }

    fn summary(&self) -> &'static str {
        "steel in the lining disturbs the yaw of inertial units"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let mut disturbance = Disturbance::default();
        for table in keys::only_one(tables)? {
            let units = targets(&table, facts, &[Sense::Inertial])?;
            let per_100m = keys::or_zero(&table, "per_100m", 0.0..=100.0)?;
            let given = table.sections("places")?.into_iter().map(place).collect::<Result<Vec<_>, _>>()?;
            if given.is_empty() {
                keys::some_not_zero(&table, &[("per_100m", per_100m), ("places", 0.0)])?;
            }
            disturbance = Disturbance {
                units,
                given,
                per_100m,
                up_to_rad: table.number("up_to_deg", 0.0..=90.0)?.unwrap_or(10.0).to_radians(),
                length_m: table.number("length_m", 0.1..=1000.0)?.unwrap_or(5.0),
                tunnel_m: facts.length_m,
            };
            table.finish()?;
        }
        Ok(Box::new(disturbance))
    }
}

fn place(table: Section<'_>) -> Result<Place, ConfigError> {
    let needed = |key, allowed| table.number(key, allowed).and_then(|number| table.required(key, number));
    let place = Place {
        chainage_m: needed("chainage_m", -1e3..=1e6)?,
        length_m: needed("length_m", 0.1..=1000.0)?,
        pull_rad: needed("deg", -180.0..=180.0)?.to_radians(),
    };
    table.finish()?;
    Ok(place)
}

impl Effect for Disturbance {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        let mut places = self.given.clone();
        if self.per_100m > 0.0 {
            places.extend(self.drawn(sim.stream_for("tunnel")));
        }
        let steel = Steel::new(places);
        for source in &self.units {
            sim.insert(*source, steel.clone());
        }
        sim.system(Stage::Feel, pull);
        Ok(())
    }
}

impl Disturbance {
    fn drawn(&self, stream: Stream) -> Vec<Place> {
        let cells = math::floor_to_i64(self.tunnel_m / CELL_M).max(0).unsigned_abs();
        let one = |cell: u64| {
            let [chance, along] = stream.at(cell).uniform();
            let [size, _] = stream.block(cell, 1).uniform();
            let pull_rad = self.up_to_rad * (2.0 * size - 1.0);
            let chainage_m = (cell as f64 + along) * CELL_M;
            (chance < self.per_100m * CELL_M / 100.0).then_some(Place {
                chainage_m,
                length_m: self.length_m,
                pull_rad,
            })
        };
        (0..cells).filter_map(one).collect()
    }
}

impl Steel {
    fn new(mut places: Vec<Place>) -> Self {
        places.sort_by(|a, b| a.chainage_m.total_cmp(&b.chainage_m));
        let longest_m = places.iter().fold(0.0, |longest: f64, place| longest.max(place.length_m));
        Self { places, longest_m }
    }

    fn pull_rad(&self, chainage_m: f64) -> f64 {
        let reach_m = 0.5 * self.longest_m;
        let from = self.places.partition_point(|place| place.chainage_m <= chainage_m - reach_m);
        let near = self.places.iter().skip(from).take_while(|place| place.chainage_m < chainage_m + reach_m);
        near.map(|place| place.pull_rad(chainage_m)).sum()
    }
}

impl Place {
    fn pull_rad(&self, chainage_m: f64) -> f64 {
        let along = (chainage_m - self.chainage_m) / self.length_m;
        if along.abs() < 0.5 { self.pull_rad * 0.5 * (1.0 + math::cos(math::TAU * along)) } else { 0.0 }
    }
}

#[expect(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]
fn pull(scenery: Res<'_, Scenery>, mut units: Query<'_, '_, (&mut Samples<Inertia>, &Steel)>) {
    for (mut samples, steel) in &mut units {
        for inertia in &mut samples.list {
            let pull_rad = steel.pull_rad(scenery.chainage_m(inertia.at));
            if pull_rad != 0.0 {
                let turned = Rot::<Level, Level>::from_roll_pitch_yaw(0.0, 0.0, pull_rad);
                inertia.attitude = turned * inertia.attitude;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, LONG, refusal};

    #[test]
    fn magnetic_disturbance_adds_a_bell_shaped_error_to_yaw_only() {
        let keys = "[effects.magnetic_disturbance]\n\
                    places = [{ chainage_m = 20, length_m = 4, deg = 10 }, { chainage_m = 21, length_m = 4, deg = -4 }]\n";
        let (plain, pulled) = (Bench::on(LONG, ""), Bench::on(LONG, keys));
        let sim = plain.simulation();
        let (plain, pulled) = (plain.run::<Inertia>("imu"), pulled.run::<Inertia>("imu"));
        let (mut most_deg, mut felt) = (0.0_f64, 0);
        for (plain, pulled) in plain.iter().zip(&pulled) {
            let x_m = sim.scenery().unwrap().chainage_m(plain.at);
            let bell = |middle_m: f64| {
                let along = (x_m - middle_m) / 4.0;
                if along.abs() < 0.5 { 0.5 + 0.5 * math::cos(math::TAU * along) } else { 0.0 }
            };
            let wanted_deg = 10.0 * bell(20.0) - 4.0 * bell(21.0);
            let (roll, pitch, yaw) = (pulled.attitude * plain.attitude.inverse()).roll_pitch_yaw();
            assert!((yaw.to_degrees() - wanted_deg).abs() < 1e-9 && roll.abs() + pitch.abs() < 1e-12);
            assert_eq!((plain.rate_radps, plain.force_mps2), (pulled.rate_radps, pulled.force_mps2));
            most_deg = most_deg.max(yaw.to_degrees());
            felt += usize::from(wanted_deg != 0.0);
        }
        assert!((7.0..10.0).contains(&most_deg) && felt > 100, "{most_deg} {felt}");
    }

    #[test]
    fn random_disturbances_have_the_given_rate_and_strength() {
        let disturbance = Disturbance {
            per_100m: 5.0,
            up_to_rad: 0.2,
            length_m: 5.0,
            tunnel_m: 100_000.0,
            ..Disturbance::default()
        };
        let places = disturbance.drawn(Stream::new(3, "magnetic_disturbance", "tunnel"));
        let n = places.len() as f64;
        assert!((n - 5000.0).abs() < 5.0 * math::sqrt(5000.0 * 0.95), "{n}");
        let variance = places.iter().map(|place| place.pull_rad * place.pull_rad).sum::<f64>() / n;
        assert!((variance / (0.04 / 3.0) - 1.0).abs() < 5.0 / math::sqrt(n));
        let middle_m = places.iter().map(|place| place.chainage_m).sum::<f64>() / n;
        assert!((middle_m / 50_000.0 - 1.0).abs() < 5.0 / math::sqrt(3.0 * n));
        let steel = Steel::new(places.clone());
        for x_m in [0.0, 17.3, 5_000.0, 99_999.0] {
            let all: f64 = places.iter().map(|place| place.pull_rad(x_m)).sum();
            assert!((steel.pull_rad(x_m) - all).abs() < 1e-12);
        }
    }

    #[test]
    fn disturbances_with_missing_or_incomplete_places_are_refused() {
        let why = |keys: &str| refusal(&format!("[effects.magnetic_disturbance]\n{keys}"));
        assert!(why("up_to_deg = 5").contains("places must not be zero"));
        assert!(why("places = [{ chainage_m = 3, deg = 2 }]").contains("places[0].length_m: is missing"));
    }
}
