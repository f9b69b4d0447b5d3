//! The paper's Tables 1 to 5 recomputed: each printed number beside the recomputed one, with notes on the paper's
//! errors.
//!
//! Source: Jorge et al., "Analytical Approach to Sampling Estimation of Underwater Tunnels Using Mechanical Profiling
//! Sonars", Sensors 2021, 21, 1900 (CC BY 4.0). Its numbers are in the `*.csv` files here, as printed.

mod baseline;
mod baseline_tables;
mod cell;
mod combined;
mod drift;
mod findings;
mod measured;
mod modes;
mod printed;

use headrace_geometry::tunnel::{ProfileError, shapes};
use headrace_sampling::SamplingError;
use serde::Serialize;

pub use baseline_tables::{AtBothSpeeds, OneHeadRow, SeveralHeadsRow};
pub use cell::{Cell, Note, NoteKind, Table};
pub use combined::{Combined, CombinedCell, CombinedRow};
pub use measured::{Measured, Spacings, measured};
pub use modes::{ModeRow, OverlapRow};
pub use printed::{Digits, Interval, Printed};

/// Citation of the paper.
pub const SOURCE: &str = "Jorge et al., Sensors 2021, 21, 1900 (CC BY 4.0)";
/// The speed of the paper's experiments, m/s (§7.2).
pub const STATED_SPEED_MPS: f64 = 0.197;
/// The speed for which Table 4's baseline was computed, m/s.
///
/// This is the only multiple of 0.1 mm/s that gives the table's printed digits.
pub const FITTING_SPEED_MPS: f64 = 0.196;

/// The paper's Tables 1 to 5, recomputed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tables {
    /// Source of the printed numbers.
    pub source: &'static str,
    /// The speed that the paper states, m/s.
    pub stated_speed_mps: f64,
    /// The speed for which Table 4's baseline was computed, m/s.
    pub fitting_speed_mps: f64,
    /// Speeds that give all distances T_x printed in Table 4's baseline, m/s.
    pub consistent_speed_mps: Interval,
    /// The perimeter used for the recomputed means, m.
    pub perimeter_m: f64,
    /// Perimeters that, with rounding, give the printed means of all rows of Tables 3 and 4 that aren't copies, m.
    pub consistent_perimeter_m: Interval,
    /// Table 1: overlap of beams.
    pub table_1: Table<OverlapRow>,
    /// Table 2: modes.
    pub table_2: Table<ModeRow>,
    /// Table 3: one head.
    pub table_3: Table<OneHeadRow>,
    /// Table 4: several heads.
    pub table_4: Table<SeveralHeadsRow>,
    /// Table 5: the combined distance T.
    pub table_5: Table<CombinedRow>,
}

/// A reason why the tables can't be computed: an error in the built-in numbers.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PaperError {
    /// A column is missing or not a number.
    #[error("table {table}, line {line}: {column} is missing or isn't a number with at most 6 decimals")]
    Printed {
        /// Number of the table.
        table: u8,
        /// Line of the table's file, from 1.
        line: usize,
        /// Name of the column.
        column: &'static str,
    },
    /// A mode that isn't in Table 2.
    #[error("mode {name} isn't in table 2")]
    Mode {
        /// Name of the mode.
        name: &'static str,
    },
    /// A number outside the sampling formulas' domain.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// An invalid tunnel profile.
    #[error(transparent)]
    Profile(#[from] ProfileError),
}

/// Recomputes all five tables.
///
/// Errors: none with the built-in numbers.
pub fn tables() -> Result<Tables, PaperError> {
    let baselines = baseline::Baselines::new()?;
    let [_, consistent_speed_mps] = findings::speeds_mps(&baselines)?;
    let [consistent_perimeter_m, _] = findings::perimeters_m(&baselines)?;
    Ok(Tables {
        source: SOURCE,
        stated_speed_mps: STATED_SPEED_MPS,
        fitting_speed_mps: FITTING_SPEED_MPS,
        consistent_speed_mps,
        perimeter_m: shapes::ceran_blueprint()?.perimeter_m(),
        consistent_perimeter_m,
        table_1: modes::overlaps()?,
        table_2: modes::speeds()?,
        table_3: baseline_tables::one_head(&baselines)?,
        table_4: baseline_tables::several_heads(&baselines)?,
        table_5: combined::combined(&baselines)?,
    })
}

#[cfg(test)]
mod tests;
