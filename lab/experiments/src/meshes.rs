//! Surfaces through the samples, and their distance from the wall (Jorge et al. 2021, §8.2 and §8.3).

use headrace_sampling::layout::HeadLayout;
use serde::Serialize;

use crate::Spread;
use crate::runs::{Dive, Setting};
use crate::surface::chart::{Chart, Deviation};
use crate::surface::poisson::{Settings, Surface};
use crate::surface::wall::{self, Stretch};
use crate::surface::{Mesh, MeshIndex, Xyz, normals};
use crate::{ExperimentError, Progress};

/// Length of each simulated run, m, as in the paper.
pub(crate) const LENGTH_M: f64 = 130.0;
/// Chainages between which the surface is compared with the wall. They are away from the ends of the run.
const INNER: Stretch = Stretch { from_m: 20.0, to_m: 120.0, step_m: 0.1 };
/// Scene line for the range noise of the paper's simulator.
const EFFECTS: &str = "range_noise = { sd_m = 0.01, sensors = [SONARS] }\n";
/// Number of repetitions of an unaligned dive, each with different phases.
const SEEDS: u64 = 5;

/// A configuration of heads from the paper's §8.2 or §8.3.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MeshRow {
    /// Number of heads.
    pub heads: u8,
    /// Mode of the heads.
    pub mode: &'static str,
    /// Whether the heads are in sector offset instead of phase shift.
    pub sectors: bool,
    /// Whether the heads' phases are aligned.
    pub aligned: bool,
    /// Mean and standard deviation of the distance in the paper, m; `None` if the paper doesn't state them.
    pub paper_m: Option<[f64; 2]>,
    /// Distance from the wall to the screened Poisson surface of depth 8: mean and standard deviation, averaged over
    /// the seeds, m.
    pub poisson_m: [f64; 2],
    /// Distance from the wall to the linear interpolation in (x, arc length): mean and standard deviation, m.
    pub plain_m: [f64; 2],
    /// Mean distance from the Poisson surface for each seed, m.
    pub seeds_m: Vec<f64>,
}

/// Number of heads, their mode, whether they are in sector offset, whether their phases are aligned, and the paper's
/// mean and standard deviation.
type Configuration = (u8, &'static str, bool, bool, Option<[f64; 2]>);

/// The configurations of Jorge et al. 2021, with the distances that the paper states.
///
/// Source: errata, row "§8.2": the paper's text names one of the unaligned pairs twice.
const PAPER: [Configuration; 10] = [
    (2, "slow", false, true, Some([0.040, 0.060])),
    (2, "slow", false, false, Some([0.059, 0.083])),
    (2, "slow", true, true, Some([0.057, 0.077])),
    (2, "slow", true, false, Some([0.050, 0.083])),
    (3, "medium", false, true, Some([0.018, 0.031])),
    (3, "medium", false, false, None),
    (3, "medium", true, true, Some([0.037, 0.106])),
    (4, "medium", false, true, Some([0.016, 0.025])),
    (4, "medium", false, false, None),
    (4, "medium", true, true, Some([0.020, 0.036])),
];

/// Computes the distances of all configurations.
///
/// Errors: no surface can be made; none with the built-in vehicles.
pub(crate) fn rows(progress: Progress<'_>) -> Result<Vec<MeshRow>, ExperimentError> {
    let mut rows = Vec::new();
    for (heads, mode, sectors, aligned, paper_m) in PAPER {
        let mut found = Vec::new();
        for seed in 1..=if aligned { 1 } else { SEEDS } {
            progress(&format!("a surface through {heads} heads' samples, seed {seed}"));
            let setting = setting((heads, mode, sectors, aligned), LENGTH_M, seed);
            found.push(distances(&setting.dive()?)?);
        }
        let mean = |which: usize| {
            let of = |spread: fn(&Spread) -> f64| {
                found.iter().filter_map(|pair| pair.get(which)).map(spread).sum::<f64>() / found.len() as f64
            };
            [of(|s| s.mean_m), of(|s| s.sd_m)]
        };
        let seeds_m = found.iter().map(|[poisson, _]| poisson.mean_m).collect();
        rows.push(MeshRow {
            heads,
            mode,
            sectors,
            aligned,
            paper_m,
            poisson_m: mean(0),
            plain_m: mean(1),
            seeds_m,
        });
    }
    Ok(rows)
}

/// Settings of the dive of a configuration.
///
/// Unaligned heads begin at a random angle of their turn or sweep.
pub(crate) fn setting(
    (heads, mode, sectors, aligned): (u8, &'static str, bool, bool),
    length_m: f64,
    seed: u64,
) -> Setting {
    let layout = if sectors { HeadLayout::SectorOffset } else { HeadLayout::PhaseShift };
    let unaligned = if aligned { "" } else { "start_phase_error = { max_deg = 180 }\n" };
    let effects = format!("{EFFECTS}{unaligned}");
    Setting { heads, mode, layout, aligned, occlusion: heads > 2, length_m, effects, seed }
}

/// Positions of the wall as measured in the dive.
pub(crate) fn cloud(dive: &Dive) -> Vec<Xyz> {
    let samples = dive.heads.iter().flatten().filter(|sample| sample.of_wall);
    samples.map(|sample| [sample.at.x(), sample.at.y(), sample.at.z()]).collect()
}

/// The surface made as in the paper, and a bin size for an index of its triangles, m.
pub(crate) fn poisson(dive: &Dive, cloud: &[Xyz]) -> Result<(Mesh, f64), ExperimentError> {
    let surface = Surface::through(&normals::towards_axis(&dive.profile, cloud), &Settings::of_paper())?;
    Ok((surface.mesh(), surface.cell_m() / 2.0))
}

/// Distances from the wall to the Poisson surface, and to the linear interpolation.
fn distances(dive: &Dive) -> Result<[Spread; 2], ExperimentError> {
    let cloud = cloud(dive);
    let (mesh, bin_m) = poisson(dive, &cloud)?;
    let index = MeshIndex::new(&mesh, bin_m).ok_or(ExperimentError::NoSurface)?;
    let poisson = wall::from_wall(&dive.profile, &index, &INNER, |_, _| 0.0);
    let deviations: Vec<Deviation> = cloud.iter().map(|place| Deviation::of(&dive.profile, *place)).collect();
    let plain = Chart::new(dive.profile.perimeter_m(), &deviations)?.compare(&INNER, |_, _| 0.0).spread;
    Ok([poisson, plain])
}
