//! Tables 3 and 4 of Jorge et al. 2021: the printed baseline (predictions) beside the recomputed one.

use headrace_sampling::layout::HeadLayout;
use serde::Serialize;

use super::baseline::{Baselines, t_x_m};
use super::cell::{Cell, Note, NoteKind, Table};
use super::findings;
use super::printed::{Line, lines};
use super::{FITTING_SPEED_MPS, PaperError, STATED_SPEED_MPS};

/// A row of Table 3: VITA 1, one head, at the stated speed. Distances in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OneHeadRow {
    /// The mode's name.
    pub mode: &'static str,
    /// Distance T_x between passes.
    pub t_x_m: Cell,
    /// Mean distance T_y between pings (Eq. 10).
    pub t_y_mean_m: Cell,
    /// Least distance between pings, T_ymin (Eq. 5).
    pub t_y_min_m: Cell,
    /// Largest distance between pings, T_ymax, by ray casting.
    pub t_y_max_m: Cell,
}

/// A row of Table 4: VITA 2, two to four heads. Distances in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SeveralHeadsRow {
    /// The mode's name.
    pub mode: &'static str,
    /// Number of heads s.
    pub heads: u8,
    /// Distance between passes of s heads in phase shift, T_x / s.
    pub phase_t_x_m: AtBothSpeeds,
    /// Largest distance between passes of s heads in sector offset, 2 T_x / s.
    pub sector_t_x_m: AtBothSpeeds,
    /// Mean distance T_y between pings (Eq. 10).
    pub t_y_mean_m: Cell,
    /// Least distance between pings, T_ymin (Eq. 5).
    pub t_y_min_m: Cell,
    /// Largest distance between pings, T_ymax, by ray casting.
    pub t_y_max_m: Cell,
}

/// A printed number beside recomputed numbers at two speeds: the speed that the paper states, and the speed that gives
/// the printed digits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct AtBothSpeeds {
    /// The number recomputed at [`STATED_SPEED_MPS`].
    pub at_stated_speed: Cell,
    /// The number recomputed at [`FITTING_SPEED_MPS`].
    pub at_fitting_speed: Cell,
}

/// Recomputes Table 3.
pub(super) fn one_head(baselines: &Baselines) -> Result<Table<OneHeadRow>, PaperError> {
    let row = |line: Line| {
        let (mode, across) = baselines.of(&line)?;
        let t_x_m = t_x_m(mode.turn, HeadLayout::PhaseShift, 1, STATED_SPEED_MPS)?;
        let largest = if mode.name == "SLOW" { 'b' } else { 'e' };
        Ok(OneHeadRow {
            mode: mode.name,
            t_x_m: Cell::new(line.printed("base_tx")?, t_x_m).noted_unless_equal('a'),
            t_y_mean_m: Cell::new(line.printed("base_ty_mean")?, across.mean_m).noted_unless_rounded('c'),
            t_y_min_m: Cell::new(line.printed("base_ty_min")?, across.min_m).noted_unless_rounded('d'),
            t_y_max_m: Cell::new(line.printed("base_ty_max")?, across.max_m).noted_unless_rounded(largest),
        })
    };
    let rows = lines(3).into_iter().map(row).collect::<Result<Vec<_>, PaperError>>()?;
    let fast = "FAST's T_x: 0.197 m/s x 8 s = 1.576 m; 1.573 takes 7.985 s, or 0.1966 m/s.";
    let slow = "SLOW's T_ymax, 0.014, is less than its mean; Table 4 has 0.102 and 0.104.";
    let notes = vec![
        Note::new('a', NoteKind::Erratum, fast),
        Note::new('b', NoteKind::Erratum, slow),
        findings::means('c', baselines, rows.iter().map(|row| (row.mode, &row.t_y_mean_m)))?,
        findings::minima_of_one('d', baselines)?,
        findings::maxima_of_one('e', baselines)?,
    ];
    Ok(Table { number: 3, title: "VITA 1, one head: the baseline at 0.197 m/s, metres", rows, notes })
}

/// Recomputes Table 4.
pub(super) fn several_heads(baselines: &Baselines) -> Result<Table<SeveralHeadsRow>, PaperError> {
    let rows =
        lines(4).iter().map(|line| several_heads_row(baselines, line)).collect::<Result<_, PaperError>>()?;
    let copied = "FAST with three and four heads: mean, min and max are FASTER's row again; FAST with two heads has \
                  0.086, 0.041 and 0.297.";
    let notes = vec![
        findings::speed('a', baselines)?,
        Note::new('b', NoteKind::Erratum, copied),
        Note::new('c', NoteKind::Finding, "p / n: see Table 3."),
        findings::minima_of_several('d', baselines)?,
        findings::maxima_of_several('e', baselines)?,
    ];
    Ok(Table { number: 4, title: "VITA 2, two to four heads: the baseline, metres", rows, notes })
}

fn several_heads_row(baselines: &Baselines, line: &Line) -> Result<SeveralHeadsRow, PaperError> {
    let (mode, across) = baselines.of(line)?;
    let heads = line.heads()?;
    let along = |column, layout| {
        let printed = line.printed(column)?;
        let at =
            |speed_mps| Ok::<_, PaperError>(Cell::new(printed, t_x_m(mode.turn, layout, heads, speed_mps)?));
        Ok::<_, PaperError>(AtBothSpeeds {
            at_stated_speed: at(STATED_SPEED_MPS)?.noted_unless_equal('a'),
            at_fitting_speed: at(FITTING_SPEED_MPS)?.noted_unless_equal('a'),
        })
    };
    let cell = |column, ours, mark| {
        let mark = if findings::is_copied(mode.name, heads) { 'b' } else { mark };
        Ok::<_, PaperError>(Cell::new(line.printed(column)?, ours).noted_unless_rounded(mark))
    };
    Ok(SeveralHeadsRow {
        mode: mode.name,
        heads,
        phase_t_x_m: along("base_phase_tx", HeadLayout::PhaseShift)?,
        sector_t_x_m: along("base_sector_tx", HeadLayout::SectorOffset)?,
        t_y_mean_m: cell("base_ty_mean", across.mean_m, 'c')?,
        t_y_min_m: cell("base_ty_min", across.min_m, 'd')?,
        t_y_max_m: cell("base_ty_max", across.max_m, 'e')?,
    })
}
