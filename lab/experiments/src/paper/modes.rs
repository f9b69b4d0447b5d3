//! Tables 1 and 2 of Jorge et al. 2021: the head's modes.

use headrace_sampling::head::Turn;
use headrace_sampling::section;
use serde::Serialize;

use super::PaperError;
use super::cell::{Cell, Note, NoteKind, Table};
use super::printed::{Printed, lines};

/// Full width of the beam at 600 kHz, degrees (Jorge et al. 2021, §6).
const BEAM_600_KHZ_DEG: f64 = 2.4;
/// Full width of the beam at 1 MHz, degrees (Jorge et al. 2021, §6).
const BEAM_1_MHZ_DEG: f64 = 1.4;

/// A row of Table 1: overlap of beams.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OverlapRow {
    /// Angular step theta, degrees.
    pub step_deg: Printed,
    /// Overlap epsilon of neighbouring beams at 600 kHz.
    pub overlap_600_khz: Cell,
    /// Overlap epsilon of neighbouring beams at 1 MHz.
    pub overlap_1_mhz: Cell,
}

/// A row of Table 2: a mode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ModeRow {
    /// The mode's name.
    pub mode: &'static str,
    /// Angular step theta as printed, degrees.
    pub step_deg: Printed,
    /// Period T of a turn as printed, seconds.
    pub period_s: Printed,
    /// Number of samples per turn, n.
    pub samples_per_turn: Cell,
    /// Number of samples per second, f_s.
    pub ping_rate_hz: Cell,
}

/// A mode as Table 2 prints it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mode {
    pub(super) name: &'static str,
    pub(super) turn: Turn,
}

/// The modes of Table 2.
pub(super) fn modes() -> Result<Vec<Mode>, PaperError> {
    let mode = |line: super::printed::Line| {
        let (step_deg, period_s) = (line.printed("step_deg")?.value(), line.printed("period_s")?.value());
        Ok(Mode { name: line.text("mode")?, turn: Turn::new(step_deg.to_radians(), period_s)? })
    };
    lines(2).into_iter().map(mode).collect()
}

/// Recomputes Table 1.
pub(super) fn overlaps() -> Result<Table<OverlapRow>, PaperError> {
    let row = |line: super::printed::Line| {
        let step_deg = line.printed("step_deg")?;
        let cell = |column, beam_deg: f64| {
            let ours = section::overlap(beam_deg.to_radians(), step_deg.value().to_radians())?;
            Ok::<_, PaperError>(Cell::new(line.printed(column)?, ours))
        };
        let narrow = cell("overlap_1_mhz", BEAM_1_MHZ_DEG)?;
        let narrow = if narrow.printed.value() > 0.0 { narrow } else { narrow.noted('a') };
        Ok(OverlapRow {
            step_deg,
            overlap_600_khz: cell("overlap_600_khz", BEAM_600_KHZ_DEG)?,
            overlap_1_mhz: narrow,
        })
    };
    let rows = lines(1).into_iter().map(row).collect::<Result<_, PaperError>>()?;
    let none = "1 MHz, 2.4 deg: printed 0; Eq. 22 gives 1.4 / 2.4 = 0.58, which is below 1: no overlap.";
    let cut = "2.67 and 4.67 are rounded, 1.55 and 1.16 truncated.";
    let notes = vec![Note::new('a', NoteKind::Erratum, none), Note::new('b', NoteKind::Finding, cut)];
    Ok(Table { number: 1, title: "Overlap of neighbouring beams, zeta / theta (Eq. 22)", rows, notes })
}

/// Recomputes Table 2.
pub(super) fn speeds() -> Result<Table<ModeRow>, PaperError> {
    let row = |line: super::printed::Line| {
        let (step_deg, period_s) = (line.printed("step_deg")?, line.printed("period_s")?);
        let turn = Turn::new(step_deg.value().to_radians(), period_s.value())?;
        Ok(ModeRow {
            mode: line.text("mode")?,
            step_deg,
            period_s,
            samples_per_turn: Cell::new(line.printed("samples_per_rev")?, f64::from(turn.steps())),
            ping_rate_hz: Cell::new(line.printed("samples_per_s")?, 1.0 / turn.ping_period_s()),
        })
    };
    let rows = lines(2).into_iter().map(row).collect::<Result<_, PaperError>>()?;
    let cut = "55.55 is truncated.";
    let notes = vec![Note::new('a', NoteKind::Finding, cut)];
    Ok(Table { number: 2, title: "Samples per turn (Eq. 3) and per second, range 10 m", rows, notes })
}
