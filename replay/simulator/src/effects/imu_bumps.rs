//! Bumps of the vehicle against obstacles.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::frames::{Sensor, Vec3};
use headrace_geometry::math;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Inertia;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::START;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::Samples;
use crate::stages::Stage;

/// Length of the time spans into which a dive is divided, s. Each span contains at most one bump.
const SPAN_S: f64 = 1.0;

/// From time to time the vehicle bumps into the wall, a rock or its own cable. It is pushed one way and swings back.
///
/// Keys, with defaults in brackets:
/// - `per_hour`, up to 1,800 (required).
/// - `speed_mps = [least, most]`, the speed that a bump gives the vehicle ([0.02, 0.1]). Speed and direction are
///   uniformly distributed.
/// - `seconds`, from the first touch until the vehicle is at rest again, 0.01 to 1 (0.2).
///
/// The force is one period of a sine, so the speed is gained and lost again. The vehicle moves by some millimetres,
/// which the true trajectory ignores. Sensors on one vehicle feel the same bumps. Source: momentum; the speeds are
/// those at which such vehicles travel.
pub(super) struct ImuBumpsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    chance: f64,
    speed_mps: [f64; 2],
    seconds: f64,
}

#[derive(Component)]
struct ImuBumps {
    parameters: Parameters,
    stream: Stream,
}

impl EffectKind for ImuBumpsKind {
    fn name(&self) -> &'static str {
        "imu_bumps"
    }

    fn summary(&self) -> &'static str {
        "the vehicle hits obstacles, and inertial units measure the shocks"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Inertial], |table| {
            let per_hour = keys::or_zero(table, "per_hour", 0.0..=1800.0)?;
            keys::some_not_zero(table, &[("per_hour", per_hour)])?;
            let speed_mps = keys::span(table, "speed_mps", 0.0..=2.0, [0.02, 0.1])?;
            let seconds = table.number("seconds", 0.01..=SPAN_S)?.unwrap_or(0.2);
            Ok(Parameters { chance: per_hour * SPAN_S / 3600.0, speed_mps, seconds })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let stream = sim.stream_for("vehicle");
            sim.insert(*source, ImuBumps { parameters: *parameters, stream });
        }
        sim.system(Stage::Feel, bump);
        Ok(())
    }
}

fn bump(mut units: Query<'_, '_, (&mut Samples<Inertia>, &ImuBumps)>) {
    for (mut samples, bumps) in &mut units {
        for inertia in &mut samples.list {
            let period_s = inertia.period.as_secs_f64();
            let until_s = inertia.at.since(START).as_secs_f64() + period_s / 2.0;
            let gained = bumps.gained_mps([until_s - period_s, until_s]);
            if let Some(gained) = gained.filter(|_| period_s > 0.0) {
                inertia.force_mps2 = inertia.force_mps2 + gained.scaled(1.0 / period_s);
            }
        }
    }
}

impl ImuBumps {
    /// Change of the vehicle's velocity by bumps between two times, m/s; `None` without a bump.
    fn gained_mps(&self, [from_s, until_s]: [f64; 2]) -> Option<Vec3<Sensor>> {
        let last = math::floor_to_i64(until_s / SPAN_S);
        let first = math::floor_to_i64((from_s - self.parameters.seconds) / SPAN_S).max(0);
        let each = (first..=last).filter_map(|span| {
            let (began_s, speed) = self.drawn(span.unsigned_abs())?;
            let share = self.share(until_s - began_s) - self.share(from_s - began_s);
            (share != 0.0).then(|| speed.scaled(share))
        });
        each.reduce(|a, b| a + b)
    }

    /// Share of a bump's speed that the vehicle has gained `after_s` seconds after the bump's start.
    fn share(&self, after_s: f64) -> f64 {
        let turn = (after_s / self.parameters.seconds).clamp(0.0, 1.0);
        (1.0 - math::cos(math::TAU * turn)) / 2.0
    }

    /// Start time and velocity of the bump in a span, if the span has one.
    fn drawn(&self, span: u64) -> Option<(f64, Vec3<Sensor>)> {
        let [chance, along] = self.stream.at(span).uniform();
        if chance >= self.parameters.chance {
            return None;
        }
        let [size, up] = self.stream.block(span, 1).uniform();
        let [round, _] = self.stream.block(span, 2).uniform();
        let [least, most] = self.parameters.speed_mps;
        let z = 2.0 * up - 1.0;
        let level = math::sqrt((1.0 - z * z).max(0.0));
        let (sine, cosine) = math::sin_cos(math::TAU * round);
        let direction = Vec3::new(level * cosine, level * sine, z);
        Some(((span as f64 + along) * SPAN_S, direction.scaled(least + (most - least) * size)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const KEYS: &str = "[effects.imu_bumps]\nper_hour = 400\nspeed_mps = [0.05, 0.2]\nseconds = 0.3\n";

    /// Finds the bumps as the difference between a dive with bumps and a dive without. Checks their rate, length and
    /// strength. After a bump the vehicle moves as fast as before it.
    #[test]
    fn bumps_have_the_given_rate_length_and_strength() {
        let (plain, with) = (Bench::long("").run::<Inertia>("imu"), Bench::long(KEYS).run::<Inertia>("imu"));
        let period_s = plain[0].period.as_secs_f64();
        let force: Vec<Vec3<Sensor>> =
            plain.iter().zip(&with).map(|(a, b)| b.force_mps2 + a.force_mps2.scaled(-1.0)).collect();
        let felt = |v: &Vec3<Sensor>| v.norm() > 1e-9;
        let bumps: Vec<&[Vec3<Sensor>]> =
            force.chunk_by(|a, b| felt(a) == felt(b)).filter(|run| felt(&run[0])).collect();
        let (spans, chance) = (640.0, 400.0 / 3600.0);
        let n = bumps.len() as f64;
        // Two overlapping bumps are counted as a single bump.
        assert!((n - spans * chance).abs() < 5.0 * math::sqrt(spans * chance), "{n}");
        let mut single = 0;
        for bump in &bumps {
            let lasted_s = bump.len() as f64 * period_s;
            if lasted_s > 0.33 {
                continue;
            }
            single += 1;
            assert!(lasted_s > 0.28, "{lasted_s}");
            let (mut speed, mut largest_mps) = (Vec3::<Sensor>::zero(), 0.0_f64);
            for force in *bump {
                speed = speed + force.scaled(period_s);
                largest_mps = largest_mps.max(speed.norm());
            }
            assert!(speed.norm() < 1e-9, "{speed:?}");
            assert!((0.049..0.2001).contains(&largest_mps), "{largest_mps}");
        }
        assert!(single * 4 > bumps.len() * 3);
    }

    /// Velocities that the bumps of the first `spans` time spans give the vehicle.
    fn bumps(spans: u64) -> Vec<Vec3<Sensor>> {
        let parameters = Parameters { chance: 0.5, speed_mps: [0.05, 0.2], seconds: 0.3 };
        let bumps = ImuBumps { parameters, stream: Stream::new(5, "imu_bumps", "vehicle") };
        (0..spans).filter_map(|span| bumps.drawn(span)).map(|(_, speed)| speed).collect()
    }

    /// Directions are uniformly distributed on a sphere: each component has mean 0 and mean square 1/3. Sizes are
    /// uniformly distributed from the least to the most, which is tested by their mean and variance.
    #[test]
    fn bump_directions_and_sizes_are_uniformly_distributed() {
        let bumps = bumps(20_000);
        let n = bumps.len() as f64;
        let mean = |of: &dyn Fn(&Vec3<Sensor>) -> f64| bumps.iter().map(of).sum::<f64>() / n;
        let size = |speed: &Vec3<Sensor>| speed.norm();
        let axes: [fn(&Vec3<Sensor>) -> f64; 3] = [|v| v.x(), |v| v.y(), |v| v.z()];
        for axis in axes {
            let along = |speed: &Vec3<Sensor>| axis(speed) / size(speed);
            let (first, second) = (mean(&along), mean(&|speed| along(speed) * along(speed)));
            assert!(first.abs() < 5.0 * math::sqrt(1.0 / 3.0 / n), "{first}");
            assert!((second - 1.0 / 3.0).abs() < 5.0 * math::sqrt(4.0 / 45.0 / n), "{second}");
        }
        let off = |speed: &Vec3<Sensor>| (size(speed) - 0.125) / 0.15;
        let (first, second) = (mean(&off), mean(&|speed| off(speed) * off(speed)));
        assert!(first.abs() < 5.0 * math::sqrt(1.0 / 12.0 / n), "{first}");
        assert!((second - 1.0 / 12.0).abs() < 5.0 * math::sqrt(1.0 / 180.0 / n), "{second}");
    }

    #[test]
    fn inertial_units_on_one_vehicle_feel_the_same_bumps() {
        let felt = |unit: &'static str| {
            let force = |keys: &str| {
                let samples = Bench::turning(keys).with_unit(unit).run::<Inertia>(unit);
                samples.iter().map(|sample| sample.force_mps2).collect::<Vec<_>>()
            };
            let pairs = force("").into_iter().zip(force(KEYS));
            pairs.map(|(plain, with)| with + plain.scaled(-1.0)).collect::<Vec<_>>()
        };
        let (one, other) = (felt("imu"), felt("imu_of_another_name"));
        assert!(one.iter().any(|force| force.norm() > 0.1));
        assert_eq!(one, other);
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning(KEYS));
        assert!(refusal("[effects.imu_bumps]\n").contains("per_hour: must not be zero"));
        assert!(refusal("[effects.imu_bumps]\nper_hour = 9\nspeed_mps = 1\n").contains("must be"));
    }
}
