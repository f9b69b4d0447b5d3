//! The parts of the wall that one head sees.

use super::arc::Arc;
use super::sector::Sector;
use crate::ring::Ring;
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;

/// The parts of the wall that one head sees.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct View {
    /// Sector of the head; `None` for the whole perimeter.
    pub sector: Option<Sector>,
    /// Arcs of the wall that the vehicle hides from the head, or that are outside the head's range limits.
    pub hidden: Vec<Arc>,
}

stateful!(View { state: sector; lists: hidden; });

impl View {
    /// Hides the parts of a ring that are outside the head's range limits.
    ///
    /// Without capacity for another arc, the function extends the last arc over the visible part in between. Hiding
    /// too much wall is the safe error.
    ///
    /// Allocates: not if the capacity suffices for one arc.
    pub fn hide_out_of_reach(&mut self, ring: &Ring, reach_m: [f64; 2]) {
        let [least_m, most_m] = reach_m;
        let heard = |range_m: f64| (least_m..=most_m).contains(&range_m);
        let soundings = ring.soundings();
        let Some(first) = soundings.iter().position(|sounding| heard(sounding.range_m())) else {
            self.hidden.clear();
            self.hidden.push(Arc { from_m: 0.0, length_m: ring.perimeter_m() });
            return;
        };
        let mut began: Option<f64> = None;
        let mut before_m = 0.0;
        for sounding in soundings.iter().cycle().skip(first).take(soundings.len() + 1) {
            match (heard(sounding.range_m()), began) {
                (false, None) => began = Some(before_m),
                (true, Some(from_m)) => {
                    let way_m = math::wrap_signed(sounding.arc_m - from_m, ring.perimeter_m());
                    let forward = ring.way_round_m() >= 0.0;
                    let (from_m, way_m) = if forward { (from_m, way_m) } else { (sounding.arc_m, -way_m) };
                    let arc = Arc { from_m, length_m: math::wrap(way_m, ring.perimeter_m()) };
                    let full = self.hidden.len() == self.hidden.capacity();
                    match self.hidden.last_mut().filter(|_| full) {
                        Some(last) => *last = last.on_to(&arc, forward, ring.perimeter_m()),
                        None => self.hidden.push(arc),
                    }
                    began = None;
                }
                _ => {}
            }
            before_m = sounding.arc_m;
        }
    }
}
