//! The parts of the wall that one head sees, as arcs of the perimeter, and the wall within the head's sector.

use serde::{Deserialize, Serialize};

use crate::error::SamplingError;
use crate::occlusion::AngleRange;
use crate::ring::{Ring, Standing};
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;

/// An interval of the wall's perimeter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// Arc length at the start of the interval, m.
    pub from_m: f64,
    /// Length of the interval in the direction of growing arc length, m.
    pub length_m: f64,
}

impl Arc {
    /// Returns the part of the wall covered by a range of head angles.
    ///
    /// Errors: as for [`Standing::sounding`].
    pub fn of(standing: &Standing<'_>, angles: &AngleRange) -> Result<Self, SamplingError> {
        let arc_m = |angle_rad| standing.sounding(angle_rad).map(|sounding| sounding.arc_m);
        let perimeter_m = standing.perimeter_m();
        if angles.size_rad >= math::TAU {
            return Ok(Self { from_m: 0.0, length_m: perimeter_m });
        }
        let (first, last) = (arc_m(angles.from_rad)?, arc_m(angles.from_rad + angles.size_rad)?);
        let (middle, whole) = (
            math::wrap(arc_m(angles.middle_rad())? - first, perimeter_m),
            math::wrap(last - first, perimeter_m),
        );
        // A head that faces aft sweeps the wall in the direction of falling arc length.
        Ok(if middle <= whole {
            Self { from_m: first, length_m: whole }
        } else {
            Self { from_m: last, length_m: perimeter_m - whole }
        })
    }

    /// Joins this arc with the next arc in the head's direction of rotation.
    pub(super) fn on_to(&self, next: &Self, forward: bool, perimeter_m: f64) -> Self {
        let (first, last) = if forward { (self, next) } else { (next, self) };
        let length_m = math::wrap(last.from_m + last.length_m - first.from_m, perimeter_m);
        Self { from_m: first.from_m, length_m }
    }

    pub(super) fn has(&self, arc_m: f64, perimeter_m: f64) -> bool {
        math::wrap(arc_m - self.from_m, perimeter_m) <= self.length_m
    }
}

/// Number of equal angles into which a sector is divided.
///
/// The longest time between passes is taken as constant within a part. At the two ends of a part, this time differs by
/// an eighth of a sweep there and back.
pub const PARTS: usize = 8;

/// Wall within a head's sector, in parts of equal angle from one turning point to the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sector {
    parts: [Arc; PARTS],
}

impl Sector {
    /// Returns the wall that a head sees between two turning points.
    ///
    /// `angles` are in the sensor frame of the head.
    ///
    /// Errors: as for [`Standing::sounding`].
    pub fn of(standing: &Standing<'_>, angles: &AngleRange) -> Result<Self, SamplingError> {
        let mut parts = [Arc::of(standing, angles)?; PARTS];
        let size_rad = angles.size_rad / PARTS as f64;
        for (k, part) in parts.iter_mut().enumerate() {
            let from_rad = angles.from_rad + k as f64 * size_rad;
            *part = Arc::of(standing, &AngleRange { from_rad, size_rad })?;
        }
        Ok(Self { parts })
    }

    /// Wall of each part of the sector.
    pub(super) fn parts(&self) -> impl Iterator<Item = &Arc> {
        self.parts.iter()
    }

    /// Longest time between two passes over the part of the sector that contains this place, 0.5 to 1.
    ///
    /// The time is a share of a sweep there and back; `None` outside the sector. At a turning point, a second pass
    /// follows immediately, and the third pass comes a whole sweep there and back later. In the middle of the sector,
    /// passes are evenly spaced. The head's samples form a zigzag along the tunnel. An empty circle between two of its
    /// legs is at most as wide as the distance between the legs at the circle's centre.
    /// Source: Jorge et al. 2021, §5.2 (T_x1 + T_x2 = 2 T_x / s).
    pub(super) fn wait(&self, arc_m: f64, perimeter_m: f64) -> Option<f64> {
        let number = self.parts.iter().position(|part| part.has(arc_m, perimeter_m))?;
        Some((number + 1).max(PARTS - number) as f64 / PARTS as f64)
    }
}

#[cfg(test)]
impl Sector {
    /// Creates the sector of a head on the axis of a pipe, where equal angles are equal arcs.
    pub(super) fn evenly(arc: Arc) -> Self {
        let length_m = arc.length_m / PARTS as f64;
        let part = |k: usize| Arc { from_m: arc.from_m + k as f64 * length_m, length_m };
        Self { parts: core::array::from_fn(part) }
    }
}

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
    /// Adds to `hidden` the wall of a ring that is outside the head's range limits.
    ///
    /// If there is no capacity for another arc, the latest arc is extended up to the new arc, over visible wall. Hiding
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joined_arcs_include_the_gap_and_the_seam_between_them() {
        let arc = |from_m: f64, length_m: f64| Arc { from_m, length_m };
        let onward = |a: Arc, b: Arc, forward: bool| {
            let joined = a.on_to(&b, forward, 20.0);
            (joined.from_m, joined.length_m)
        };
        assert_eq!(onward(arc(10.0, 2.0), arc(15.0, 3.0), true), (10.0, 8.0));
        assert_eq!(onward(arc(15.0, 3.0), arc(10.0, 2.0), false), (10.0, 8.0));
        assert_eq!(onward(arc(18.0, 1.0), arc(1.0, 2.0), true), (18.0, 5.0));
    }
}
