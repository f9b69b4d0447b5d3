//! Pictures like the paper's Figures 6, 8, 12, 13 and 15.

mod beam;
mod patterns;
#[cfg(test)]
mod tests;
mod walls;

use headrace_experiments::{Dives, figures};

use crate::failure::Failure;

/// The pictures by file name.
pub(crate) fn all(dives: &Dives<'_>) -> Result<Vec<(&'static str, String)>, Failure> {
    let quiet = |_: &str| ();
    let phases = figures::walls(dives, &figures::PHASES, &quiet)?;
    let at_gaps = figures::walls(dives, &figures::AT_GAPS, &quiet)?;
    Ok(vec![
        ("fig06.svg", patterns::phase_shift(&figures::phase_shift(dives)?)?),
        ("fig08.svg", patterns::sectors(&figures::sectors(dives)?)?),
        ("fig12.svg", walls::walls("Figure 12: two heads with and without their phases aligned", &phases)?),
        (
            "fig13.svg",
            walls::walls("Figure 13: heads side by side hide the side walls from each other", &at_gaps)?,
        ),
        ("fig15.svg", beam::footprints(&figures::footprints()?)?),
    ])
}
