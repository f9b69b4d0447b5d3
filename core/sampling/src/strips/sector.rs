//! A head's sector on the wall, and how long its places wait between two passes.

use serde::{Deserialize, Serialize};

use super::arc::Arc;
use crate::error::SamplingError;
use crate::occlusion::AngleRange;
use crate::ring::Standing;

/// Parts of equal angle into which a sector is divided: at the ends of each, waits differ by an eighth of a sweep there and back.
pub const PARTS: usize = 8;

/// The wall of a head's sector, in parts of equal angle from one turning point to the other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sector {
    parts: [Arc; PARTS],
}

impl Sector {
    /// The wall that a head sees between two turning points; `angles` in its sensor frame.
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

    /// Its parts.
    pub(super) fn parts(&self) -> impl Iterator<Item = &Arc> {
        self.parts.iter()
    }

    /// The longest wait between two passes over the part that has this place, as a share of a sweep there and back, 0.5 to 1; `None`
    /// outside the sector.
    ///
    /// At a turning point two passes follow one another at once, and the next comes a whole sweep there and back later; in the middle
    /// passes are evenly apart. A circle between two legs of the zigzag is no wider than they are apart where its centre is.
    /// Source: Jorge et al. 2021, §5.2 (T_x1 + T_x2 = 2 T_x / s).
    pub(super) fn wait(&self, arc_m: f64, perimeter_m: f64) -> Option<f64> {
        let number = self.parts.iter().position(|part| part.has(arc_m, perimeter_m))?;
        Some((number + 1).max(PARTS - number) as f64 / PARTS as f64)
    }
}

#[cfg(test)]
impl Sector {
    /// One in the middle of a pipe: equal angles are equal arcs.
    pub(super) fn evenly(arc: Arc) -> Self {
        let length_m = arc.length_m / PARTS as f64;
        let part = |k: usize| Arc { from_m: arc.from_m + k as f64 * length_m, length_m };
        Self { parts: core::array::from_fn(part) }
    }
}
