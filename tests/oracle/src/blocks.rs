//! Splits the wall of a long dive into blocks, because a search in a [`Wall`] takes time for every sample of that wall.

use std::cell::RefCell;
use std::collections::BTreeMap;

use super::truth::Truth;
use super::wall::Wall;
use crate::error::TruthError;

/// Length of a block, m. `BEYOND_M` is the length of the overlap that is searched on either side of the block.
const BLOCK_M: f64 = 64.0;
const BEYOND_M: f64 = 32.0;
/// Longest dive that is handled as a single block, m.
const WHOLE_M: f64 = 256.0;

/// The unrolled wall of a dive with its true samples.
pub(crate) struct Blocks {
    /// Whole wall, for a short dive.
    whole: Option<Wall>,
    /// Blocks of a long dive. The key is the block's number. Blocks are built on demand.
    blocks: RefCell<BTreeMap<i64, Wall>>,
}

impl Blocks {
    /// Takes the true samples of a dive. Blocks of a long dive are built on demand.
    ///
    /// Errors: as for [`Wall::new`].
    pub(crate) fn of(truth: &Truth) -> Result<Self, TruthError> {
        let is_long = truth.way_m[1] - truth.way_m[0] > WHOLE_M;
        let whole = if is_long { None } else { Some(truth.wall()?) };
        Ok(Self { whole, blocks: RefCell::default() })
    }

    /// Hole diameter D of a stretch, m. It is infinite if no sample is nearby or a sample is invalid.
    pub(crate) fn hole_m(&self, truth: &Truth, from_m: f64, to_m: f64) -> f64 {
        if let Some(whole) = &self.whole {
            return whole.hole_m(from_m, to_m);
        }
        let number = headrace_geometry::math::floor_to_i64(from_m / BLOCK_M);
        let mut blocks = self.blocks.borrow_mut();
        let wall = blocks.entry(number).or_insert_with(|| {
            let [begins_m, ends_m] = [number, number + 1].map(|k| k as f64 * BLOCK_M);
            let near = (begins_m - BEYOND_M)..(ends_m + BEYOND_M);
            let places =
                truth.samples.iter().map(|sample| sample.place).filter(|[x_m, _]| near.contains(x_m));
            // Building the wall never fails here: `Wall::new` rejects only coordinates that aren't numbers or are far
            // too large. True samples have no such coordinates.
            Wall::new(places, truth.perimeter_m).unwrap_or_default()
        });
        // A circle with a radius of `BEYOND_M` or more may contain samples beyond this block and its overlap. The hole
        // is therefore taken as infinite.
        Some(wall.hole_m(from_m, to_m)).filter(|hole_m| *hole_m < 2.0 * BEYOND_M).unwrap_or(f64::INFINITY)
    }
}
