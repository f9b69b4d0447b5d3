//! An unsure stretch (neighbouring sections that neither pass nor fail) and its texts. Allocates: outlets
//! only, never within a tick.

use serde::Serialize;

use crate::pilot_text::limit_text;
use headrace_coverage::{Driven, Sections, Stretch, Unsure};

/// A stretch that neither passes nor fails.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct UnsureStretch {
    /// Reason for which the stretch has no verdict.
    pub why: Unsure,
    /// Beginning of the stretch, m.
    pub from_m: f64,
    /// End of the stretch, m.
    pub to_m: f64,
    /// Length of the stretch's sections that neither pass nor fail, m.
    pub metres_m: f64,
    /// Diameter of the stretch's largest hole, m.
    pub hole_m: f64,
    /// Standard deviation of the largest hole's diameter, m.
    pub hole_sd_m: f64,
    /// Error of the largest hole's diameter, m: the confidence times its standard deviation.
    pub hole_error_m: f64,
    /// Driving figures of the section with the largest hole.
    #[serde(skip)]
    pub driven: Driven,
    /// Whether the hole's error, rather than its size, prevents a verdict in most sections of the stretch.
    #[serde(skip)]
    pub is_mostly_error: bool,
}

impl UnsureStretch {
    /// Creates the stretch, in metres, from a stretch of sections without a verdict.
    pub fn of(stretch: &Stretch, sections: &Sections) -> Self {
        let section_m = sections.section_m();
        let [hole_m, hole_sd_m] = stretch.largest().hole_m;
        Self {
            why: stretch.why,
            from_m: stretch.from as f64 * section_m,
            to_m: stretch.to as f64 * section_m,
            metres_m: f64::from(stretch.sections()) * section_m,
            hole_m,
            hole_sd_m,
            hole_error_m: sections.target().error_m(hole_sd_m),
            driven: stretch.largest().driven,
            is_mostly_error: stretch.is_mostly_error(),
        }
    }
}

/// Reason for which a stretch has no verdict, with its figures.
pub fn unsure_text(stretch: &UnsureStretch) -> String {
    match stretch.why {
        Unsure::NotInspected => format!("{:.2} m not seen from both sides", stretch.metres_m),
        Unsure::Position => {
            format!("hole {:.2} ± {:.2} m", stretch.hole_m, stretch.hole_error_m)
        }
        Unsure::SeveralStretches => "position lost or doubtful between passes".to_owned(),
        Unsure::DoubtfulReturns => "doubtful returns".to_owned(),
        Unsure::DistrustedHead => "seen by a head whose returns are rejected".to_owned(),
        Unsure::ContradictedProfile => "the wall position differs from the design".to_owned(),
        Unsure::OtherSize => "the cross-section differs from the design".to_owned(),
        Unsure::NoWall => "a declared opening, no wall".to_owned(),
    }
}

/// Lower and upper ratio of a speed to the fitting speed, the largest speed that meets the target. Between the two
/// ratios, the speed counts as equal to the fitting speed.
const AS_FITS: [f64; 2] = [0.98, 1.02];

/// Text of the remedy for a stretch without a verdict; empty if there is none.
pub fn helps_text(stretch: &UnsureStretch) -> String {
    let surer = "pass it again with a more certain position";
    let helps = match stretch.why {
        Unsure::NotInspected => "drive right through it",
        Unsure::Position => {
            let Driven { speed_mps, fits_mps, is_uneven, is_short } = stretch.driven;
            let [least_mps, most_mps] = AS_FITS.map(|share| share * fits_mps);
            return if stretch.is_mostly_error {
                surer.to_owned()
            } else if is_short {
                "pass it again slower, or with the silent head restored".to_owned()
            } else if fits_mps > 0.0 && speed_mps > most_mps {
                format!("at most {}, or {surer}", limit_text(fits_mps))
            } else if speed_mps > 0.0 && speed_mps < least_mps && is_uneven {
                // Below this speed, heads at different places along the hull are out of phase with each
                // other.
                format!("at {}, or {surer}", limit_text(fits_mps))
            } else {
                surer.to_owned()
            };
        }
        Unsure::SeveralStretches => "pass it again in one go",
        Unsure::DoubtfulReturns => "pass it again in clear water",
        Unsure::DistrustedHead => "pass it again without that head",
        Unsure::ContradictedProfile => "check profile, sound speed and tether zero",
        Unsure::OtherSize => "check profile and sound speed",
        Unsure::NoWall => "",
    };
    helps.to_owned()
}
