//! Standard deviations of an estimate's pose, and the limits for georeferencing samples.

use serde::{Deserialize, Serialize};

use super::factors::Factors;
use super::state::{ATTITUDE, CREEP, ERRORS, POSITION};
use crate::fix::NoFix;
use crate::relative::Relative;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;

/// Largest standard deviations at which samples are georeferenced: position in the cross-section, m, and yaw, radians.
const PLACE_LIMIT_M: f64 = 0.5;
const YAW_LIMIT_RAD: f64 = 0.25;
/// Largest standard deviation of the chainage at which samples are georeferenced, m, both absolute and relative to the
/// previous head pass.
const ALONG_LIMIT_M: f64 = 1.0;

/// Standard deviations of the parts of an estimated pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseSd {
    /// Standard deviation of the chainage, m. It excludes the part that the cable's scale causes.
    pub along_m: f64,
    /// Standard deviation of the position in the cross-section, in the less certain direction, m.
    pub place_m: f64,
    /// Standard deviation of roll or pitch, whichever is larger, radians.
    pub tilt_rad: f64,
    /// Standard deviation of yaw, radians.
    pub yaw_rad: f64,
}

impl PoseSd {
    /// Computes the standard deviations from the covariance of an estimate's errors.
    pub fn of(factors: &Factors<ERRORS>) -> Self {
        let of = |i: usize| math::sqrt(factors.variance(i));
        let mut along = [0.0; ERRORS];
        for (i, share) in [(POSITION, 1.0), (CREEP, 1.0)] {
            if let Some(slot) = along.get_mut(i) {
                *slot = share;
            }
        }
        Self {
            along_m: math::sqrt(factors.variance_along(&along)),
            place_m: of(POSITION + 1).max(of(POSITION + 2)),
            tilt_rad: of(ATTITUDE).max(of(ATTITUDE + 1)),
            yaw_rad: of(ATTITUDE + 2),
        }
    }

    /// Whether no standard deviation is negative, and all are numbers.
    pub fn is_valid(&self) -> bool {
        let Self { along_m, place_m, tilt_rad, yaw_rad } = *self;
        [along_m, place_m, tilt_rad, yaw_rad].iter().all(|sd| *sd >= 0.0)
    }

    /// Returns the covariance of this estimate relative to an independent estimate with the same uncertainty.
    pub fn independent(&self) -> Relative {
        let variance = |sd: f64| 2.0 * sd * sd;
        let [along, tilt, yaw] = [self.along_m, self.tilt_rad, self.yaw_rad].map(variance);
        Relative::new([[along, 0.0, 0.0], [0.0, tilt, 0.0], [0.0, 0.0, yaw]])
    }

    /// Returns `relative` if both this estimate and `relative` are certain enough to georeference samples.
    ///
    /// Errors: the part of the pose that is too uncertain.
    pub fn standing(&self, relative: Relative) -> Result<Relative, NoFix> {
        if self.yaw_rad > YAW_LIMIT_RAD {
            Err(NoFix::Heading)
        } else if self.place_m > PLACE_LIMIT_M {
            Err(NoFix::Section)
        } else if relative.sd_m(Vec3::zero()) > ALONG_LIMIT_M || self.along_m > ALONG_LIMIT_M {
            Err(NoFix::Chainage)
        } else {
            Ok(relative)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The limits are stated in docs/why/navigation.md. At 4 m, a yaw of 0.25 rad moves a sample by a metre.
    #[test]
    fn too_uncertain_estimate_gives_no_fix() {
        let sure = PoseSd { along_m: 0.1, place_m: 0.05, tilt_rad: 0.01, yaw_rad: 0.02 };
        let near = Relative::along(0.05);
        assert_eq!(sure.standing(near), Ok(near));
        for (unsure, relative, no_fix) in [
            (PoseSd { yaw_rad: 0.24, ..sure }, near, None),
            (PoseSd { yaw_rad: 0.26, ..sure }, near, Some(NoFix::Heading)),
            (PoseSd { place_m: 0.49, ..sure }, near, None),
            (PoseSd { place_m: 0.51, ..sure }, near, Some(NoFix::Section)),
            (PoseSd { along_m: 0.99, ..sure }, near, None),
            (PoseSd { along_m: 1.01, ..sure }, near, Some(NoFix::Chainage)),
            (sure, Relative::along(0.99), None),
            (sure, Relative::along(1.01), Some(NoFix::Chainage)),
        ] {
            assert_eq!(unsure.standing(relative).err(), no_fix, "{unsure:?}, {relative:?}");
        }
    }
}
