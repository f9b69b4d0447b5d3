//! Drift of the vehicle about its trajectory.

use headrace_config::{ConfigError, Section};

use super::effect::{Effect, EffectKind};
use super::keys;
use crate::builder::Builder;
use crate::error::SceneError;
use crate::facts::Facts;
use crate::trajectory::{Offsets, wandering};

/// The vehicle drifts left and right, up and down, and turns, as under a pilot.
///
/// Each component varies smoothly and independently. Its largest value either way is called its reach: `across_m`,
/// `up_m`, `roll_deg`, `pitch_deg`, `yaw_deg`. The standard deviation of a component is 0.4 of its reach. `period_s`
/// (30 by default) is the period of the drift. The control points of a cubic B-spline are half a period apart. Source:
/// Jorge et al. 2021, §8.1 (the pilot can drift 1.5 m vertically and horizontally, the heading 15 degrees).
pub(super) struct PilotDriftKind;

#[derive(Debug, Clone, Copy)]
struct Drift {
    reach: Offsets,
    period_s: f64,
}

impl EffectKind for PilotDriftKind {
    fn name(&self) -> &'static str {
        "pilot_drift"
    }

    fn summary(&self) -> &'static str {
        "the vehicle deviates from its trajectory"
    }

    fn read(&self, tables: Vec<Section<'_>>, _: &Facts) -> Result<Box<dyn Effect>, ConfigError> {
        let mut drift = Drift { reach: [0.0; 6], period_s: 30.0 };
        for table in keys::only_one(tables)? {
            let metres = |key| keys::or_zero(&table, key, 0.0..=20.0);
            let degrees = |key| keys::or_zero(&table, key, 0.0..=80.0).map(f64::to_radians);
            let (y, z) = (metres("across_m")?, metres("up_m")?);
            let (roll, pitch, yaw) = (degrees("roll_deg")?, degrees("pitch_deg")?, degrees("yaw_deg")?);
            let values =
                [("across_m", y), ("up_m", z), ("roll_deg", roll), ("pitch_deg", pitch), ("yaw_deg", yaw)];
            keys::some_not_zero(&table, &values)?;
            drift.reach = [0.0, y, z, roll, pitch, yaw];
            drift.period_s = table.number("period_s", 1.0..=3600.0)?.unwrap_or(drift.period_s);
            table.finish()?;
        }
        Ok(Box::new(drift))
    }
}

impl Effect for Drift {
    fn build(&self, sim: &mut Builder<'_>) -> Result<(), SceneError> {
        let stream = sim.stream_for("vehicle");
        let [_, y, z, roll, pitch, yaw] = self.reach;
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
        let what = format!(
            "deviates by up to {y} m across, {z} m up, {roll:.1} deg of roll, {pitch:.1} of pitch, {yaw:.1} of yaw"
        );
        let Some(mut scenery) = sim.scenery(what) else { return Ok(()) };
        let duration_s = scenery.trajectory.duration_s();
        scenery.trajectory.sway(wandering(stream, duration_s, self.period_s, self.reach));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use headrace_geometry::math;

    use crate::testing_motion::{Bench, LONG};

    #[test]
    fn pilot_drift_reaches_its_limits_without_exceeding_them() {
        let keys = "[effects.pilot_drift]\nacross_m = 1.5\nup_m = 0.5\nyaw_deg = 15\nperiod_s = 2\n";
        let (plain, sim) = (Bench::on(LONG, "").simulation(), Bench::on(LONG, keys).simulation());
        let reach = [0.0, 1.5, 0.5, 0.0, 0.0, f64::to_radians(15.0)];
        let (mut squares, mut count) = ([0.0; 6], 0.0);
        let mut after_s = 0.0;
        while after_s < sim.duration_s() {
            let places = [&plain, &sim].map(|sim| sim.scenery().unwrap().trajectory.place(after_s));
            let list = |p: &crate::trajectory::Place| {
                let ([y, z], [roll, pitch, yaw]) = (p.across_m, p.turned_rad);
                [p.chainage_m, y, z, roll, pitch, yaw]
            };
            for (axis, (was, is)) in list(&places[0]).into_iter().zip(list(&places[1])).enumerate() {
                assert!((is - was).abs() <= reach[axis] + 1e-12, "{axis} at {after_s}");
                squares[axis] += (is - was) * (is - was);
            }
            (after_s, count) = (after_s + 1.0, count + 1.0);
        }
        for (axis, sum) in squares.into_iter().enumerate() {
            let sd = math::sqrt(sum / count);
            // The tolerance allows for the error of a standard deviation from about 320 independent values.
            assert!((sd - 0.4 * reach[axis]).abs() <= 0.1 * reach[axis], "{axis}: {sd}");
        }
    }

    #[test]
    fn drift_into_a_wall_and_zero_reach_are_refused() {
        let why = |keys: &str| Bench::on(LONG, &format!("[effects.pilot_drift]\n{keys}")).refusal();
        assert!(why("across_m = 20").contains("leads through the wall"));
        assert!(why("period_s = 5").contains("must not be zero"));
    }
}
