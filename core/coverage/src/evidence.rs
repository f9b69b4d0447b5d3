//! Causes of a fail, and the figures behind them.

use serde::{Deserialize, Serialize};

use super::again::Failing;
use super::cause::Cause;
use super::causes::Causes;
use headrace_sampling::head::HeadSet;

/// Causes of a fail, and the figures behind them.
///
/// Figures of driving are from the moment with the largest T as driven, among the sections within T. Counts
/// are over these sections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Main cause: the first of `causes`.
    pub cause: Cause,
    /// Smallest set of causes without which the section would have passed, main cause first.
    pub causes: Causes,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target from the tunnel's centre with all heads turning as
    /// scheduled, m/s.
    ///
    /// It is the planned speed if that meets the target, and zero if no speed does.
    pub fits_mps: f64,
    /// `fits_mps` reduced for lost returns: the passes needed in place of one all fit, m/s. Never above
    /// `fits_mps`.
    pub with_losses_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes if they had been evenly spread, seconds.
    pub even_pass_gap_s: f64,
    /// Time between evenly spread passes if all heads had been turning, seconds.
    pub all_pass_gap_s: f64,
    /// Share of pings without a return, including those beyond range.
    pub missing_share: f64,
    /// Share of pings occluded by the vehicle.
    pub occluded_share: f64,
    /// Share of pings of a stalled head.
    pub standing_share: f64,
    /// Samples missing in the hole for any reason: the ping was lost, or never made.
    pub lost_in_hole: u32,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// Largest step predicted for a level vehicle in the centre of the tunnel, m.
    pub middle_t_y_m: f64,
    /// Distance that the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Numbers of the heads that passed without pinging.
    #[serde(with = "head_numbers")]
    pub silent_heads: HeadSet,
}

impl Evidence {
    /// The figures by which sections of a run are counted.
    pub fn failing(&self) -> Failing {
        Failing { causes: self.causes, again_mps: self.with_losses_mps }
    }
}

mod head_numbers;
