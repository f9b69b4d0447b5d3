//! What a fail was put down to, and the figures behind it.

use serde::{Deserialize, Serialize};

use super::again::Failing;
use super::cause::Cause;
use super::causes::Causes;
use headrace_sampling::head::HeadSet;

/// Causes of a fail and the figures behind them: those of driving are of the moment with the largest T as driven, in the
/// sections within T; counts are over these sections.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The main cause: the first of `causes`.
    pub cause: Cause,
    /// The smallest set of causes without which the section would have passed, the main one first.
    pub causes: Causes,
    /// Speed along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target in the middle, all heads turning as scheduled, m/s; the planned one
    /// where that does; zero where none.
    pub fits_mps: f64,
    /// The same with as many passes over each place as it takes for one, since returns are lost; never above `fits_mps`, m/s.
    pub with_losses_mps: f64,
    /// Time between passes, seconds.
    pub pass_gap_s: f64,
    /// Time between passes had they been spread evenly, seconds.
    pub even_pass_gap_s: f64,
    /// The same if all heads had been turning, seconds.
    pub all_pass_gap_s: f64,
    /// Share of pings without a return, beyond range or not.
    pub missing_share: f64,
    /// Share of pings occluded by the vehicle.
    pub occluded_share: f64,
    /// Share of pings of a stalled head.
    pub standing_share: f64,
    /// Samples lacking in the hole, whatever the reason: pings lost, or never made.
    pub lost_in_hole: u32,
    /// Largest step along the perimeter between neighbouring samples of one turn, m.
    pub t_y_m: f64,
    /// The same predicted for a level vehicle in the middle of the tunnel, m.
    pub middle_t_y_m: f64,
    /// How far the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Heads that went by without a ping, by number.
    #[serde(with = "head_numbers")]
    pub silent_heads: HeadSet,
}

impl Evidence {
    /// As sections of a run are counted.
    pub fn failing(&self) -> Failing {
        Failing { causes: self.causes, again_mps: self.with_losses_mps }
    }
}

mod head_numbers;
