//! Predictions by the equations of Jorge et al. 2021: the columns "baseline" of its Tables 3 and 4.

use headrace_sampling::head::Turn;
use headrace_sampling::layout::HeadLayout;
use headrace_sampling::spacing::Spiral;

use super::PaperError;
use super::drift::{Across, Rig, across};
use super::modes::{Mode, modes};
use super::printed::Line;

/// Recomputed predictions for all modes of the heads and all rigs (mounting positions).
#[derive(Debug, Clone)]
pub(super) struct Baselines {
    modes: Vec<Mode>,
    rigs: Vec<(Rig, Vec<Across>)>,
}

impl Baselines {
    pub(super) fn new() -> Result<Self, PaperError> {
        let modes = modes()?;
        let rigs = [Rig::Vita1, Rig::Vita2InLine, Rig::Vita2Pairs].map(|rig| Ok((rig, across(rig, &modes)?)));
        let rigs = rigs.into_iter().collect::<Result<_, PaperError>>()?;
        Ok(Self { modes, rigs })
    }

    /// Finds a mode by its name.
    pub(super) fn mode(&self, name: &'static str) -> Result<Mode, PaperError> {
        self.modes.iter().find(|mode| mode.name == name).copied().ok_or(PaperError::Mode { name })
    }

    /// The mode and the predicted ping distance T_y for a line of a printed table.
    pub(super) fn of(&self, line: &Line) -> Result<(Mode, Across), PaperError> {
        let (name, rig) = (line.text("mode")?, Rig::of(line.heads()?));
        let of_rig = self.rigs.iter().filter(|(one, _)| *one == rig).flat_map(|(_, modes)| modes);
        let mut found = self.modes.iter().zip(of_rig).filter(|(mode, _)| mode.name == name);
        let (mode, across) = found.next().ok_or(PaperError::Mode { name })?;
        Ok((*mode, *across))
    }
}

/// The largest distance between passes, m: T_x / s in phase shift, 2 T_x / s in sector offset, with T_x of one head and
/// s heads.
pub(super) fn t_x_m(turn: Turn, layout: HeadLayout, heads: u8, speed_mps: f64) -> Result<f64, PaperError> {
    let passes_per_turn = match layout {
        HeadLayout::PhaseShift => f64::from(heads),
        HeadLayout::SectorOffset => f64::from(heads) / 2.0,
    };
    Ok(Spiral::new(speed_mps, turn, passes_per_turn)?.t_x_m())
}
