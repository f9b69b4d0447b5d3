//! Slowing of heads at the ends of their sectors.

use bevy_ecs::prelude::{Component, Query};
use headrace_config::{ConfigError, Section};
use headrace_geometry::math::{self, TAU};
use headrace_geometry::time::MonoNs;
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::targets::PerSensor;
use super::targets::targets;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::sensing::Samples;
use crate::stages::Stage;

/// A head in a sector follows its commands with a first-order lag and reports its true angle.
///
/// The head slows down at the ends of its sector. The steps there are short, which gives the false minima that Jorge et
/// al. 2021 describe. Heads that turn continuously are unchanged. `lag_ms` is the time constant, 100 by default. The
/// command is assumed to change linearly between two pings, and for such a command the lag is exact. The head begins at
/// rest. Source: Jorge et al. 2021, §8.1 (sensors "decreasing speed due to the control system of the head").
pub(super) struct SectorEndSlowingKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    lag_s: f64,
}

#[derive(Component)]
struct SectorEndSlowing {
    lag_s: f64,
    commanded: Option<(MonoNs, f64)>,
    /// Current lag of the head behind its command, radians.
    behind_rad: f64,
}

impl EffectKind for SectorEndSlowingKind {
    fn name(&self) -> &'static str {
        "sector_end_slowing"
    }

    fn summary(&self) -> &'static str {
        "heads slow down at the ends of their sectors, with shorter steps there"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        Ok(Box::new(PerSensor::read(tables, facts, &[Sense::Head], |table| {
            let heads = targets(table, facts, &[Sense::Head])?;
            if !heads.into_iter().any(|source| has_sector(facts, source)) {
                return Err(
                    table.invalid_itself("has nothing to act on: none of its heads turns in a sector")
                );
            }
            Ok(Parameters { lag_s: table.number("lag_ms", 0.1..=10_000.0)?.unwrap_or(100.0) * 1e-3 })
        })?))
    }
}

fn has_sector(facts: &Facts, source: usize) -> bool {
    let program = facts.sensors.get(source).and_then(|sensor| sensor.program);
    program.is_some_and(|program| program.sector.is_some())
}

impl Effect for PerSensor<Parameters> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, Parameters { lag_s }) in &self.0 {
            if has_sector(sim.facts(), *source) {
                let slowing = SectorEndSlowing { lag_s: *lag_s, commanded: None, behind_rad: 0.0 };
                sim.insert(*source, slowing);
            }
        }
        sim.system(Stage::Turn, slow);
        Ok(())
    }
}

fn slow(mut heads: Query<'_, '_, (&mut Samples<Sounding>, &mut SectorEndSlowing)>) {
    for (mut samples, mut slowing) in &mut heads {
        for sounding in &mut samples.list {
            let behind_rad = slowing.follow(sounding.at, sounding.angle_rad);
            sounding.angle_rad -= behind_rad;
            sounding.reported_rad -= behind_rad;
        }
    }
}

impl SectorEndSlowing {
    fn follow(&mut self, at: MonoNs, commanded_rad: f64) -> f64 {
        if let Some((before, before_rad)) = self.commanded {
            let elapsed_s = at.since(before).as_secs_f64();
            if elapsed_s > 0.0 {
                let rate_radps = math::wrap_signed(commanded_rad - before_rad, TAU) / elapsed_s;
                let settled_rad = rate_radps * self.lag_s;
                let kept = math::exp(-elapsed_s / self.lag_s);
                self.behind_rad = settled_rad + (self.behind_rad - settled_rad) * kept;
            }
        }
        self.commanded = Some((at, commanded_rad));
        self.behind_rad
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, refusal, same_in_any_slices};

    const KEYS: &str = "[effects.sector_end_slowing]\nlag_ms = 150\n";
    const LAG_S: f64 = 0.15;

    /// The commanded angle c(t) = w t grows from rest. With time constant T, the head's angle is y = w (t - T + T
    /// exp(-t / T)).
    #[test]
    fn lag_at_sector_ends_matches_its_closed_form() {
        let (plain, slowed) = (pings(""), pings(KEYS));
        let first_rad = turned(&plain[0], &plain[1]);
        let rate_radps = first_rad / between_s(&plain[0], &plain[1]);
        let to_end = plain.windows(2).take_while(|w| turned(&w[0], &w[1]) * first_rad > 0.0).count();
        assert!(to_end > 50, "{to_end}");
        for ping in slowed.iter().take(to_end) {
            let after_s = between_s(&plain[0], ping);
            let wanted = rate_radps * (after_s - LAG_S + LAG_S * math::exp(-after_s / LAG_S));
            let off_rad = math::wrap_signed(turned(&plain[0], ping) - wanted, TAU);
            assert!(off_rad.abs() < 1e-9, "{after_s}: {off_rad}");
        }
    }

    /// The commanded angle has the rate w, whose sign changes at time 0, long after the previous change. With time
    /// constant T, the head then moves at w (2 exp(-t / T) - 1), and reverses at T ln 2.
    #[test]
    fn head_steps_are_short_at_reversals_and_full_elsewhere() {
        let (plain, slowed) = (pings(""), pings(KEYS));
        let step_rad = turned(&plain[0], &plain[1]).abs();
        let period_s = between_s(&plain[0], &plain[1]);
        let turns = |k: &usize| turned(&plain[k - 1], &plain[*k]) * turned(&plain[*k], &plain[k + 1]) < 0.0;
        let ends: Vec<usize> = (1..plain.len() - 1).filter(turns).collect();
        let around: Vec<(usize, &[Sounding])> =
            ends.iter().skip(1).filter_map(|end| Some((*end, slowed.get(end - 20..end + 60)?))).collect();
        assert!(around.len() >= 3, "{ends:?}");
        for (end, around) in around {
            let steps: Vec<f64> = around.windows(2).map(|w| turned(&w[0], &w[1]).abs()).collect();
            assert!((steps[0] / step_rad - 1.0).abs() < 1e-3 && (steps[78] / step_rad - 1.0).abs() < 1e-2);
            let least = (0..steps.len()).min_by(|a, b| steps[*a].total_cmp(&steps[*b])).unwrap();
            assert!(steps[least] < 0.2 * step_rad);
            let turns_s = between_s(&plain[end], &around[least]) + 0.5 * period_s;
            assert!((turns_s - LAG_S * math::ln(2.0)).abs() < 1.1 * period_s, "{turns_s}");
            assert!(around.iter().all(|ping| ping.angle_rad.to_bits() == ping.reported_rad.to_bits()));
        }
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        same_in_any_slices(&Bench::sectors(KEYS));
        let why = refusal("[effects.sector_end_slowing]\n");
        assert!(why.contains("none of its heads turns in a sector"), "{why}");
    }

    fn pings(effects: &str) -> Vec<Sounding> {
        Bench::sectors(effects).run("head_a")
    }

    fn between_s(a: &Sounding, b: &Sounding) -> f64 {
        b.at.since(a.at).as_secs_f64()
    }

    fn turned(a: &Sounding, b: &Sounding) -> f64 {
        math::wrap_signed(b.angle_rad - a.angle_rad, TAU)
    }
}
