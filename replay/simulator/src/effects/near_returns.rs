//! Sonar returns from objects in front of the wall, in clusters.

use bevy_ecs::prelude::{Component, Query, Res};
use headrace_config::{ConfigError, Section};
use headrace_sensor::device::Sense;
use headrace_sensor::measurement::Sounding;

use super::effect::{Effect, EffectKind};
use super::places::Places;
use super::runs::Runs;
use super::targets::PerSensor;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::sensing::{Rays, Samples, Scenery};
use crate::stages::Stage;

/// Bubbles, clouds of silt or weed in front of the wall return the sound.
///
/// Consecutive pings hit the same cluster and return about the same range. The next cluster has another range. Keys,
/// with defaults in brackets:
/// - `from_m` and `to_m` of the stretch in which this happens.
/// - `share`, the share of pings that hit a cluster, from 0 (excluded) to 0.95. `mean_run`, the mean number of
///   consecutive pings that hit a cluster, as in missing_returns.
/// - `near_m` (0.6) and `far_m` (3), the least and the largest range of a cluster, each from 0 to 200 m. Ranges of
///   clusters are uniformly distributed.
/// - `spread_m` (0.1), the standard deviation of the returns about the cluster's range.
///
/// A cluster beyond the wall has no effect: the ping returns the wall. Source: docs/why/field.md, "murk": 5 % near
/// returns. Runs: see missing_returns.
pub(super) struct NearReturnsKind;

#[derive(Debug, Clone, Copy)]
struct Parameters {
    runs: Runs,
    between_m: [f64; 2],
    spread_m: f64,
}

#[derive(Component)]
struct NearReturns {
    places: Places<Parameters>,
    stream: Stream,
    cluster: Cluster,
}

/// The current cluster, and whether the previous ping hit it.
#[derive(Debug, Clone, Copy, Default)]
struct Cluster {
    /// Whether the previous ping hit a cluster; `None` before the first ping.
    met: Option<bool>,
    range_m: f64,
}

impl EffectKind for NearReturnsKind {
    fn name(&self) -> &'static str {
        "near_returns"
    }

    fn summary(&self) -> &'static str {
        "bubbles, silt and weed in front of the wall reflect pings, in clusters"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let senses = [Sense::Head, Sense::Echosounder];
        Ok(Box::new(PerSensor::read_by_place(tables, facts, &senses, |table| {
            let runs = Runs::read(table)?;
            let near_m = table.number("near_m", 0.0..=200.0)?.unwrap_or(0.6);
            let far_m = table.number("far_m", 0.0..=200.0)?.unwrap_or(3.0);
            if far_m <= near_m {
                return Err(table.invalid("far_m", &format!("must be above near_m, which is {near_m}")));
            }
            let spread_m = table.number("spread_m", 0.0..=10.0)?.unwrap_or(0.1);
            let runs = runs.ok_or_else(|| table.invalid("share", "must be above zero"))?;
            Ok(Parameters { runs, between_m: [near_m, far_m], spread_m })
        })?))
    }
}

impl Effect for PerSensor<Places<Parameters>> {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        for (source, places) in &self.0 {
            let stream = sim.stream(*source);
            sim.insert(*source, NearReturns { places: places.clone(), stream, cluster: Cluster::default() });
        }
        sim.system(Stage::Hear, meet);
        Ok(())
    }
}

impl Parameters {
    /// Range that the ping of a step returns from a cluster, m; `None` if the ping hits no cluster. Must be called once
    /// for each `step`, in order.
    fn met_m(&self, cluster: &mut Cluster, stream: Stream, step: u64) -> Option<f64> {
        let [chance, place] = stream.at(step).uniform();
        let meets = self.runs.next(cluster.met, chance);
        if meets && cluster.met != Some(true) {
            let [near_m, far_m] = self.between_m;
            cluster.range_m = near_m + place * (far_m - near_m);
        }
        cluster.met = Some(meets);
        meets.then(|| {
            let [off, _] = stream.block(step, 1).normal();
            (cluster.range_m + off * self.spread_m).max(0.0)
        })
    }
}

type Meeting<'a> = (&'a mut Samples<Sounding>, &'a Rays, &'a mut NearReturns);

fn meet(scenery: Res<'_, Scenery>, mut sonars: Query<'_, '_, Meeting<'_>>) {
    for (mut samples, rays, mut near) in &mut sonars {
        let NearReturns { places, stream, cluster } = &mut *near;
        for ((step, sounding), ray) in samples.steps().zip(&rays.0) {
            let Some(parameters) = places.here(&scenery, ray) else {
                *cluster = Cluster::default();
                continue;
            };
            let met_m = parameters.met_m(cluster, *stream, step);
            if let Some(met_m) = met_m.filter(|met_m| sounding.range_m.is_none_or(|wall_m| *met_m < wall_m)) {
                sounding.range_m = Some(met_m);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use crate::testing::Dive;

    /// Range of each ping that hits a cluster; `None` for all other pings. The nearest walls are 2.5 m away.
    fn near(keys: &str) -> Vec<Option<f64>> {
        let dive = Dive { seconds: 2000.0, ..Dive::with_head() };
        let (base, with) = (dive.dive(""), dive.dive(&format!("[effects.near_returns]\n{keys}")));
        let pairs = base.ranges_m(0).into_iter().zip(with.ranges_m(0));
        pairs.map(|(was, is)| is.filter(|_| was != is)).collect()
    }

    /// Consecutive pings that hit one cluster have the same range, except for the given spread. The next cluster has
    /// another range.
    #[test]
    fn near_return_clusters_have_the_given_share_run_length_and_spread() {
        let (share, mean) = (0.1, 6.0);
        let near = near("share = 0.1\nmean_run = 6\nnear_m = 0.8\nfar_m = 2\nspread_m = 0.05");
        let runs: Vec<Vec<f64>> = near
            .chunk_by(|a, b| a.is_some() == b.is_some())
            .filter(|run| run[0].is_some())
            .map(|run| run.iter().copied().flatten().collect())
            .collect();
        let pings = runs.iter().map(Vec::len).sum::<usize>() as f64;
        let found = pings / runs.len() as f64;
        assert!((found - mean).abs() < 5.0 * math::sqrt(mean * (mean - 1.0) / runs.len() as f64), "{found}");
        let correlation = 1.0 - 1.0 / mean - share / (mean * (1.0 - share));
        let whole = near.len() as f64;
        let variance = share * (1.0 - share) / whole * (1.0 + correlation) / (1.0 - correlation);
        assert!((pings / whole - share).abs() < 5.0 * math::sqrt(variance), "{}", pings / whole);

        // Within a run, the variance is the square of the spread. The means of runs vary slightly more than the
        // clusters' ranges, which are uniformly distributed, because each mean has an error.
        let long: Vec<&Vec<f64>> = runs.iter().filter(|run| run.len() > 1).collect();
        let (mut within, mut freedom, mut means) = (0.0, 0.0, Vec::new());
        for run in &long {
            let mean_m = run.iter().sum::<f64>() / run.len() as f64;
            within += run.iter().map(|m| (m - mean_m) * (m - mean_m)).sum::<f64>();
            freedom += run.len() as f64 - 1.0;
            means.push(mean_m);
        }
        assert!((within / freedom / 0.0025 - 1.0).abs() < 5.0 * math::sqrt(2.0 / freedom));
        let n = means.len() as f64;
        let mean_m = means.iter().sum::<f64>() / n;
        let spread = means.iter().map(|m| (m - mean_m) * (m - mean_m)).sum::<f64>() / n;
        assert!((mean_m - 1.4).abs() < 5.0 * math::sqrt(0.12 / n), "{mean_m}");
        assert!((spread / 0.12 - 1.0).abs() < 5.0 * math::sqrt(0.8 / n) + 0.02, "{spread}");
    }

    /// The wall is 3 m away, so half of the clusters from 2 to 4 m are in front of the wall. A ping that the sonar
    /// loses has no return, even if it hit a cluster.
    #[test]
    fn near_return_clusters_beyond_the_wall_have_no_effect() {
        let dive = Dive { seconds: 400.0, ..Dive::with_sounder() };
        let keys = "[effects.near_returns]\nshare = 0.4\nnear_m = 2\nfar_m = 4\nspread_m = 0\n";
        let (base, with) = (dive.dive("").ranges_m(0), dive.dive(keys).ranges_m(0));
        let wall_m = base[0].unwrap();
        assert!(with.iter().all(|range_m| range_m.unwrap() <= wall_m));
        let nearer = with.iter().filter(|range_m| range_m.unwrap() < wall_m).count();
        // The pings of a run hit the same cluster. A run has 1 / (1 - share) pings on average, and longer runs increase
        // the standard deviation of the count.
        let share = 0.4 * (wall_m - 2.0) / 2.0;
        let sd = math::sqrt(share * (1.0 - share) / base.len() as f64 * 2.0 / (1.0 - 0.4));
        assert!((nearer as f64 / base.len() as f64 - share).abs() < 5.0 * sd, "{nearer} of {}", base.len());
        let deaf = format!("[effects.missing_returns]\nfar_from_m = 1\nfar_to_m = 1\n{keys}");
        let heard = dive.dive(&deaf).ranges_m(0).iter().filter(|range_m| range_m.is_some()).count();
        assert_eq!(heard, 0, "a ping that the sonar loses has no range");
    }

    /// There are two stretches with a gap between them. Nearly every ping hits a cluster, and the first stretch's
    /// cluster must end with the stretch.
    #[test]
    fn near_return_cluster_ends_at_the_end_of_its_stretch() {
        let dive = Dive { seconds: 60.0, ..Dive::with_head() };
        let table = |from_m: f64, near_m: f64| {
            format!(
                "[[effects.near_returns]]\nshare = 0.95\nmean_run = 1000\nnear_m = {near_m}\nfar_m = {}\nspread_m = 0\n\
                 from_m = {from_m}\nto_m = {}\n",
                near_m + 0.01,
                from_m + 3.0
            )
        };
        let effects = format!("[effects.motion_within_turn]\n{}{}", table(2.0, 0.8), table(6.0, 1.5));
        let (mut first, mut second) = (0, 0);
        for row in &dive.dive(&effects).rows {
            let range_m = row.sounding.unwrap().measured.range_m.unwrap();
            let is_first = (0.8..0.8101).contains(&range_m);
            let is_second = (1.5..1.5101).contains(&range_m);
            assert!(!is_first || (2.0..5.0).contains(&row.chainage_m), "{range_m} m at {} m", row.chainage_m);
            assert!(
                !is_second || (6.0..9.0).contains(&row.chainage_m),
                "{range_m} m at {} m",
                row.chainage_m
            );
            (first, second) = (first + usize::from(is_first), second + usize::from(is_second));
        }
        assert!(first > 50 && second > 50, "{first} {second}");
    }

    #[test]
    fn time_slice_length_does_not_change_results() {
        Dive::with_head().assert_slices_dont_matter("[effects.near_returns]\nshare = 0.3\nmean_run = 9");
        let refusal = |keys: &str| Dive::with_head().refusal(&format!("[effects.near_returns]\n{keys}"));
        assert!(refusal("").contains("share: must be above zero"));
        assert!(refusal("share = 0.1\nnear_m = 4").contains("must be above near_m, which is 4"));
    }
}
