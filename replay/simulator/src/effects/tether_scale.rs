//! Scale error of the cable counter, and stretch of the cable.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Payout;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// The counter's wheel is larger or smaller than the vehicle file says, and the cable stretches under drag.
///
/// `share` is the relative excess of the counted length, from -0.1 to 0.1 (0). `stiffness_n` is the cable's axial
/// stiffness EA, in newtons. It enables `drag_npm`, the drag on each metre of moving cable (0.05).
///
/// The cable passes the wheel under the tension that the tender keeps. A point of the cable farther in also bears the
/// drag of all cable between this point and the wheel. For x metres of cable, the mean strain is therefore drag x / (2
/// EA), and x metres of tunnel are counted as x / (1 + drag x / (2 EA)). The strain on the way back is the same. The
/// cable's own hysteresis, and friction that hasn't built up yet after a turn, aren't simulated. Source: Hooke's law
/// for a rod under evenly distributed load (Timoshenko, "Strength of Materials", part I, ch. I).
pub(super) struct TetherScaleKind;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Parameters {
    share: f64,
    /// Mean strain of the cable per metre of cable out, 1/m.
    strain_pm: f64,
}

#[derive(Component)]
struct TetherScale(Parameters);

impl EffectKind for TetherScaleKind {
    fn name(&self) -> &'static str {
        "tether_scale"
    }

    fn summary(&self) -> &'static str {
        "the cable counter has a scale error, and the cable stretches"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            let share = keys::or_zero(table, "share", -0.1..=0.1)?;
            let stiffness_n = table.number("stiffness_n", 1e3..=1e9)?;
            let drag_npm = table.number("drag_npm", 0.0..=100.0)?;
            if drag_npm.is_some() && stiffness_n.is_none() {
                return Err(table.invalid("drag_npm", "has an effect only with stiffness_n"));
            }
            let strain_pm = stiffness_n.map_or(0.0, |stiff_n| drag_npm.unwrap_or(0.05) / (2.0 * stiff_n));
            keys::some_not_zero(table, &[("share", share), ("stiffness_n", strain_pm)])?;
            Ok(Parameters { share, strain_pm })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            sim.insert(*source, TetherScale(*parameters));
        }
        sim.system(Stage::Feel, count);
        Ok(())
    }
}

impl Parameters {
    /// Counted length for a given length of cable out, m.
    fn counted_m(&self, out_m: f64) -> f64 {
        out_m * (1.0 + self.share) / (1.0 + self.strain_pm * out_m.abs())
    }
}

fn count(mut counters: Query<'_, '_, (&mut Samples<Payout>, &TetherScale)>) {
    for (mut samples, TetherScale(parameters)) in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m = parameters.counted_m(payout.chainage_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_sensor::measurement::Payout;

    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    fn counts(effects: &str) -> Vec<f64> {
        Bench::turning(effects).run::<Payout>("tether").iter().map(|payout| payout.chainage_m).collect()
    }

    #[test]
    fn cable_counter_with_too_small_a_wheel_counts_too_much() {
        let (plain, off) = (counts(""), counts("[effects.tether_scale]\nshare = 0.005\n"));
        assert!(plain.len() > 100);
        assert!(plain.iter().zip(&off).all(|(is, counted)| (counted / is - 1.005).abs() < 1e-12));
    }

    /// Compares the counted length with that of a cable made of many short rods in series, each stretched by the drag
    /// on the rods nearer to the wheel.
    #[test]
    fn cable_stretches_like_rods_in_series() {
        let (stiffness_n, drag_npm) = (40_000.0, 0.5);
        let parameters = Parameters { share: 0.0, strain_pm: drag_npm / (2.0 * stiffness_n) };
        for counted_m in [10.0, 700.0, 7000.0] {
            let rods = 100_000;
            let rod_m = counted_m / f64::from(rods);
            let mut reach_m = 0.0;
            for rod in 0..rods {
                // The mean tension of a rod is the tension at its middle: the drag on all cable nearer to the wheel.
                let tension_n = drag_npm * (f64::from(rod) + 0.5) * rod_m;
                reach_m += rod_m * (1.0 + tension_n / stiffness_n);
            }
            // Here the drag is computed from the counted length, which is shorter than the stretched length. This
            // changes the result by about the square of the strain.
            let strain = drag_npm * counted_m / (2.0 * stiffness_n);
            let off = parameters.counted_m(reach_m) / counted_m - 1.0;
            assert!(off.abs() < 1.01 * strain * strain + 1e-9, "{counted_m}: {off}");
            assert!(reach_m / counted_m - 1.0 > 0.99 * strain);
        }
    }

    /// Without the key `drag_npm`, the drag is 0.05 N/m. The mean tension is half of the total drag.
    #[test]
    fn stiffness_and_drag_keys_set_the_cable_strain() {
        let plain = counts("");
        for (keys, strain_pm) in
            [("stiffness_n = 2000\n", 1.25e-5), ("stiffness_n = 2000\ndrag_npm = 0.4\n", 1e-4)]
        {
            let counted = counts(&format!("[effects.tether_scale]\n{keys}"));
            for (is, counted) in plain.iter().zip(&counted) {
                assert!((counted - is / (1.0 + strain_pm * is)).abs() < 1e-12, "{keys}: {is} {counted}");
            }
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.tether_scale]\nshare = -0.01\nstiffness_n = 5e4\n"));
        assert!(
            refusal("[effects.tether_scale]\n")
                .contains("share: at least one of share, stiffness_n must not be zero")
        );
        assert!(refusal("[effects.tether_scale]\ndrag_npm = 1\n").contains("only with stiffness_n"));
        assert!(refusal("[effects.tether_scale]\nshare = 0.2\n").contains("from -0.1 to 0.1"));
    }
}
