//! What each effect of a scene is worth: what it costs, and what leaving it out changes in the loop's results.
//!
//! The same dives are dived with and without an effect, seed by seed. Effects draw each from its own random numbers, so that the
//! two dives of a seed differ by what the effect does and by nothing else; the mean difference over seeds has a confidence
//! interval of 95 %, by Student's t.

mod error;
mod figures;
mod mean;
mod price;

use headrace_simulator::Scene;

pub use error::WorthError;
use figures::Figures;
pub use mean::Mean;

/// An effect matters unless the whole interval of what leaving it out changes in D is within this, m.
pub const HOLE_LIMIT_M: f64 = 0.01;
/// The same for the metres passed, as a share of the way.
pub const PASSED_LIMIT: f64 = 0.01;

/// What leaving effects out does to a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// The effects left out.
    pub effects: Vec<&'static str>,
    /// What they cost, ns of the processor for each return of a head.
    pub price_ns: Mean,
    /// D without them less D with them, mean of the sections, m.
    pub hole_m: Mean,
    /// Metres passed without them less those with them, as a share of the way.
    pub passed: Mean,
}

/// Worth of a scene's effects.
#[derive(Debug, Clone, PartialEq)]
pub struct Worth {
    /// Seeds that were dived.
    pub seeds: usize,
    /// Length of the way that was judged, m, and what was passed of it with all effects, a share.
    pub way_m: f64,
    /// Metres passed with all effects, as a share of the way.
    pub passed: Mean,
    /// D with all effects, mean of the sections, m.
    pub hole_m: Mean,
    /// What simulating costs with all effects, ns for each return of a head.
    pub all_ns: Mean,
    /// Each effect left out alone, the dearest first.
    pub each: Vec<LeftOut>,
    /// All effects left out together that can be without anything changing by more than the limits.
    pub spared: LeftOut,
}

impl LeftOut {
    /// Whether leaving them out is sure to change nothing by more than [`HOLE_LIMIT_M`] and [`PASSED_LIMIT`].
    pub fn is_free(&self) -> bool {
        self.excess() <= 1.0
    }

    /// The largest change that the intervals allow, in limits.
    fn excess(&self) -> f64 {
        (self.hole_m.farthest() / HOLE_LIMIT_M).max(self.passed.farthest() / PASSED_LIMIT)
    }
}

/// Measures the worth of a scene's effects, the same scene having been read with several seeds. `note` hears how many dives of how
/// many, at most, have been dived.
///
/// Errors: see [`WorthError`].
pub fn measure(scenes: &mut [Scene], note: &mut dyn FnMut(usize, usize)) -> Result<Worth, WorthError> {
    if scenes.len() < 2 {
        return Err(WorthError::Seeds(scenes.len()));
    }
    let effects = scenes.first().map(Scene::simulated).unwrap_or_default();
    // Sparing all that are free together takes one measurement, and one more for each that has to be put back.
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

/// The scene whose price is measured.
fn first(scenes: &mut [Scene]) -> Result<&mut Scene, WorthError> {
    scenes.first_mut().ok_or(WorthError::Seeds(0))
}

/// The same dives with and without effects.
struct Paired<'a> {
    scenes: &'a mut [Scene],
    /// Figures with all effects, seed by seed.
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

    /// All together that are free alone, less, one after the other, those that matter most where together they aren't free.
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
