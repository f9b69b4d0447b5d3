//! A head's sector on the wall, and the longest time between two passes over each place in the sector.

use serde::{Deserialize, Serialize};

use super::arc::Arc;
use crate::error::SamplingError;
use crate::occlusion::AngleRange;
use crate::ring::Standing;

/// Number of equal angles into which a sector is divided.
///
/// The longest times between passes at the two ends of a part differ by an eighth of a sweep there and back.
pub const PARTS: usize = 8;

/// Wall of a head's sector, in parts of equal angle from one turning point to the other.
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

    /// Parts of the sector.
    pub(super) fn parts(&self) -> impl Iterator<Item = &Arc> {
        self.parts.iter()
    }

    /// Longest time between two passes over the part that contains this place, 0.5 to 1.
    ///
    /// The time is a share of a sweep there and back; `None` outside the sector. At a turning point, one pass follows
    /// another immediately, and the next comes a whole sweep later. In the middle of the sector, passes are evenly
    /// spaced. A circle between two legs of the zigzag is at most as wide as the legs' distance at its centre.
    /// Source: Jorge et al. 2021, §5.2 (T_x1 + T_x2 = 2 T_x / s).
    pub(super) fn wait(&self, arc_m: f64, perimeter_m: f64) -> Option<f64> {
        let number = self.parts.iter().position(|part| part.has(arc_m, perimeter_m))?;
        Some((number + 1).max(PARTS - number) as f64 / PARTS as f64)
    }
}

#[cfg(test)]
impl Sector {
    /// Creates a sector in the middle of a pipe, where equal angles are equal arcs.
    pub(super) fn evenly(arc: Arc) -> Self {
        let length_m = arc.length_m / PARTS as f64;
        let part = |k: usize| Arc { from_m: arc.from_m + k as f64 * length_m, length_m };
        Self { parts: core::array::from_fn(part) }
    }
}
