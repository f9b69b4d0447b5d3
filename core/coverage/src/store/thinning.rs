//! Which samples of a full cell need not be kept: those so close to a kept one that it can stand for them.
//!
//! Then a hole is no more than twice that distance smaller than it is found. The fuller a cell, the coarser it gets; the
//! coarsest is a sixteenth of the cell, so that a cell holds some hundreds of samples at most.

use super::open::{CellAt, OpenBricks};

/// Samples that a cell keeps whatever they are; from so many on those closer than this share of a cell's edge to a kept
/// one are left out.
const TIERS: [(u32, f64); 4] = [(64, 1.0 / 128.0), (96, 1.0 / 64.0), (128, 1.0 / 32.0), (160, 1.0 / 16.0)];

/// Samples at the end of a step are kept for so many longer.
const PASSES: u32 = 64;

/// How close a sample that was left out is to a kept one, m, after thinning up to a tier; tier 0 is none.
pub(super) fn delta_m(tier: u8, edge_m: f64) -> f64 {
    let tier = usize::from(tier).checked_sub(1).and_then(|tier| TIERS.get(tier));
    tier.map_or(0.0, |(_, share)| share * edge_m)
}

/// The tier by which a sample need not be kept in its cell.
pub(super) fn stands_for(
    open: &OpenBricks,
    at: CellAt,
    (x_m, arc_m): (f64, f64),
    step_m: Option<[f64; 2]>,
    edge_m: f64,
) -> Option<u8> {
    // A step is a pass: it is left out later, and only where another the same way stands for it.
    let around_m = step_m.map_or(0.0, |[_, around_m]| around_m);
    let count = open.count(at).saturating_sub(if step_m.is_some() { PASSES } else { 0 });
    let tier = TIERS.iter().take_while(|(from, _)| count >= *from).count();
    let tier = u8::try_from(tier).ok().filter(|tier| *tier > 0)?;
    let delta_m = delta_m(tier, edge_m);
    let near = open.in_cell(at).any(|kept| {
        let (dx, darc) = (kept.x_m - x_m, kept.arc_m - arc_m);
        dx * dx + darc * darc <= delta_m * delta_m && (step_m.is_none() || around_m * kept.step_m[1] > 0.0)
    });
    near.then_some(tier)
}
