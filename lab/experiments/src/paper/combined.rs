//! Table 5 of Jorge et al. 2021: the distance T, combined from the distances along and across the tunnel.

use headrace_sampling::layout::HeadLayout;
use headrace_sampling::spacing::t_max_m;
use serde::Serialize;

use super::baseline::{Baselines, t_x_m};
use super::cell::{Cell, Note, NoteKind, Table};
use super::printed::{Line, lines};
use super::{PaperError, STATED_SPEED_MPS};

/// A row of Table 5.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CombinedRow {
    /// The mode's name.
    pub mode: &'static str,
    /// Number of heads s.
    pub heads: u8,
    /// Combined distance T in phase shift.
    pub phase_shift: Combined,
    /// Combined distance T in sector offset.
    pub sector_offset: Combined,
}

/// Combined distance T of heads in one layout: phase shift or sector offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Combined {
    /// Combined distance T for the mean ping distance T_y.
    pub t_mean_m: CombinedCell,
    /// Combined distance T for the least ping distance, T_ymin.
    pub t_min_m: CombinedCell,
    /// Combined distance T for the largest ping distance, T_ymax.
    pub t_max_m: CombinedCell,
}

/// A printed combined distance T beside two recomputed values. Like the paper, the recomputed values ignore the
/// vehicle's advance between two pings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CombinedCell {
    /// Recomputed from the distances T_x and T_y that Table 4 prints as experimental.
    pub from_experiment: Cell,
    /// Recomputed from the baseline at [`STATED_SPEED_MPS`].
    pub predicted: Cell,
}

impl Combined {
    /// The cells for the mean, least and largest ping distance T_y.
    pub fn cells(&self) -> [CombinedCell; 3] {
        [self.t_mean_m, self.t_min_m, self.t_max_m]
    }
}

/// Names of the columns of a layout in Tables 4 and 5.
struct Columns {
    layout: HeadLayout,
    t_x: &'static str,
    /// Columns of the ping distance T_y in Table 4 and of the combined distance T in Table 5: mean, least, largest.
    t_y_and_t: [[&'static str; 2]; 3],
}

const PHASE_SHIFT: Columns = Columns {
    layout: HeadLayout::PhaseShift,
    t_x: "phase_tx",
    t_y_and_t: [
        ["phase_ty_mean", "phase_t_mean"],
        ["phase_ty_min", "phase_t_min"],
        ["phase_ty_max", "phase_t_max"],
    ],
};

const SECTOR_OFFSET: Columns = Columns {
    layout: HeadLayout::SectorOffset,
    t_x: "sector_tx",
    t_y_and_t: [
        ["sector_ty_mean", "sector_t_mean"],
        ["sector_ty_min", "sector_t_min"],
        ["sector_ty_max", "sector_t_max"],
    ],
};

/// Recomputes Table 5. Its rows are in the same order as the rows of Table 4.
pub(super) fn combined(baselines: &Baselines) -> Result<Table<CombinedRow>, PaperError> {
    let row = |(line, experiment): (Line, Line)| {
        Ok(CombinedRow {
            mode: line.text("mode")?,
            heads: line.heads()?,
            phase_shift: layout(baselines, &line, &experiment, &PHASE_SHIFT)?,
            sector_offset: layout(baselines, &line, &experiment, &SECTOR_OFFSET)?,
        })
    };
    let rows = lines(5).into_iter().zip(lines(4)).map(row).collect::<Result<Vec<_>, PaperError>>()?;
    let notes = notes(&rows);
    let title = "T = sqrt(T_x^2 + T_y^2) of Table 4's experiments, and as predicted at 0.197 m/s, metres";
    Ok(Table { number: 5, title, rows, notes })
}

fn layout(
    baselines: &Baselines,
    line: &Line,
    experiment: &Line,
    columns: &Columns,
) -> Result<Combined, PaperError> {
    let (mode, across) = baselines.of(line)?;
    let predicted_t_x_m = t_x_m(mode.turn, columns.layout, line.heads()?, STATED_SPEED_MPS)?;
    let measured_t_x_m = experiment.printed(columns.t_x)?.value();
    let cell = |[t_y, t]: [&'static str; 2], predicted_t_y_m: f64| {
        let printed = line.printed(t)?;
        let measured_m = t_max_m(measured_t_x_m, 0.0, experiment.printed(t_y)?.value());
        Ok::<_, PaperError>(CombinedCell {
            from_experiment: Cell::new(printed, measured_m).noted_unless_rounded('a'),
            predicted: Cell::new(printed, t_max_m(predicted_t_x_m, 0.0, predicted_t_y_m)),
        })
    };
    let [mean, min, max] = columns.t_y_and_t;
    Ok(Combined {
        t_mean_m: cell(mean, across.mean_m)?,
        t_min_m: cell(min, across.min_m)?,
        t_max_m: cell(max, across.max_m)?,
    })
}

fn notes(rows: &[CombinedRow]) -> Vec<Note> {
    let cells = rows.iter().flat_map(|row| [row.phase_shift, row.sector_offset]);
    let cells: Vec<Cell> = cells.flat_map(|layout| layout.cells()).map(|cell| cell.from_experiment).collect();
    let same = cells.iter().filter(|cell| cell.digits.rounded()).count();
    let follow = format!(
        "{same} of {} cells are the printed T_x and T_y of Table 4 put together and rounded, without the way gone \
         between two pings.",
        cells.len()
    );
    let least = "SLOW, four heads, sectors: Table 4's experimental T_ymin of 0.001 is an order below its neighbours; \
                 T_min is 2.100 with it or with 0.015.";
    vec![Note::new('a', NoteKind::Finding, follow), Note::new('b', NoteKind::Erratum, least)]
}
