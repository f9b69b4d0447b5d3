//! Thinning of full cells. A sample is dropped if a stored sample is within a small distance.
//!
//! Thinning enlarges a hole by at most twice this distance. The distance grows while a cell fills, up to a sixteenth of
//! the cell's edge. So a cell contains at most some hundreds of samples.

use super::open::{CellAt, OpenBricks};

/// Thinning tiers: a number of samples in the cell, and a share of the cell's edge.
///
/// A tier applies from its number of samples on. Then a sample is dropped if a stored sample is nearer than the tier's
/// share of the edge.
const TIERS: [(u32, f64); 4] = [(64, 1.0 / 128.0), (96, 1.0 / 64.0), (128, 1.0 / 32.0), (160, 1.0 / 16.0)];

/// A sample at the end of a step is dropped only if its cell contains this many samples more than the tier requires.
const PASSES: u32 = 64;

/// Maximum distance of a dropped sample from the nearest stored sample, after thinning up to a tier, m. Zero for tier
/// 0, which drops none.
pub(super) fn delta_m(tier: u8, edge_m: f64) -> f64 {
    let tier = usize::from(tier).checked_sub(1).and_then(|tier| TIERS.get(tier));
    tier.map_or(0.0, |(_, share)| share * edge_m)
}

/// Returns the tier by which a sample is dropped from its cell. `None` if it must be stored.
pub(super) fn dropping_tier(
    open: &OpenBricks,
    at: CellAt,
    (x_m, arc_m): (f64, f64),
    step_m: Option<[f64; 2]>,
    edge_m: f64,
) -> Option<u8> {
    // A sample at the end of a step marks a pass. So it is dropped later than other samples, and only if a nearby step
    // in the same direction represents it.
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
