//! Causes of a fail, and the figures behind them.

use serde::{Deserialize, Serialize};

use super::again::Failing;
use super::cause::{Cause, Causes};
use headrace_sampling::head::HeadSet;

/// Causes of a fail, and the figures behind them.
///
/// T is the target. Counts are sums over the sections within the distance T of the hole. Driving figures come from the
/// same sections, at the moment with the largest distance between passes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Main cause: the first cause in `causes`.
    pub cause: Cause,
    /// Smallest set of causes without which the section would have passed. The main cause comes first.
    pub causes: Causes,
    /// Speed of the vehicle along the tunnel, m/s.
    pub speed_mps: f64,
    /// Largest speed that would have met the target from the tunnel's centre, m/s. Zero if no speed does.
    ///
    /// All heads are assumed to turn as scheduled. If the planned speed meets the target, the value is the planned
    /// speed.
    pub fits_mps: f64,
    /// Largest speed that would have met the target despite lost returns, m/s. It is never above `fits_mps`.
    ///
    /// It leaves time for the additional passes that replace lost returns.
    pub with_losses_mps: f64,
    /// Longest time between passes of heads over the same wall, seconds.
    pub pass_gap_s: f64,
    /// Longest time between passes over the same wall if the passes had been evenly spread in time, seconds.
    pub even_pass_gap_s: f64,
    /// Longest time between passes over the same wall if all heads had been turning and evenly spread, seconds.
    pub all_pass_gap_s: f64,
    /// Share of pings without a return. It includes pings at wall that was out of range.
    pub missing_share: f64,
    /// Share of pings at which the vehicle occluded the beam.
    pub occluded_share: f64,
    /// Share of pings that a stalled head made.
    pub standing_share: f64,
    /// Number of samples missing in the hole, because a ping gave no sample or was not made.
    pub lost_in_hole: u32,
    /// Largest step along the perimeter between neighbouring samples of a head's turn, m.
    pub t_y_m: f64,
    /// Prediction of `t_y_m` for a level vehicle in the centre of the tunnel, m.
    pub middle_t_y_m: f64,
    /// Distance by which the beams swung along the tunnel between two passes, m.
    pub swing_m: f64,
    /// Numbers of the heads that passed through the sections without pinging, or without an accepted return.
    #[serde(with = "head_numbers")]
    pub silent_heads: HeadSet,
}

impl Evidence {
    /// Whether causes and figures agree: the main cause is among the causes, shares are from 0 to 1, and
    /// `with_losses_mps` is at most `fits_mps`.
    pub fn is_consistent(&self) -> bool {
        let shares = [self.missing_share, self.occluded_share, self.standing_share];
        self.causes.has(self.cause)
            && shares.iter().all(|share| (0.0..=1.0).contains(share))
            && (0.0..=self.fits_mps).contains(&self.with_losses_mps)
    }

    /// Causes and required speed of the failed section, for the counts of its missed stretch.
    pub fn failing(&self) -> Failing {
        Failing { causes: self.causes, again_mps: self.with_losses_mps }
    }
}

/// Serialises a set of heads as a list of numbers in text formats such as JSON, and as bits in snapshots.
mod head_numbers {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use headrace_sampling::head::HeadSet;

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes fields by reference")]
    pub(super) fn serialize<S: Serializer>(heads: &HeadSet, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            serializer.collect_seq(heads.iter())
        } else {
            heads.serialize(serializer)
        }
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<HeadSet, D::Error> {
        if deserializer.is_human_readable() {
            Ok(Vec::<usize>::deserialize(deserializer)?.into_iter().fold(HeadSet::default(), HeadSet::with))
        } else {
            HeadSet::deserialize(deserializer)
        }
    }
}
