//! Names and results of the modes, for the charts of speeds and hours.

use headrace_deliver::pictures::look::{self, Look};
use headrace_sampling::SamplingError;
use headrace_sampling::plan::Planner;

use super::shown::Shown;

/// A mode as shown in the charts.
#[derive(Debug, Clone)]
pub(super) struct Mode {
    pub(super) number: usize,
    pub(super) name: String,
    pub(super) look: Look,
    /// Largest speed that meets the target, m/s.
    pub(super) v_max_mps: Option<f64>,
    /// Whether the mode has no spacing T at any speed, because no head sees some strip of the wall.
    pub(super) blind: bool,
}

/// All modes of the plan, for the charts.
pub(super) fn all(shown: &Shown<'_>) -> Result<Vec<Mode>, SamplingError> {
    let count = shown.planner.modes().len();
    let mode = |number: usize| -> Result<Mode, SamplingError> {
        let reached =
            shown.question.target_m.and_then(|target_m| shown.planner.v_max_mps(number, target_m).ok());
        Ok(Mode {
            number,
            name: name(shown.planner, number),
            look: look::of_several(number),
            v_max_mps: reached,
            blind: shown.planner.t_max_m(number, shown.speed_mps)?.is_infinite(),
        })
    };
    (0..count).map(mode).collect()
}

/// Name of a mode, in capitals as on the head's own panel.
pub(super) fn name(planner: &Planner, mode: usize) -> String {
    planner.modes().get(mode).map(|planned| planned.mode.name.to_uppercase()).unwrap_or_default()
}

/// The mode and speed that the charts show, as text.
pub(super) fn at_speed(shown: &Shown<'_>) -> String {
    format!("{} at {} m/s", name(shown.planner, shown.mode), speed(shown.speed_mps))
}

/// A speed for printing, in whole millimetres per second. It is rounded down, so that the printed speed meets
/// the target, too.
pub(super) fn speed(speed_mps: f64) -> String {
    let down = (speed_mps * 1000.0 + 1e-6).floor() / 1000.0;
    if down > 0.0 { format!("{down:.3}") } else { format!("{speed_mps:.5}") }
}

/// Hours as printed in the charts.
pub(super) fn hours(hours: f64) -> String {
    match hours {
        few if few < 1.0 => format!("{few:.2}"),
        many if many >= 1000.0 => format!("{many:.0}"),
        _ => format!("{hours:.1}"),
    }
}

/// The mode with the largest speed among those that meet the target.
pub(super) fn fastest(modes: &[Mode]) -> Option<&Mode> {
    let met = modes.iter().filter(|mode| mode.v_max_mps.is_some());
    met.max_by(|a, b| a.v_max_mps.unwrap_or(0.0).total_cmp(&b.v_max_mps.unwrap_or(0.0)))
}

/// Text about the modes in which no head sees some strip of the wall.
pub(super) fn blind_words(modes: &[Mode]) -> Vec<String> {
    let blind: Vec<&str> = modes.iter().filter(|mode| mode.blind).map(|mode| mode.name.as_str()).collect();
    match blind.len() {
        0 => Vec::new(),
        count if count == modes.len() => vec![
            "Part of the wall is seen by no head:".to_owned(),
            "no speed and no mode gives a T there.".to_owned(),
        ],
        _ => vec![format!("{}: part of the wall is seen by no head", blind.join(", "))],
    }
}
