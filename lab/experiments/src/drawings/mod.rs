//! Draws pictures like Figures 6, 8, 12, 13 and 15 of Jorge et al. 2021.

mod beam;
mod patterns;
mod scale;
#[cfg(test)]
mod tests;
mod walls;

use crate::{ExperimentError, Progress, figures};

/// Draws the pictures as SVG, by file name; `progress` receives status messages.
///
/// Errors: none with the built-in vehicles.
pub fn all(progress: Progress<'_>) -> Result<Vec<(&'static str, String)>, ExperimentError> {
    let phases = figures::walls(&figures::PHASES, progress)?;
    let at_gaps = figures::walls(&figures::AT_GAPS, progress)?;
    Ok(vec![
        ("fig06.svg", patterns::phase_shift(&figures::phase_shift()?)),
        ("fig08.svg", patterns::sectors(&figures::sectors()?)),
        ("fig12.svg", walls::walls("Figure 12: two heads with and without their phases aligned", &phases)),
        (
            "fig13.svg",
            walls::walls("Figure 13: heads side by side hide the side walls from each other", &at_gaps),
        ),
        ("fig15.svg", beam::footprints(&figures::footprints()?)),
    ])
}
