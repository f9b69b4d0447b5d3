//! The tether lags behind the vehicle because the tender winds late and in bursts.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Payout;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// The tender pays out and recovers cable in bursts.
///
/// The counter is stationary until vehicle and cable are `hold_m` apart (0.5 by default). Then the drum winds at
/// `speed_mps` (0.5 by default) until they agree. A drum slower than the vehicle never catches up. Like slack, the
/// difference is relative to its value when the counter was zeroed, so it can have either sign.
pub(super) struct TetherLagKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    hold_m: f64,
    speed_mps: f64,
}

#[derive(Component)]
struct TetherLag {
    parameters: Parameters,
    /// Time and value of the cable counter's previous reading.
    counted: Option<(MonoNs, f64)>,
    winding: bool,
}

impl EffectKind for TetherLagKind {
    fn name(&self) -> &'static str {
        // Scenes call the effect by this name, although the module has another name.
        "late_winding"
    }

    fn summary(&self) -> &'static str {
        "the tender pays out and hauls in the cable late, in bursts"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            let hold_m = table.number("hold_m", 0.01..=50.0)?.unwrap_or(0.5);
            let speed_mps = table.number("speed_mps", 0.01..=5.0)?.unwrap_or(0.5);
            Ok(Parameters { hold_m, speed_mps })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let lag = TetherLag { parameters: *parameters, counted: None, winding: false };
            sim.insert(*source, lag);
        }
        sim.system(Stage::Feel, wind);
        Ok(())
    }
}

fn wind(mut counters: Query<'_, '_, (&mut Samples<Payout>, &mut TetherLag)>) {
    for (mut samples, mut winding) in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m = winding.count(payout.at, payout.chainage_m);
        }
    }
}

impl TetherLag {
    fn count(&mut self, at: MonoNs, travelled_m: f64) -> f64 {
        let Parameters { hold_m, speed_mps } = self.parameters;
        let (before, counted_m) = self.counted.unwrap_or((at, travelled_m));
        let apart_m = travelled_m - counted_m;
        let most_m = speed_mps * at.since(before).as_secs_f64();
        let wound_m = if self.winding { apart_m.clamp(-most_m, most_m) } else { 0.0 };
        let left_m = (apart_m - wound_m).abs();
        self.winding = if self.winding { left_m > 0.0 } else { left_m >= hold_m };
        let counted_m = counted_m + wound_m;
        self.counted = Some((at, counted_m));
        counted_m
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;
    use headrace_geometry::time::DurNs;

    use super::*;
    use crate::clock::START;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    fn winding() -> TetherLag {
        let parameters = Parameters { hold_m: 0.5, speed_mps: 0.6 };
        TetherLag { parameters, counted: None, winding: false }
    }

    /// With the hold distance h, the vehicle's speed v and the drum's speed w, the drum stands still for h / v, and
    /// then winds for h / (w - v). The mean lag of the count is h / 2.
    #[test]
    fn cable_count_lags_in_a_sawtooth_at_steady_vehicle_speed() {
        let (mut winding, period_s) = (winding(), 0.01);
        let counts: Vec<f64> = (0..100_000)
            .map(|k| {
                let after_s = f64::from(k) * period_s;
                winding.count(START + DurNs::from_secs_f64(after_s), 0.2 * after_s)
            })
            .collect();
        let lag = |k: usize| 0.2 * k as f64 * period_s - counts[k];
        assert!((0..counts.len()).all(|k| (-1e-9..=0.502 + 1e-9).contains(&lag(k))));
        let moving = counts.windows(2).filter(|w| w[1] > w[0]).count() as f64 / counts.len() as f64;
        // The drum winds for a share v / w of the time, which is the vehicle's speed divided by the drum's speed.
        assert!((moving - 0.2 / 0.6).abs() < 0.01, "{moving}");
        let mean_m = (0..counts.len()).map(lag).sum::<f64>() / counts.len() as f64;
        assert!((mean_m - 0.25).abs() < 0.01, "{mean_m}");
        let bursts = counts.windows(3).filter(|w| w[1] <= w[0] && w[2] > w[1]).count() as f64;
        let wanted = 1000.0 / (0.5 / 0.2 + 0.5 / 0.4);
        assert!((bursts - wanted).abs() < 0.02 * wanted, "{bursts} {wanted}");
    }

    #[test]
    fn cable_count_lags_equally_in_both_directions() {
        let mut winding = winding();
        for k in 0..1000 {
            let travelled_m = 3.0 + 0.49 * math::sin(f64::from(k) * 0.05);
            assert!(
                (winding.count(START + DurNs::from_millis(i64::from(k) * 20), travelled_m) - 3.0).abs()
                    < 1e-12
            );
        }
        let mut at = |millis: i64, travelled_m| {
            winding.count(START + DurNs::from_millis(20_000 + millis), travelled_m)
        };
        assert!((at(0, 2.4) - 3.0).abs() < 1e-12);
        assert!((at(500, 2.4) - 2.7).abs() < 1e-9 && (at(2000, 2.4) - 2.4).abs() < 1e-12);
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.late_winding]\nhold_m = 0.2\n"));
        assert!(refusal("[effects.late_winding]\nspeed_mps = 0\n").contains("from 0.01 to 5"));
    }
}
