//! A second computation of the true hole D_true, which bounds the error of the first one.
//!
//! It uses no Voronoi vertices. For one chainage at a time, it finds the highest point of the lower envelope of
//! distances to all samples. If the centre of a circle moves, the circle's radius grows by at most the movement. A
//! stretch of chainage that can't hold a larger circle than the largest one found so far is therefore dropped. All
//! other stretches are halved.

use super::truth::Truth;
use super::wall::Wall;
use crate::error::TruthError;

/// Stretches of chainage whose half length is at most this aren't halved again, m.
const FINEST_M: f64 = 2e-10;

/// Hole diameter D of a stretch between two chainages, computed from envelopes alone, m. It is exact to 0.5 nm, and
/// infinite without samples.
pub fn hole_m(wall: &Wall, from_m: f64, to_m: f64) -> f64 {
    let radius_m = |x_m: f64| wall.largest_on(x_m).map_or(f64::INFINITY, |circle| circle.radius_m);
    let mut best_m = radius_m(from_m).max(radius_m(to_m));
    // Middle and half length of each stretch that may hold a circle larger than the largest one found so far.
    let mut stretches = vec![(f64::midpoint(from_m, to_m), (to_m - from_m) / 2.0)];
    while let Some((middle_m, half_m)) = stretches.pop() {
        let found_m = radius_m(middle_m);
        best_m = best_m.max(found_m);
        if found_m + half_m > best_m + FINEST_M && half_m > FINEST_M {
            let half_m = half_m / 2.0;
            stretches.extend([(middle_m - half_m, half_m), (middle_m + half_m, half_m)]);
        }
    }
    2.0 * best_m
}

/// Bound on the error of the true holes D_true in a dive, m.
///
/// This bound is the sum of two parts. The first part is the largest difference between the two computations of D_true
/// in `stretches` stretches of length `stretch_m`. The second part is the error that the arc lengths of two samples may
/// add.
///
/// Errors: as for [`Wall::new`].
pub fn may_be_off_m(
    truth: &Truth,
    [from_m, to_m]: [f64; 2],
    stretch_m: f64,
    stretches: u32,
) -> Result<f64, TruthError> {
    let wall = truth.wall()?;
    let mut largest_m = 0.0_f64;
    for k in 0..stretches {
        let share = (f64::from(k) + 0.5) / f64::from(stretches);
        let begin_m = from_m + share * (to_m - stretch_m - from_m).max(0.0);
        let end_m = begin_m + stretch_m;
        let one_m = wall.hole_m(begin_m, end_m);
        if !one_m.is_finite() {
            continue;
        }
        // Samples whose distance from the stretch is larger than the hole's diameter can't touch the hole's circle.
        let near = |x_m: f64| x_m >= begin_m - one_m && x_m <= end_m + one_m;
        let places = truth.samples.iter().map(|sample| sample.place).filter(|place| near(place[0]));
        let other_m = hole_m(&Wall::new(places, truth.perimeter_m)?, begin_m, end_m);
        largest_m = largest_m.max((one_m - other_m).abs());
    }
    Ok(largest_m + 2.0 * truth.arc_off_m)
}
