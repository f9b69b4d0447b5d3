//! Measures two quantities for each effect of a scene: its computing cost, and its influence on the loop's results.
//!
//! The same dives are simulated with and without the effect, seed by seed. Each effect draws its own random numbers, so
//! the two dives of a seed differ only by the effect. The mean difference over the seeds has a 95 % confidence interval
//! by Student's t.
//!
//! D is the diameter of a section's hole: the largest circle on its wall without samples.

use headrace_coverage::Verdict;
use std::collections::BTreeMap;

use headrace_geometry::math;
use headrace_monitor::App;
use headrace_monitor::report::Report;
use headrace_sensor::device::{Direction, Sense};
use headrace_simulator::Scene;
use rustix::time::{ClockId, clock_gettime};

use crate::adviser::{SimulationError, simulation};
use crate::drive::{DriveError, Pace, drive};
use crate::simulation_feed::SimulationFeed;

/// Maximum change of the hole diameter D, m, that counts as negligible. The whole confidence interval of the change
/// must be within this limit.
pub const HOLE_LIMIT_M: f64 = 0.01;
/// Maximum change of the passed length that counts as negligible, as a share of the coverage extent.
pub const PASSED_LIMIT: f64 = 0.01;

/// Reason why the effects of a scene can't be measured.
#[derive(Debug, thiserror::Error)]
pub enum EffectInfluenceError {
    /// A scene can't be simulated, possibly because an effect was left out.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The monitor's loop can't be set up (armed) for the scene's vehicle.
    #[error("arming the loop that judges the scene: {0}")]
    Loop(#[from] headrace_monitor::PluginError),
    /// The monitor's loop can't process a simulated dive.
    #[error(transparent)]
    Drive(#[from] DriveError),
    /// There are too few seeds for a confidence interval.
    #[error("measuring the effects: {0} seeds; a confidence interval needs at least 2")]
    Seeds(usize),
}

/// Cost of some effects of a scene, and the change of the results without these effects.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Names of the effects that are left out of the simulation.
    pub effects: Vec<&'static str>,
    /// Cost of the effects that are left out, ns of processor time per sonar return.
    pub price_ns: Mean,
    /// Mean change of the hole diameter D over the sections if the effects are left out, m.
    pub hole_m: Mean,
    /// Change of the passed length if the effects are left out, as a share of the coverage extent.
    pub passed: Mean,
}

/// Cost and influence of a scene's effects.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInfluence {
    /// Number of seeds with which the dives were simulated.
    pub seeds: usize,
    /// Length of the tunnel sections that the vehicle has passed, m.
    pub way_m: f64,
    /// Passed length with all effects, as a share of the coverage extent.
    pub passed: Mean,
    /// Mean of the hole diameter D over the sections with all effects, m.
    pub hole_m: Mean,
    /// Cost of simulating with all effects, ns of processor time per sonar return.
    pub all_ns: Mean,
    /// Results of leaving out each effect alone, the most expensive effect first.
    pub each: Vec<LeftOut>,
    /// The effects that can all be left out together, because the change of the results then stays within the limits.
    pub spared: LeftOut,
}

impl LeftOut {
    /// Whether the changes are negligible: at most [`HOLE_LIMIT_M`] for the hole diameter D, and at most
    /// [`PASSED_LIMIT`] for the passed share.
    ///
    /// The whole confidence intervals must be within the limits.
    pub fn is_free(&self) -> bool {
        self.excess() <= 1.0
    }

    /// Returns the largest change that the two confidence intervals allow, as a multiple of the limit for its quantity.
    fn excess(&self) -> f64 {
        (self.hole_m.farthest() / HOLE_LIMIT_M).max(self.passed.farthest() / PASSED_LIMIT)
    }
}

/// Measures the effects of a scene. `scenes` contains this scene once per seed.
///
/// `note` is called with the number of finished dives and the maximum number of dives.
///
/// Errors: see [`EffectInfluenceError`].
pub fn measure(
    scenes: &mut [Scene],
    note: &mut dyn FnMut(usize, usize),
) -> Result<EffectInfluence, EffectInfluenceError> {
    if scenes.len() < 2 {
        return Err(EffectInfluenceError::Seeds(scenes.len()));
    }
    let effects = scenes.first().map(Scene::simulated).unwrap_or_default();
    // One measurement leaves out all negligible effects together. Each effect that must be restored because it isn't
    // negligible takes one more measurement.
    let most = scenes.len() * (2 * effects.len() + 2);
    let mut paired = Paired { with: Vec::new(), scenes, dived: 0, most, note };
    paired.with = paired.dive(&[])?;
    let mut each = Vec::new();
    for effect in &effects {
        each.push(paired.left_out(&[effect])?);
    }
    let spared = paired.spared(&each)?;
    each.sort_by(|a, b| b.price_ns.mean.total_cmp(&a.price_ns.mean));
    let of = |what: fn(&Figures) -> f64| Mean::of(&paired.with.iter().map(what).collect::<Vec<_>>());
    Ok(EffectInfluence {
        seeds: paired.with.len(),
        way_m: of(|figures| figures.way_m).mean,
        passed: of(|figures| figures.passed_m / figures.way_m),
        hole_m: of(Figures::hole_m),
        all_ns: total_price_ns(first(paired.scenes)?)?,
        each,
        spared,
    })
}

/// Returns the first scene, on which the cost is measured.
fn first(scenes: &mut [Scene]) -> Result<&mut Scene, EffectInfluenceError> {
    scenes.first_mut().ok_or(EffectInfluenceError::Seeds(0))
}

/// Simulates the same dives with and without effects.
struct Paired<'a> {
    scenes: &'a mut [Scene],
    /// Results of the dives that are simulated with all effects, one dive per seed.
    with: Vec<Figures>,
    dived: usize,
    most: usize,
    note: &'a mut dyn FnMut(usize, usize),
}

impl Paired<'_> {
    fn dive(&mut self, without: &[&'static str]) -> Result<Vec<Figures>, EffectInfluenceError> {
        let mut all = Vec::new();
        for scene in self.scenes.iter_mut() {
            scene.leave_out(without);
            let figures = Figures::of(scene);
            scene.leave_out(&[]);
            all.push(figures?);
            self.dived += 1;
            (self.note)(self.dived, self.most);
        }
        Ok(all)
    }

    fn left_out(&mut self, effects: &[&'static str]) -> Result<LeftOut, EffectInfluenceError> {
        let without = self.dive(effects)?;
        let pairs = || self.with.iter().zip(&without);
        let holes: Vec<f64> = pairs().map(|(with, without)| without.hole_more_than_m(with)).collect();
        let passed: Vec<f64> =
            pairs().map(|(with, without)| (without.passed_m - with.passed_m) / with.way_m).collect();
        Ok(LeftOut {
            effects: effects.to_vec(),
            price_ns: added_price_ns(first(self.scenes)?, effects)?,
            hole_m: Mean::of(&holes),
            passed: Mean::of(&passed),
        })
    }

    /// Leaves out all effects that are negligible alone.
    ///
    /// If their joint change exceeds the limits, restores the effect with the largest change, and measures again.
    fn spared(&mut self, each: &[LeftOut]) -> Result<LeftOut, EffectInfluenceError> {
        let mut free: Vec<&LeftOut> = each.iter().filter(|alone| alone.is_free()).collect();
        free.sort_by(|a, b| a.excess().total_cmp(&b.excess()));
        loop {
            let names: Vec<&'static str> = free.iter().flat_map(|alone| alone.effects.clone()).collect();
            let together = self.left_out(&names)?;
            if together.is_free() || names.is_empty() {
                return Ok(together);
            }
            free.pop();
        }
    }
}

/// Coverage results of one dive.
#[derive(Debug, Clone)]
struct Figures {
    /// Diameter D of the hole, m, of each section whose hole is bounded. The key is the start of the section, mm.
    holes_m: BTreeMap<i64, f64>,
    /// Length of the sections that the vehicle has passed, m.
    way_m: f64,
    /// Length of sections with the verdict "pass", m.
    passed_m: f64,
}

impl Figures {
    /// Simulates a scene and runs it through the loop.
    ///
    /// Errors: see [`EffectInfluenceError`].
    fn of(scene: &Scene) -> Result<Self, EffectInfluenceError> {
        let vehicle = &scene.vehicle;
        let mut app = App::new(vehicle.mission());
        for sensor in &vehicle.sensors {
            app.add_device(sensor.as_ref())?;
        }
        let mut dive = app.arm(vehicle.navigation())?;
        let mut feed = SimulationFeed::new(simulation(scene, false)?);
        drive(&mut dive, &mut feed, Pace::default(), &mut |_| {})?;
        dive.finish(&mut |_, _| {});
        let mut figures = Self { holes_m: BTreeMap::new(), way_m: 0.0, passed_m: 0.0 };
        for section in Report::of(&dive).sections {
            let length_m = section.end_m - section.start_m;
            figures.way_m += length_m;
            figures.passed_m += if section.verdict == Verdict::Pass { length_m } else { 0.0 };
            if let Some(hole_m) = section.hole_m.filter(|_| section.hole_bounded) {
                figures.holes_m.insert(math::round_to_i64(section.start_m * 1000.0), hole_m);
            }
        }
        Ok(figures)
    }

    /// Returns the mean of the hole diameter D over all sections whose hole is bounded, m.
    fn hole_m(&self) -> f64 {
        self.holes_m.values().sum::<f64>() / self.holes_m.len() as f64
    }

    /// Returns by how much the hole diameter D exceeds that of `other`, as a mean over the sections that both dives
    /// have, m. The mean is zero if they have no section in common.
    fn hole_more_than_m(&self, other: &Self) -> f64 {
        let both = self.holes_m.iter().filter_map(|(at, hole_m)| Some(hole_m - other.holes_m.get(at)?));
        let differences: Vec<f64> = both.collect();
        if differences.is_empty() { 0.0 } else { differences.iter().sum::<f64>() / differences.len() as f64 }
    }
}

/// Number of rounds. Each round simulates the scene once. If the cost of effects is measured, each round simulates the
/// scene a second time, without the effects.
const ROUNDS: usize = 5;

/// Returns the cost of simulating with all effects, ns of processor time per sonar return.
///
/// Errors: see [`EffectInfluenceError`].
fn total_price_ns(scene: &Scene) -> Result<Mean, EffectInfluenceError> {
    let rounds: Result<Vec<f64>, SimulationError> = (0..ROUNDS).map(|_| ns_a_return(scene)).collect();
    Ok(Mean::of(&rounds?))
}

/// Returns the cost that `effects` add, ns of processor time per sonar return.
///
/// Errors: see [`EffectInfluenceError`].
fn added_price_ns(scene: &mut Scene, effects: &[&str]) -> Result<Mean, EffectInfluenceError> {
    let mut differences = Vec::new();
    for _ in 0..ROUNDS {
        let with = ns_a_return(scene)?;
        scene.leave_out(effects);
        let without = ns_a_return(scene);
        scene.leave_out(&[]);
        differences.push(with - without?);
    }
    Ok(Mean::of(&differences))
}

/// Simulates a scene, and returns the processor time of this thread per sonar return, ns.
fn ns_a_return(scene: &Scene) -> Result<f64, SimulationError> {
    let mut simulation = simulation(scene, false)?;
    let sensors = &scene.facts().sensors;
    let is_head = |source: u16| sensors.get(usize::from(source)).is_some_and(|of| of.sense == Sense::Head);
    let began_ns = thread_ns();
    let mut returns = 0_u64;
    while let Some(message) = simulation.next_message() {
        returns += u64::from(message.direction == Direction::Received && is_head(message.source));
    }
    Ok((thread_ns() - began_ns) / returns.max(1) as f64)
}

/// Returns the processor time used by this thread so far, ns.
fn thread_ns() -> f64 {
    let time = clock_gettime(ClockId::ThreadCPUTime);
    time.tv_sec as f64 * 1e9 + time.tv_nsec as f64
}

/// A mean and the half-width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mean {
    /// The mean of the values.
    pub mean: f64,
    /// Half-width of the confidence interval; infinite for a single value.
    pub half: f64,
}

/// Quantiles (97.5 %) of Student's t, for 1 to 30 degrees of freedom.
const T: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056, 2.052, 2.048, 2.045, 2.042,
];
/// Quantile for more than 30 degrees of freedom, taken from the normal distribution.
const T_OF_MANY: f64 = 1.96;

impl Mean {
    /// Computes the mean of independent values, and its 95 % confidence interval.
    pub fn of(values: &[f64]) -> Self {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let squares = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        let half = match values.len().checked_sub(2) {
            None => f64::INFINITY,
            Some(freedom) => {
                T.get(freedom).copied().unwrap_or(T_OF_MANY) * math::sqrt(squares / (n - 1.0) / n)
            }
        };
        Self { mean, half }
    }

    /// Returns the magnitude of the interval's end that is farther from zero.
    fn farthest(&self) -> f64 {
        self.mean.abs() + self.half
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Student's own example: hours of sleep gained by ten patients with two drugs (Biometrika 6, 1908).
    /// The expected interval was computed with R's t.test.
    #[test]
    fn confidence_interval_matches_student_example() {
        let gains = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4];
        let Mean { mean, half } = Mean::of(&gains);
        assert!((mean - 1.58).abs() < 1e-12, "{mean}");
        assert!(
            (mean - half - 0.700_114_2).abs() < 2e-4 && (mean + half - 2.459_885_8).abs() < 2e-4,
            "{half}"
        );
        assert!(Mean::of(&[3.0]).half.is_infinite() && Mean::of(&[3.0, 3.0]).half == 0.0);
    }
}
