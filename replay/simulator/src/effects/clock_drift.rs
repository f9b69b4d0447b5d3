//! Drifting clocks of devices.

use bevy_ecs::prelude::Query;
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::{Inertia, Measurement, Payout, Pressure};

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::clock::Clock;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// The clock of a device that samples on its own schedule drifts at a constant rate.
///
/// The device samples at the wrong times, and its timestamps are those of its clock. The clock's seconds are too long
/// by `ppm` millionths, or by a value drawn from a normal distribution with standard deviation `sd_ppm`. With positive
/// values the device samples late. The effect is refused for heads and echosounders, which ping when the host requests
/// a ping.
pub(super) struct ClockDriftKind;

#[derive(Debug, Clone, Copy)]
enum Drift {
    Given { ppm: f64 },
    Drawn { sd_ppm: f64 },
}

impl EffectKind for ClockDriftKind {
    fn name(&self) -> &'static str {
        "clock_drift"
    }

    fn summary(&self) -> &'static str {
        "device clocks drift"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Depth, Sense::Inertial, Sense::Tether];
        Ok(Box::new(PerSensor::read(tables, facts, &senses, |table| {
            match (table.number("ppm", -1000.0..=1000.0)?, table.number("sd_ppm", 0.0..=1000.0)?) {
                (Some(ppm), None) => Ok(Drift::Given { ppm }),
                (None, Some(sd_ppm)) => Ok(Drift::Drawn { sd_ppm }),
                (None, None) => Err(table.invalid("ppm", "is missing; give ppm or sd_ppm")),
                (Some(_), Some(_)) => {
                    Err(table.invalid("ppm", "cannot be combined with sd_ppm; give one of them"))
                }
            }
        })?))
    }
}

impl Effect for PerSensor<Drift> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, drift) in &self.0 {
            let ppm = match drift {
                Drift::Given { ppm } => *ppm,
                Drift::Drawn { sd_ppm } => sd_ppm * sim.stream(*source).at(0).normal()[0],
            };
            sim.insert(*source, Clock::slow_by_ppm(ppm));
        }
        sim.system(Stage::Begin, true_times::<Pressure>);
        sim.system(Stage::Begin, true_times::<Inertia>);
        sim.system(Stage::Begin, true_times::<Payout>);
        Ok(())
    }
}

fn true_times<M: Measurement>(mut devices: Query<'_, '_, (&mut Samples<M>, &Clock)>) {
    for (mut samples, clock) in &mut devices {
        for measured in &mut samples.list {
            measured.set_at(clock.truly(measured.at()));
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::time::DurNs;

    use super::*;
    use crate::clock::START;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    #[test]
    fn sample_delay_and_count_match_the_clock_drift() {
        for ppm in [400.0, -400.0] {
            let keys = format!("[effects.clock_drift]\nppm = {ppm}\n");
            let (plain, late) =
                (Bench::long("").run::<Inertia>("imu"), Bench::long(&keys).run::<Inertia>("imu"));
            for (plain, late) in plain.iter().zip(&late) {
                let after_s = plain.at.since(START).as_secs_f64();
                let late_s = late.at.since(plain.at).as_secs_f64();
                assert!((late_s - after_s * ppm * 1e-6).abs() < 2e-9);
            }
            let more = late.len() as f64 / plain.len() as f64 - 1.0;
            assert!((more + ppm * 1e-6).abs() < 3.0 / plain.len() as f64, "{more}");
            let period =
                DurNs::from_secs_f64(plain[1].at.since(plain[0].at).as_secs_f64() * (1.0 + ppm * 1e-6));
            let steps = late.windows(2).map(|w| w[1].at.since(w[0].at).0 - period.0);
            assert!(steps.into_iter().all(|off| off.abs() <= 2));
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.clock_drift]\nppm = -900\n"));
        same_in_any_slices(&Bench::turning("[effects.clock_drift]\nsd_ppm = 900\n"));
        let why = |keys: &str| refusal(&format!("[effects.clock_drift]\n{keys}"));
        assert!(why("ppm = 1\nsensors = [\"head_a\"]").contains("can act on: depth, imu, tether"));
        assert!(why("ppm = 1\nsensors = [\"ping\"]").contains("can act on: depth, imu, tether"));
        assert!(why("").contains("is missing; give ppm or sd_ppm"));
        assert!(why("ppm = 1\nsd_ppm = 1").contains("cannot be combined with sd_ppm"));
    }
}
