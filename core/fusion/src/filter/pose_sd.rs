//! How sure an estimate's pose is, and whether that is enough to place samples.

use serde::{Deserialize, Serialize};

use super::factors::Factors;
use super::state::{ATTITUDE, CREEP, ERRORS, POSITION};
use crate::NoFix;
use crate::relative::Relative;
use headrace_geometry::frames::Vec3;
use headrace_geometry::math;

/// Maximum standard deviations of position in the section and yaw for georeferencing, m and radians.
const PLACE_LIMIT_M: f64 = 0.5;
const YAW_LIMIT_RAD: f64 = 0.25;
/// The same for chainage, relative to the heads' previous pass, and to the cable's length.
const ALONG_LIMIT_M: f64 = 1.0;

/// Standard deviations of an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseSd {
    /// Of the chainage, excluding the cable's scale, m.
    pub along_m: f64,
    /// Of the position in the section, in the worse direction, m.
    pub place_m: f64,
    /// Of roll or pitch, radians.
    pub tilt_rad: f64,
    /// Of yaw, radians.
    pub yaw_rad: f64,
}

impl PoseSd {
    /// Those of an estimate and the covariance of its errors.
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

    /// Covariance relative to an estimate as sure as this one that has nothing to do with it.
    pub fn independent(&self) -> Relative {
        let variance = |sd: f64| 2.0 * sd * sd;
        let [along, tilt, yaw] = [self.along_m, self.tilt_rad, self.yaw_rad].map(variance);
        Relative::new([[along, 0.0, 0.0], [0.0, tilt, 0.0], [0.0, 0.0, yaw]])
    }

    /// Whether this estimate and relative covariance are good enough to georeference samples.
    ///
    /// Errors: the part that is too uncertain.
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

    /// The limits of docs/why/navigation.md: at 4 m, 0.25 rad move a sample by a metre.
    #[test]
    fn what_is_known_too_badly_places_no_sample() {
        let sure = PoseSd { along_m: 0.1, place_m: 0.05, tilt_rad: 0.01, yaw_rad: 0.02 };
        let near = Relative::along(0.05);
        assert_eq!(sure.standing(near), Ok(near));
        for (unsure, relative, lacking) in [
            (PoseSd { yaw_rad: 0.24, ..sure }, near, None),
            (PoseSd { yaw_rad: 0.26, ..sure }, near, Some(NoFix::Heading)),
            (PoseSd { place_m: 0.49, ..sure }, near, None),
            (PoseSd { place_m: 0.51, ..sure }, near, Some(NoFix::Section)),
            (PoseSd { along_m: 0.99, ..sure }, near, None),
            (PoseSd { along_m: 1.01, ..sure }, near, Some(NoFix::Chainage)),
            (sure, Relative::along(0.99), None),
            (sure, Relative::along(1.01), Some(NoFix::Chainage)),
        ] {
            assert_eq!(unsure.standing(relative).err(), lacking, "{unsure:?}, {relative:?}");
        }
    }
}
