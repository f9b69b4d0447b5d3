//! A current of the water along the tunnel.

use headrace_config::{ConfigError, Section};
use headrace_geometry::math;

use super::effect::{Effect, EffectKind};
use super::keys;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::random::Stream;
use crate::stretch::Stretch;
use crate::trajectory::{Flow, Ground, Knots, Trajectory};

const NAME: &str = "current";
/// Number of random speeds drawn in each correlation time of the gusts.
const STEPS: f64 = 8.0;
/// Largest distance beyond the tunnel's ends to which a current may carry the vehicle, m. Trajectories have this limit
/// too.
const OUTSIDE_M: f64 = 20.0;
/// Interval at which the trajectory is checked against [`OUTSIDE_M`], s.
const LOOK_S: f64 = 5.0;

/// The water flows along the tunnel and carries a vehicle that keeps its speed through the water.
///
/// Legs and a pilot's course end at the same place as without a current, after a different duration.
///
/// `speed_mps`, positive towards growing chainage, applies from `from_m` to `to_m`. Several tables define several
/// stretches, as on both sides of a leak. `gust_sd_mps`, in a table for the whole tunnel, adds a Gauss-Markov variation
/// whose correlation falls to 1/e within `gust_s` (60 by default). The pilot doesn't correct the displacement that
/// gusts cause. A trajectory given over ground is independent of currents, so combining the two is refused.
///
/// Source: Jorge et al. 2021, §9.1 (0.10 m/s through a leak, against the vehicle or with it).
pub(super) struct CurrentKind;

#[derive(Debug, Clone)]
struct Current {
    flow: Flow,
    gust_sd_mps: f64,
    gust_s: f64,
    length_m: f64,
}

impl EffectKind for CurrentKind {
    fn name(&self) -> &'static str {
        NAME
    }

    fn summary(&self) -> &'static str {
        "water flows along the tunnel and carries the vehicle"
    }

    fn read(&self, tables: Vec<Section<'_>>, facts: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let mut current =
            Current { flow: Flow::default(), gust_sd_mps: 0.0, gust_s: 60.0, length_m: facts.length_m };
        for table in tables {
            if facts.ground == Ground::Tunnel {
                return Err(table.invalid_itself("changes nothing: the trajectory is given over ground"));
            }
            let stretch = Stretch::read(&table, facts.length_m)?;
            let speed_mps = keys::or_zero(&table, "speed_mps", -2.0..=2.0)?;
            let gust_sd_mps = keys::or_zero(&table, "gust_sd_mps", 0.0..=1.0)?;
            let gust_s = table.number("gust_s", 1.0..=3600.0)?;
            keys::some_not_zero(&table, &[("speed_mps", speed_mps), ("gust_sd_mps", gust_sd_mps)])?;
            if gust_sd_mps > 0.0 {
                if stretch != Stretch::ALL || current.gust_sd_mps > 0.0 {
                    let problem = "must be in one table without from_m and to_m: gusts affect all the water";
                    return Err(table.invalid("gust_sd_mps", problem));
                }
                (current.gust_sd_mps, current.gust_s) = (gust_sd_mps, gust_s.unwrap_or(current.gust_s));
            }
            table.finish()?;
            if speed_mps != 0.0 && !current.flow.add(stretch, speed_mps) {
                return Err(table.invalid("from_m", "begins a stretch that overlaps one of an earlier table"));
            }
        }
        Ok(Box::new(current))
    }
}

impl Effect for Current {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        let gusts = (self.gust_sd_mps > 0.0).then(|| sim.stream_for("water"));
        let what = format!("a current of {}, gusts of {} m/s", self.flow, self.gust_sd_mps);
        let Some(mut scenery) = sim.scenery(what) else { return Ok(()) };
        let refuse = |problem| SceneError::Effect { effect: NAME, problem };
        scenery.trajectory.carry(&self.flow).map_err(refuse)?;
        if let Some(stream) = gusts {
            let duration_s = scenery.trajectory.duration_s();
            scenery.trajectory.sway(self.carried(stream, duration_s));
        }
        self.check(&scenery.trajectory).map_err(refuse)
    }
}

impl Current {
    /// Displacement of the vehicle by gusts since the dive's start.
    fn carried(&self, stream: Stream, duration_s: f64) -> Knots {
        let [start_m, ..] = self.carried_from(0.0, stream, duration_s).at(0.0);
        self.carried_from(-start_m, stream, duration_s)
    }

    fn carried_from(&self, start_m: f64, stream: Stream, duration_s: f64) -> Knots {
        let spacing_s = self.gust_s / STEPS;
        let kept = math::exp(-spacing_s / self.gust_s);
        let fresh = math::sqrt(1.0 - kept * kept);
        let (mut speed_mps, mut x_m) = (0.0, start_m);
        Knots::new(duration_s, spacing_s, |k| {
            let step = (k + 1).unsigned_abs();
            let [drawn, _] = stream.at(step).normal();
            let new = self.gust_sd_mps * drawn;
            speed_mps = if step == 0 { new } else { speed_mps * kept + new * fresh };
            x_m += speed_mps * spacing_s;
            [x_m, 0.0, 0.0, 0.0, 0.0, 0.0]
        })
    }

    fn check(&self, trajectory: &Trajectory) -> Result<(), String> {
        let steps = math::floor_to_i64(trajectory.duration_s() / LOOK_S) + 1;
        for step in 0..=steps {
            let after_s = (step as f64 * LOOK_S).min(trajectory.duration_s());
            let chainage_m = trajectory.place(after_s).chainage_m;
            if !(-OUTSIDE_M..=self.length_m + OUTSIDE_M).contains(&chainage_m) {
                return Err(format!(
                    "carries the vehicle out of the tunnel: to chainage {chainage_m:.1} m after {after_s:.0} s"
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing_motion::{Bench, LEGS, PILOT, WAYPOINTS};

    #[test]
    fn steady_current_changes_the_duration_of_legs_but_not_their_end() {
        for (current_mps, duration_s) in [(0.1, 20.0 / 0.3 + 4.0 / 0.3), (-0.1, 20.0 / 0.1 + 4.0 / 0.5)] {
            let keys = format!("[effects.current]\nspeed_mps = {current_mps}\n");
            let trajectory = "start_m = 2.0\n[[trajectory.legs]]\ndistance_m = 20\nspeed_mps = 0.2\n\
                              [[trajectory.legs]]\ndistance_m = 4\nspeed_mps = -0.4\n";
            let sim = Bench::on(trajectory, &keys).simulation();
            assert!((sim.duration_s() - duration_s).abs() < 1e-6, "{}", sim.duration_s());
            let end_m = sim.pose(sim.end()).unwrap().position.x();
            assert!((end_m - 18.0).abs() < 1e-6, "{end_m}");
        }
    }

    #[test]
    fn current_changes_the_duration_of_a_piloted_drive_but_not_its_end() {
        let end = |keys: &str| {
            let sim = Bench::on(PILOT, keys).simulation();
            (sim.duration_s(), sim.pose(sim.end()).unwrap().position.x())
        };
        let (still_s, still_m) = end("");
        let (with_s, with_m) = end("[effects.current]\nspeed_mps = 0.1\n");
        let (against_s, against_m) = end("[effects.current]\nspeed_mps = -0.1\n");
        assert!(with_s < still_s && still_s < against_s, "{with_s} {still_s} {against_s}");
        for end_m in [still_m, with_m, against_m] {
            assert!((end_m - 40.0).abs() < 0.2, "{end_m}");
        }
    }

    /// Checks the standard deviation of the gusts' speed, their correlation after `gust_s`, and the vehicle's
    /// displacement by gusts.
    ///
    /// For times t well above the correlation time T, the variance of the displacement is 2 sd^2 T t.
    #[test]
    fn gusts_have_the_given_sd_and_correlation_time() {
        let current = Current { flow: Flow::default(), gust_sd_mps: 0.05, gust_s: 20.0, length_m: 1e6 };
        let (mut speeds, mut lagged, mut ways) = (0.0, 0.0, 0.0);
        let (runs, seconds) = (200_u32, 4000.0);
        let mut count = 0.0;
        for run in 0..runs {
            let stream = Stream::new(u64::from(run), NAME, "water");
            let carried = current.carried(stream, seconds);
            let speed = |after_s: f64| (carried.at(after_s + 2.5)[0] - carried.at(after_s)[0]) / 2.5;
            for k in 0..190 {
                let after_s = f64::from(k) * 20.0;
                speeds += speed(after_s) * speed(after_s);
                lagged += speed(after_s) * speed(after_s + 20.0);
                count += 1.0;
            }
            let way_m = carried.at(seconds)[0] - carried.at(0.0)[0];
            ways += way_m * way_m / f64::from(runs);
        }
        let sd_mps = math::sqrt(speeds / count);
        // The spline through the displacements slightly smooths the fastest changes, so the standard deviation is a
        // little below 0.05.
        assert!((0.046..0.051).contains(&sd_mps), "{sd_mps}");
        let correlation = lagged / speeds;
        assert!((correlation - math::exp(-1.0)).abs() < 0.04, "{correlation}");
        // Each random speed lasts for one step. The expected variance is therefore the variance of a sum of discrete
        // steps, not of an integral.
        let kept = math::exp(-1.0 / STEPS);
        let wanted = 0.05 * 0.05 * seconds * (20.0 / STEPS) * (1.0 + kept) / (1.0 - kept);
        assert!((ways / wanted - 1.0).abs() < 5.0 * math::sqrt(2.0 / f64::from(runs)), "{ways} {wanted}");
    }

    #[test]
    fn current_that_carries_the_vehicle_out_or_has_no_effect_is_refused() {
        let why = |trajectory: &str, keys: &str| {
            Bench::on(trajectory, &format!("[effects.current]\n{keys}")).refusal()
        };
        let strong = why(LEGS, "speed_mps = -0.3");
        assert!(strong.starts_with("simulating current: it carries the vehicle off: leg 0"), "{strong}");
        let strong = why(PILOT, "speed_mps = -0.5");
        assert!(
            strong.contains("current: it carries the vehicle off: the vehicle has not reached 40 m"),
            "{strong}"
        );
        let ground = why(WAYPOINTS, "speed_mps = 0.1");
        assert!(
            ground.contains("effects.current: changes nothing: the trajectory is given over ground"),
            "{ground}"
        );
        assert!(why(LEGS, "").contains("gust_sd_mps must not be zero"));
        let out = why(LEGS, "gust_sd_mps = 1\ngust_s = 3600");
        assert!(out.contains("out of the tunnel") || out.is_empty(), "{out}");
    }
}
