//! Measures two quantities for each effect of a scene: its computing cost, and its influence on the loop's results.
//!
//! The same dives are simulated with and without the effect, seed by seed. Each effect draws its own random numbers, so
//! the two dives of a seed differ only by the effect. The mean difference over the seeds has a 95 % confidence interval
//! by Student's t.
//!
//! D is the diameter of a section's hole: the largest circle on its wall without samples.

mod error;
mod figures;
mod mean;
mod price;

use headrace_simulator::Scene;

pub use error::EffectInfluenceError;
use figures::Figures;
pub use mean::Mean;

/// Maximum change of D, m, that counts as negligible. The whole confidence interval of the change must be within this
/// limit.
pub const HOLE_LIMIT_M: f64 = 0.01;
/// Maximum change of the passed length that counts as negligible, as a share of the coverage extent.
pub const PASSED_LIMIT: f64 = 0.01;

/// Cost of some effects of a scene, and change of the results if these effects are left out.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Names of the effects left out.
    pub effects: Vec<&'static str>,
    /// Cost of these effects, ns of processor time per sonar return.
    pub price_ns: Mean,
    /// Mean change of D over the sections if the effects are left out, m.
    pub hole_m: Mean,
    /// Change of the passed length if the effects are left out, as a share of the coverage extent.
    pub passed: Mean,
}

/// Cost and influence of a scene's effects.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectInfluence {
    /// Number of seeds.
    pub seeds: usize,
    /// Length of tunnel that was judged, m.
    pub way_m: f64,
    /// Passed length with all effects, as a share of the coverage extent.
    pub passed: Mean,
    /// Mean of D over the sections with all effects, m.
    pub hole_m: Mean,
    /// Cost of simulating with all effects, ns of processor time per sonar return.
    pub all_ns: Mean,
    /// Each effect left out alone, the most expensive effect first.
    pub each: Vec<LeftOut>,
    /// The effects that can all be left out together, because the change stays within the limits.
    pub spared: LeftOut,
}

impl LeftOut {
    /// Whether leaving out these effects changes nothing by more than [`HOLE_LIMIT_M`] and [`PASSED_LIMIT`].
    ///
    /// The whole confidence intervals must be within the limits.
    pub fn is_free(&self) -> bool {
        self.excess() <= 1.0
    }

    /// Returns the largest change within the confidence intervals, in units of the limits.
    fn excess(&self) -> f64 {
        (self.hole_m.farthest() / HOLE_LIMIT_M).max(self.passed.farthest() / PASSED_LIMIT)
    }
}

/// Measures the effects of a scene, which must be given once per seed.
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
    // Leaving out all negligible effects together takes one measurement. Each effect that must be restored takes one
    // more.
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
        all_ns: price::all_ns(first(paired.scenes)?)?,
        each,
        spared,
    })
}

/// Returns the scene on which the cost is measured.
fn first(scenes: &mut [Scene]) -> Result<&mut Scene, EffectInfluenceError> {
    scenes.first_mut().ok_or(EffectInfluenceError::Seeds(0))
}

/// Simulates the same dives with and without effects.
struct Paired<'a> {
    scenes: &'a mut [Scene],
    /// Results with all effects, seed by seed.
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
            price_ns: price::of_ns(first(self.scenes)?, effects)?,
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
