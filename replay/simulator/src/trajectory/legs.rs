//! Trajectories of legs at constant speed.

use super::flow::Flow;
use super::place::Place;

/// Lowest allowed speed of a leg, m/s.
const SLOWEST_MPS: f64 = 1e-3;
/// Minimum length of a piece of a leg that is cut at a change of the flow, m.
const SHORTEST_M: f64 = 1e-6;

/// A leg of a trajectory, driven at constant speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// Length of the leg, m, positive.
    pub distance_m: f64,
    /// Speed on the leg over ground, m/s; negative if backwards.
    pub speed_mps: f64,
}

impl Leg {
    fn duration_s(&self) -> f64 {
        self.distance_m / self.speed_mps.abs()
    }
}

/// Trajectory of legs in sequence, at one position in the cross-section. The vehicle stays level and parallel to the
/// axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Legs {
    across_m: [f64; 2],
    legs: Vec<Leg>,
    /// Time, s, and chainage, m, at the start of each leg.
    begins: Vec<(f64, f64)>,
    start_m: f64,
}

impl Legs {
    pub(super) fn new(start_m: f64, across_m: [f64; 2], legs: Vec<Leg>) -> Self {
        let mut begins = Vec::with_capacity(legs.len());
        let (mut at_s, mut at_m) = (0.0, start_m);
        for leg in &legs {
            begins.push((at_s, at_m));
            at_s += leg.duration_s();
            at_m += leg.distance_m * leg.speed_mps.signum();
        }
        Self { across_m, legs, begins, start_m }
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.legs.iter().map(Leg::duration_s).sum()
    }

    pub(super) fn place(&self, after_s: f64) -> Place {
        let leg = self.begins.partition_point(|(begins_s, _)| *begins_s <= after_s).saturating_sub(1);
        let (begins_s, from_m) = self.begins.get(leg).copied().unwrap_or((0.0, self.start_m));
        let speed_mps = self.legs.get(leg).map_or(0.0, |leg| leg.speed_mps);
        let chainage_m = from_m + (after_s - begins_s) * speed_mps;
        Place { chainage_m, across_m: self.across_m, turned_rad: [0.0; 3] }
    }

    /// Applies a flow of the water. The vehicle's speeds through the water stay the same. Changes of the flow cut a
    /// leg.
    ///
    /// Errors, as text: a leg makes no progress against the flow.
    pub(super) fn carry(&mut self, flow: &Flow) -> Result<(), String> {
        let mut legs = Vec::with_capacity(self.legs.len());
        for (number, (leg, (_, begins_m))) in self.legs.iter().zip(&self.begins).enumerate() {
            let (mut at_m, mut left_m, towards) = (*begins_m, leg.distance_m, leg.speed_mps.signum());
            while left_m > 0.0 {
                let change_m = flow.next_change_m(at_m, at_m + towards * left_m);
                // If no change of the flow cuts a leg, the leg keeps its exact length, without rounding errors.
                let distance_m = left_m.min((change_m - at_m).abs());
                let is_last = distance_m >= left_m - SHORTEST_M;
                let distance_m = if is_last { left_m } else { distance_m };
                let speed_mps = leg.speed_mps + flow.at_mps(at_m + towards * distance_m / 2.0);
                if speed_mps * towards < SLOWEST_MPS {
                    return Err(format!(
                        "carries the vehicle off: leg {number} (from 0) goes {} m/s through the water, so {speed_mps} \
                         m/s over ground",
                        leg.speed_mps
                    ));
                }
                legs.push(Leg { distance_m, speed_mps });
                left_m = if is_last { 0.0 } else { left_m - distance_m };
                at_m = change_m;
            }
        }
        *self = Self::new(self.start_m, self.across_m, legs);
        Ok(())
    }
}
