//! Intervals of the perimeter.

use serde::{Deserialize, Serialize};

use crate::error::SamplingError;
use crate::occlusion::AngleRange;
use crate::ring::Standing;
use headrace_geometry::math;

/// An interval of the perimeter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Arc {
    /// Arc length of the start, m.
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
        // A head that faces aft sweeps the wall in the opposite direction.
        Ok(if middle <= whole {
            Self { from_m: first, length_m: whole }
        } else {
            Self { from_m: last, length_m: perimeter_m - whole }
        })
    }

    /// Joins this arc with the next one in the head's direction of rotation.
    pub(super) fn on_to(&self, next: &Self, forward: bool, perimeter_m: f64) -> Self {
        let (first, last) = if forward { (self, next) } else { (next, self) };
        let length_m = math::wrap(last.from_m + last.length_m - first.from_m, perimeter_m);
        Self { from_m: first.from_m, length_m }
    }

    pub(super) fn has(&self, arc_m: f64, perimeter_m: f64) -> bool {
        math::wrap(arc_m - self.from_m, perimeter_m) <= self.length_m
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
