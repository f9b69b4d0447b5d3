//! Recomputes the tables of Jorge et al. 2021 (`paper`), and repeats the experiments of its §8 and §9.
//!
//! Experiments are simulated dives. They give the spacings of Tables 3 to 5 and the occlusion between heads. Further
//! analyses are surfaces through samples and their distance from the wall (§8.2, 8.3), the perimeter as seen by a wide
//! beam (§9.2), and the Wilcoxon signed-rank test (§8.1).
//!
//! Results are deterministic. The code uses one thread, no clock, no randomness and no hash containers, and takes its
//! mathematics from `headrace_geometry::math`.

mod compared;
pub mod drawings;
mod figures;
mod hidden;
mod meshes;
pub mod paper;
mod perimeter;
mod report;
mod runs;
mod spacing;
mod spread;
mod stationary;
mod surface;
mod wilcoxon;
pub mod words;

use headrace_geometry::tunnel::ProfileError;
use headrace_sampling::SamplingError;
use headrace_simulator::SceneError;

use paper::PaperError;
use spread::Spread;

pub use compared::{Pair, RunRow, SignedRankRow};
pub use hidden::HiddenRow;
pub use meshes::MeshRow;
pub use report::{Experiments, Finding, run};
pub use stationary::Perimeter;

/// Function that receives status messages.
pub type Progress<'a> = &'a dyn Fn(&str);

/// A reason why an experiment can't be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// A scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A table of the paper has invalid numbers.
    #[error(transparent)]
    Paper(#[from] PaperError),
    /// A tunnel profile is invalid.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// No Poisson surface can be made through the samples.
    #[error("a surface through the samples: {0}")]
    Surface(#[from] surface::poisson::PoissonError),
    /// The samples have no Delaunay triangulation.
    #[error("interpolating between the samples: {0}")]
    Chart(#[from] surface::chart::ChartError),
    /// An argument of a formula is invalid.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The Poisson surface has no triangle.
    #[error("the surface through the samples has no triangle")]
    NoSurface,
    /// The samples of a stationary turn don't form a closed contour.
    #[error("the perimeter from echoes: {0}")]
    Perimeter(#[from] perimeter::PerimeterError),
}

/// Converts a whole number to an index. Negative numbers become zero.
fn index(k: i64) -> usize {
    usize::try_from(k).unwrap_or(0)
}
