//! Slip of the cable over the counter's wheel.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Payout;

use super::effect::{Effect, EffectKind};
use super::keys;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Samples, Scenery};
use crate::stages::Stage;

/// Length of the stretches into which the travel is divided, m. The cable slips at most once in each stretch.
const STRETCH_M: f64 = 1.0;

/// From time to time the cable slips over the counter's wheel. A slip changes the count permanently.
///
/// The cable slips `per_100m` times per hundred metres of travel, forwards or back. The size of a slip is uniformly
/// distributed over `size_m = [least, most]` (0.05 to 0.3 by default), with either sign. Travel is the distance that
/// the vehicle moves, summed from count to count.
pub(super) struct TetherSlipKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    chance: f64,
    size_m: [f64; 2],
}

#[derive(Component)]
struct TetherSlip {
    parameters: Parameters,
    stream: Stream,
    at_m: Option<f64>,
    gone_m: f64,
    next_stretch: u64,
    /// The slip still to come in the current stretch. The first number is the travel at which the cable slips, m; the
    /// second is the size of the slip, m.
    waiting: Option<(f64, f64)>,
    slipped_m: f64,
}

impl EffectKind for TetherSlipKind {
    fn name(&self) -> &'static str {
        "tether_slip"
    }

    fn summary(&self) -> &'static str {
        "the cable slips on the counter's wheel"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Tether], |table| {
            let per_100m = keys::or_zero(table, "per_100m", 0.0..=100.0)?;
            keys::some_not_zero(table, &[("per_100m", per_100m)])?;
            let size_m = keys::span(table, "size_m", 0.001..=20.0, [0.05, 0.3])?;
            Ok(Parameters { chance: per_100m * STRETCH_M / 100.0, size_m })
        })?))
    }
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, parameters) in &self.0 {
            let slip = TetherSlip::new(*parameters, sim.stream(*source));
            sim.insert(*source, slip);
        }
        sim.system(Stage::Feel, slip);
        Ok(())
    }
}

#[expect(clippy::needless_pass_by_value, reason = "bevy hands systems their arguments by value")]
fn slip(scenery: Res<'_, Scenery>, mut counters: Query<'_, '_, (&mut Samples<Payout>, &mut TetherSlip)>) {
    for (mut samples, mut slip) in &mut counters {
        for payout in &mut samples.list {
            payout.chainage_m += slip.come_to(scenery.chainage_m(payout.at));
        }
    }
}

impl TetherSlip {
    fn new(parameters: Parameters, stream: Stream) -> Self {
        Self { parameters, stream, at_m: None, gone_m: 0.0, next_stretch: 0, waiting: None, slipped_m: 0.0 }
    }

    /// Moves the vehicle to a chainage, and returns the error of the cable count there, m.
    fn come_to(&mut self, chainage_m: f64) -> f64 {
        self.gone_m += self.at_m.map_or(0.0, |before_m| (chainage_m - before_m).abs());
        self.at_m = Some(chainage_m);
        loop {
            match self.waiting {
                Some((after_m, _)) if self.gone_m < after_m => break,
                Some((_, by_m)) => self.slipped_m += by_m,
                None => {}
            }
            self.waiting = None;
            if self.gone_m < self.next_stretch as f64 * STRETCH_M {
                break;
            }
            self.waiting = self.drawn(self.next_stretch);
            self.next_stretch += 1;
        }
        self.slipped_m
    }

    fn drawn(&self, stretch: u64) -> Option<(f64, f64)> {
        let [chance, along] = self.stream.at(stretch).uniform();
        let [size, sign] = self.stream.block(stretch, 1).uniform();
        let [least_m, most_m] = self.parameters.size_m;
        let size_m = least_m + (most_m - least_m) * size;
        let by_m = if sign < 0.5 { size_m } else { -size_m };
        (chance < self.parameters.chance).then_some(((stretch as f64 + along) * STRETCH_M, by_m))
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    fn slip(per_100m: f64) -> TetherSlip {
        let parameters = Parameters { chance: per_100m / 100.0, size_m: [0.1, 0.3] };
        TetherSlip::new(parameters, Stream::new(9, "tether_slip", "tether"))
    }

    fn slips(places_m: impl Iterator<Item = f64>) -> Vec<f64> {
        let (mut slip, mut before_m, mut slips) = (slip(5.0), 0.0_f64, Vec::new());
        for place_m in places_m {
            let off_m = slip.come_to(place_m);
            if off_m.to_bits() != before_m.to_bits() {
                slips.push(off_m - before_m);
            }
            before_m = off_m;
        }
        slips
    }

    #[test]
    fn cable_slips_have_the_given_rate_and_size() {
        let slips = slips((0..4_000_000).map(|k| f64::from(k) * 0.025));
        let n = slips.len() as f64;
        assert!((n - 5000.0).abs() < 5.0 * math::sqrt(5000.0 * 0.95), "{n}");
        assert!(slips.iter().all(|by_m| (0.1 - 1e-9..=0.3 + 1e-9).contains(&by_m.abs())));
        let mean_m = slips.iter().map(|by_m| by_m.abs()).sum::<f64>() / n;
        assert!((mean_m - 0.2).abs() < 5.0 * 0.0577 / math::sqrt(n), "{mean_m}");
        let gained = slips.iter().filter(|by_m| **by_m > 0.0).count() as f64;
        assert!((gained - n / 2.0).abs() < 2.5 * math::sqrt(n), "{gained}");
    }

    #[test]
    fn cable_slips_equally_on_the_way_forward_and_back() {
        let ahead = slips((0..40_000).map(|k| f64::from(k) * 0.125));
        let back_and_forth = slips(
            (0..40_000).map(|k| f64::from(if k / 800 % 2 == 0 { k % 800 } else { 800 - k % 800 }) * 0.125),
        );
        assert_eq!(ahead.len(), back_and_forth.len());
        assert!(ahead.iter().zip(&back_and_forth).all(|(a, b)| (a - b).abs() < 1e-9));
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::turning("[effects.tether_slip]\nper_100m = 60\n"));
        assert!(refusal("[effects.tether_slip]\n").contains("must not be zero"));
        assert!(refusal("[effects.tether_slip]\nper_100m = 1\nsize_m = [1]\n").contains("[least, most]"));
    }
}
