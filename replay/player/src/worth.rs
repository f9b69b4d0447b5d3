//! Measures for each effect of a scene its computing cost, and the change in the loop's results if it is left out.
//!
//! The same dives are simulated with and without an effect, seed by seed. Each effect draws from its own random
//! numbers, so the two dives of a seed differ only by the effect. The mean difference over seeds has a 95 % confidence
//! interval by Student's t.

mod error;
mod figures;
mod mean;
mod price;

use headrace_simulator::Scene;

pub use error::WorthError;
use figures::Figures;
pub use mean::Mean;

/// Largest change of D, m, that counts as negligible; the whole confidence interval must be within it.
pub const HOLE_LIMIT_M: f64 = 0.01;
/// Largest change of the passed length that counts as negligible, as a share of the coverage extent.
pub const PASSED_LIMIT: f64 = 0.01;

/// Result of leaving effects out of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// The effects left out.
    pub effects: Vec<&'static str>,
    /// Their cost, ns of processor time per sonar return.
    pub price_ns: Mean,
    /// D without them minus D with them, mean over the sections, m.
    pub hole_m: Mean,
    /// Metres passed without them minus metres passed with them, as a share of the coverage extent.
    pub passed: Mean,
}

/// Cost and influence of a scene's effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Worth {
    /// Number of seeds.
    pub seeds: usize,
    /// Length of the tunnel that was judged, m.
    pub way_m: f64,
    /// Metres passed with all effects, as a share of the coverage extent.
    pub passed: Mean,
    /// D with all effects, mean over the sections, m.
    pub hole_m: Mean,
    /// Cost of the simulation with all effects, ns per sonar return.
    pub all_ns: Mean,
    /// Each effect left out alone, the most expensive first.
    pub each: Vec<LeftOut>,
    /// All effects that can be left out together without a change beyond the limits.
    pub spared: LeftOut,
}

impl LeftOut {
    /// Whether leaving them out certainly changes nothing by more than [`HOLE_LIMIT_M`] and [`PASSED_LIMIT`].
    pub fn is_free(&self) -> bool {
        self.excess() <= 1.0
    }

    /// Largest change within the confidence intervals, in units of the limits.
    fn excess(&self) -> f64 {
        (self.hole_m.farthest() / HOLE_LIMIT_M).max(self.passed.farthest() / PASSED_LIMIT)
    }
}

/// Measures the effects of a scene, which has been read once per seed.
///
/// `note` is called with the number of finished dives and the maximum number of dives.
///
/// Errors: see [`WorthError`].
pub fn measure(scenes: &mut [Scene], note: &mut dyn FnMut(usize, usize)) -> Result<Worth, WorthError> {
    if scenes.len() < 2 {
        return Err(WorthError::Seeds(scenes.len()));
    }
    let effects = scenes.first().map(Scene::simulated).unwrap_or_default();
    // Leaving out all negligible effects takes one measurement, and one more for each that must be restored.
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
    Ok(Worth {
        seeds: paired.with.len(),
        way_m: of(|figures| figures.way_m).mean,
        passed: of(|figures| figures.passed_m / figures.way_m),
        hole_m: of(Figures::hole_m),
        all_ns: price::all_ns(first(paired.scenes)?)?,
        each,
        spared,
    })
}

/// The scene used to measure the cost.
fn first(scenes: &mut [Scene]) -> Result<&mut Scene, WorthError> {
    scenes.first_mut().ok_or(WorthError::Seeds(0))
}

/// The same dives with and without effects.
struct Paired<'a> {
    scenes: &'a mut [Scene],
    /// Results with all effects, seed by seed.
    with: Vec<Figures>,
    dived: usize,
    most: usize,
    note: &'a mut dyn FnMut(usize, usize),
}

impl Paired<'_> {
    fn dive(&mut self, without: &[&'static str]) -> Result<Vec<Figures>, WorthError> {
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

    fn left_out(&mut self, effects: &[&'static str]) -> Result<LeftOut, WorthError> {
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

    /// Leaves out all effects that are negligible alone. If their joint change exceeds the limits, restores the one
    /// with the largest change and repeats.
    fn spared(&mut self, each: &[LeftOut]) -> Result<LeftOut, WorthError> {
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
