//! Screened Poisson reconstruction on a regular grid.
//!
//! The samples' normals, spread by B-splines and weighted with the wall area that each represents, form a vector field
//! V. The field chi minimises the integral of |grad chi - V|^2 plus `point_weight` times (area / samples) times the sum
//! of chi^2 at the samples. The field jumps from negative to positive at the wall. The surface is the level set at the
//! mean of the field's values at the samples.
//!
//! The implementation differs from the tool used by Jorge et al. 2021 in one respect. Here, cells of the finest size
//! fill a box around the samples; the tool's octree has coarser cells away from samples. A tunnel is so slim that the
//! whole box is small.
//!
//! Source: Kazhdan, Hoppe, "Screened Poisson surface reconstruction", 2013; the paper's §8.2.

use headrace_geometry::math;

use super::grid::Grid;
use super::mesh::Mesh;
use super::solver::{Screened, Solved, divergence};
use super::{Sample, Xyz, extract};

/// Maximum number of B-splines of a grid, which take about 1.5 GB.
const NODES_MAX: usize = 16_000_000;
/// Ratio of the density grid's cells to the finest cells (2 levels, as in Kazhdan's program).
const DENSITY_CELLS: usize = 4;
/// Factor by which spreading and reading with quadratic B-splines reduces a density across a wall.
///
/// The factor is averaged over the position in a cell, which gives the integral of the spline's square.
const ACROSS: f64 = 11.0 / 20.0;
/// Number of grid levels coarser than the finest one. Coarser levels give the initial solution, and receive the normals
/// of sparse samples.
const COARSER_LEVELS: usize = 4;

/// Settings of the reconstruction.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub(crate) struct Settings {
    /// Depth d: a cell is `scale` times the largest extent of the samples, divided by 2^d; 2 to 12.
    pub depth: u32,
    /// Weight of the constraint that the surface passes through the samples; 0 to 1000.
    pub point_weight: f64,
    /// Approximate number of samples per cell on the grid level on which a normal is spread; must be above 0.
    pub samples_per_node: f64,
    /// Ratio of the side of the cube of 2^depth cells to the largest extent of the samples; at least 1.
    pub scale: f64,
    /// Margin between the samples and the edge of the grid, cells; at least 2.
    pub margin_cells: usize,
    /// Relative residual at which the solver stops.
    pub tolerance: f64,
    /// Maximum number of iterations of the solver.
    pub steps_max: usize,
}

impl Settings {
    /// The paper's settings: depth 8, one sample per node, point weight 5 (§8.2), and a cube of 1.1 times the samples'
    /// extent, as in the paper's tool.
    pub(crate) fn of_paper() -> Self {
        Self {
            depth: 8,
            point_weight: 5.0,
            samples_per_node: 1.0,
            scale: 1.1,
            margin_cells: 8,
            tolerance: 1e-5,
            steps_max: 1000,
        }
    }
}

/// A reason why a surface can't be made.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PoissonError {
    /// The samples don't span a volume.
    #[error("a surface needs at least 4 samples with some extent; there are {count}")]
    TooFewSamples {
        /// Number of samples.
        count: usize,
    },
    /// A position or normal isn't finite.
    #[error("sample {index} has a position or normal that isn't a number")]
    NotFinite {
        /// Index of the sample, from zero.
        index: usize,
    },
    /// A setting is out of range.
    #[error("{setting} is {value}; expected {wanted}")]
    Setting {
        /// The setting's name.
        setting: &'static str,
        /// Value of the setting.
        value: f64,
        /// Allowed values.
        wanted: &'static str,
    },
    /// The grid needs too many nodes.
    #[error(
        "the grid would have {nodes:.0} nodes; at most {NODES_MAX} are allowed; a smaller depth needs fewer"
    )]
    TooLarge {
        /// Number of nodes that the grid needs.
        nodes: f64,
    },
    /// The solver hasn't converged within its step limit.
    #[error("after {steps} steps the residual is still {residual:e} of the right-hand side")]
    NotSolved {
        /// Steps taken on the finest grid.
        steps: usize,
        /// Relative residual that was reached.
        residual: f64,
    },
}

/// A field, and the field's level on the reconstructed surface.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    grid: Grid,
    field: Vec<f64>,
    level: f64,
}

/// Samples, with the wall area that each sample represents.
struct Cloud<'a> {
    samples: &'a [Sample],
    /// Wall area of each sample, m^2.
    areas_m2: Vec<f64>,
    /// For each normal, the number of levels from the finest level down to the coarser level on which the normal is
    /// spread.
    coarser: Vec<usize>,
    area_m2: f64,
}

impl Surface {
    /// Reconstructs the surface through wall samples with unit normals towards the water.
    ///
    /// Errors: see [`PoissonError`].
    pub(crate) fn through(samples: &[Sample], settings: &Settings) -> Result<Self, PoissonError> {
        check(samples, settings)?;
        let grid = grid_round(samples, settings)?;
        let cloud = Cloud::measure(samples, &grid, settings.samples_per_node);
        let (field, Solved { steps, residual }) = solve(&grid, &cloud, settings, COARSER_LEVELS);
        // The solver reaches the tolerance, apart from rounding errors.
        if residual > settings.tolerance * (1.0 + 1e-9) {
            return Err(PoissonError::NotSolved { steps, residual });
        }
        let weighted = cloud.samples.iter().zip(&cloud.areas_m2);
        let sum: f64 = weighted.map(|(sample, area)| area * grid.value(&field, sample.place)).sum();
        Ok(Self { grid, field, level: sum / cloud.area_m2 })
    }

    /// Value of the field: positive in the water, negative behind the wall. The field rises by about one across the
    /// wall.
    pub(crate) fn value(&self, place: Xyz) -> f64 {
        self.grid.value(&self.field, place) - self.level
    }

    /// Side of a cell, m.
    pub(crate) fn cell_m(&self) -> f64 {
        self.grid.cell_m
    }

    /// The surface as triangles on the grid's cells.
    pub(crate) fn mesh(&self) -> Mesh {
        extract::mesh(&self.grid, |place| self.value(place))
    }
}

fn check(samples: &[Sample], settings: &Settings) -> Result<(), PoissonError> {
    let finite = |s: &Sample| s.place.iter().chain(&s.normal).all(|c| c.is_finite());
    if let Some(index) = samples.iter().position(|s| !finite(s)) {
        return Err(PoissonError::NotFinite { index });
    }
    let Settings { depth, point_weight, samples_per_node, scale, margin_cells, .. } = *settings;
    let settings = [
        ("depth", f64::from(depth), (2..=12).contains(&depth), "2 to 12"),
        ("point_weight", point_weight, (0.0..=1000.0).contains(&point_weight), "0 to 1000"),
        ("samples_per_node", samples_per_node, samples_per_node > 0.0, "above 0"),
        ("scale", scale, (1.0..=10.0).contains(&scale), "1 to 10"),
        ("margin_cells", margin_cells as f64, (2..=1000).contains(&margin_cells), "2 to 1000"),
    ];
    match settings.into_iter().find(|(_, _, good, _)| !good) {
        Some((setting, value, _, wanted)) => Err(PoissonError::Setting { setting, value, wanted }),
        None => Ok(()),
    }
}

fn grid_round(samples: &[Sample], settings: &Settings) -> Result<Grid, PoissonError> {
    let (mut least, mut most) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for sample in samples {
        for axis in 0..3 {
            least[axis] = least[axis].min(sample.place[axis]);
            most[axis] = most[axis].max(sample.place[axis]);
        }
    }
    let extents = [0, 1, 2].map(|axis| most[axis] - least[axis]);
    let largest = extents.into_iter().fold(0.0, f64::max);
    if samples.len() < 4 || largest <= 0.0 {
        return Err(PoissonError::TooFewSamples { count: samples.len() });
    }
    let cell_m = settings.scale * largest / f64::from(1_u32 << settings.depth);
    let margin = settings.margin_cells as f64;
    // The box consists of whole cells, with the samples in its middle.
    let cells = extents.map(|extent| (extent / cell_m).ceil() + 2.0 * margin);
    let nodes: f64 = cells.iter().map(|n| n + 2.0).product();
    if nodes > NODES_MAX as f64 {
        return Err(PoissonError::TooLarge { nodes });
    }
    let origin = [0, 1, 2].map(|axis| (least[axis] + most[axis] - cells[axis] * cell_m) / 2.0);
    Ok(Grid { origin, cell_m, cells: cells.map(|n| crate::index(math::round_to_i64(n))) })
}

impl<'a> Cloud<'a> {
    /// Assigns an area to each sample: one of k samples in a patch represents a k-th of the patch. Patches are the
    /// cells of a coarser grid.
    fn measure(samples: &'a [Sample], grid: &Grid, samples_per_node: f64) -> Self {
        let patches = Grid {
            origin: grid.origin,
            cell_m: grid.cell_m * DENSITY_CELLS as f64,
            cells: grid.cells.map(|n| n.div_ceil(DENSITY_CELLS)),
        };
        let mut counts = vec![0.0; patches.len()];
        for sample in samples {
            patches.scatter(&patches.local(sample.place), 1.0, &mut counts);
        }
        let patch_m2 = patches.cell_m * patches.cell_m;
        let per_m2 = |s: &Sample| patches.value(&counts, s.place) / ACROSS / patch_m2;
        let densities: Vec<f64> = samples.iter().map(per_m2).collect();
        let cell_m2 = grid.cell_m * grid.cell_m;
        let coarser = densities.iter().map(|d| levels_up(d * cell_m2, samples_per_node)).collect();
        let areas_m2: Vec<f64> = densities.iter().map(|d| 1.0 / d).collect();
        let area_m2 = areas_m2.iter().sum();
        Self { samples, areas_m2, coarser, area_m2 }
    }

    /// Coefficients of the normals' vector field V on a grid that is `level` levels coarser than the finest grid.
    /// Samples spread on coarser levels are included.
    ///
    /// `finest` is the level being solved. Samples are not spread on levels finer than this.
    fn normals(&self, grid: &Grid, level: usize, finest: usize) -> [Vec<f64>; 3] {
        let mut field = if level < COARSER_LEVELS && self.coarser.iter().any(|c| *c > level) {
            let coarse = grid.coarser();
            // In cells half as large, the slope per cell is half as large.
            self.normals(&coarse, level + 1, finest).map(|values| {
                let halved: Vec<f64> = values.iter().map(|v| v / 2.0).collect();
                grid.refined(&coarse, &halved)
            })
        } else {
            [0, 1, 2].map(|_| vec![0.0; grid.len()])
        };
        let cell_m2 = grid.cell_m * grid.cell_m;
        for ((sample, area_m2), coarser) in self.samples.iter().zip(&self.areas_m2).zip(&self.coarser) {
            if (*coarser).max(finest) == level {
                let local = grid.local(sample.place);
                for (component, values) in field.iter_mut().enumerate() {
                    grid.scatter(&local, sample.normal[component] * area_m2 / cell_m2, values);
                }
            }
        }
        field
    }
}

/// Number of levels by which a grid with `per_cell` samples per cell must be coarsened until a cell has at least
/// `wanted` samples.
fn levels_up(per_cell: f64, wanted: f64) -> usize {
    (0..COARSER_LEVELS).take_while(|level| per_cell * f64::from(1_u32 << (2 * level)) < wanted).count()
}

/// Solves for the coefficients of the field; also returns the solver's outcome. The solution on a coarser grid is the
/// initial value.
fn solve(grid: &Grid, cloud: &Cloud<'_>, settings: &Settings, coarser: usize) -> (Vec<f64>, Solved) {
    let level = COARSER_LEVELS - coarser;
    let mut field = if coarser > 0 && grid.cells.iter().all(|n| *n >= 8) {
        let coarse = grid.coarser();
        grid.refined(&coarse, &solve(&coarse, cloud, settings, coarser - 1).0)
    } else {
        vec![0.0; grid.len()]
    };
    let rhs = divergence(grid, &cloud.normals(grid, level, level));
    let places = cloud.samples.iter().map(|sample| grid.local(sample.place)).collect();
    let area_cells = cloud.area_m2 / (grid.cell_m * grid.cell_m);
    let weight = settings.point_weight * area_cells / cloud.samples.len() as f64;
    let system = Screened::new(grid, places, weight);
    let solved = system.solve(&rhs, &mut field, settings.tolerance, settings.steps_max);
    (field, solved)
}

#[cfg(test)]
mod tests;
