//! Early fail of a section, before its hole is final. It requires a large empty circle, all of which lies where no more
//! samples can land.

use super::finder::{HoleFinder, NO_OWNER, Tile, cell_m, first_tiles};
use crate::frontier::{Reach, clear_of};
use crate::store::SampleStore;

/// Resolution of the search, m. A circle that exceeds the required radius by less than this may be missed.
const FINE_M: f64 = 1e-3;

/// Radius that an empty circle must have for an early fail, as a function of the arc length of its centre.
pub struct Needed<'a> {
    /// Required radius at an arc length, m.
    pub radius_m: &'a dyn Fn(f64) -> f64,
    /// Largest required radius at any arc length, m.
    pub most_m: f64,
    /// Largest change of the required radius with arc length, m/m.
    pub slope: f64,
}

impl HoleFinder {
    /// Whether a circle of the required radius, centred between two chainages, is certain to remain empty.
    ///
    /// The circle contains no sample. It lies outside all `reaches`, the stretches where samples may still land or
    /// where some heads have not been. Along the wall, the distance to the nearest sample or reach changes by at most 1
    /// m per metre. As in the search for holes, tiles whose bound is too small are dropped, and the other tiles are
    /// halved.
    ///
    /// Allocates: never, unless a section is over 4,000 cells large.
    pub fn has_circle(
        &mut self,
        store: &SampleStore,
        (from_m, to_m): (f64, f64),
        reaches: [Option<Reach>; 2],
        needed: &Needed<'_>,
    ) -> bool {
        let Needed { most_m, slope, .. } = *needed;
        debug_assert!(most_m > 0.0 && most_m.is_finite(), "a circle has a radius: {most_m} m");
        debug_assert!(slope >= 0.0, "the largest change of a radius isn't negative: {slope}");
        let Self { window, tiles, .. } = self;
        let length_m = to_m - from_m;
        // The largest radius is that at places around the wall. Between them a radius may be slightly larger.
        let around_m = needed.most_m + length_m;
        window.fill((store, 0), from_m, (-around_m, length_m + around_m), cell_m(needed.most_m));
        tiles.clear();
        let perimeter_m = store.perimeter_m();
        tiles.extend(first_tiles(perimeter_m, length_m).map(|tile| Tile { owner: NO_OWNER, ..tile }));
        while let Some(tile) = tiles.pop() {
            let half_m = tile.half_m();
            let clear_m = reaches.map(|reach| clear_of(reach, from_m + tile.x_m));
            let clear_m = clear_m[0].min(clear_m[1]);
            let radius_m = (needed.radius_m)(tile.arc_m);
            let least_m = radius_m - needed.slope * half_m;
            if clear_m + tile.half_x_m < least_m {
                continue;
            }
            let near = tile.near(window, least_m, radius_m + half_m);
            let Some((nearest, nearest_m)) = near.unsettled() else { continue };
            if nearest_m.min(clear_m) > radius_m {
                return true;
            }
            if nearest_m + half_m > least_m && half_m > FINE_M {
                tiles.extend::<[Tile; 2]>(tile.halves_of(nearest.as_ref(), perimeter_m));
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{StoreLayout, WallSample};
    use headrace_geometry::math;
    use proptest::prelude::*;

    const PERIMETER_M: f64 = 6.0;

    proptest! {
        /// The reference is a brute-force search on a fine grid.
        #[test]
        fn circle_is_found_if_and_only_if_brute_force_finds_one(
            samples in proptest::collection::vec((0.0f64..4.0, 0.0f64..PERIMETER_M), 0..40),
            reach_m in 1.0f64..4.0,
            radius_m in 0.1f64..1.2,
            slope in 0.0f64..0.1,
        ) {
            let layout =
                StoreLayout { perimeter_m: PERIMETER_M, from_m: -2.0, to_m: 6.0, cell_m: 0.3, capacity: 1000 };
            let mut store = SampleStore::new(layout);
            for (x_m, arc_m) in &samples {
                store.insert(WallSample { x_m: *x_m, arc_m: *arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
            }
            let reach = Some(Reach { from_m: reach_m, to_m: 5.0 });
            let clear = |x_m: f64, arc_m: f64| {
                let nearest = samples.iter().map(|(x, s)| {
                    let around = (s - arc_m).abs() % PERIMETER_M;
                    math::hypot(x - x_m, around.min(PERIMETER_M - around))
                });
                nearest.fold(f64::INFINITY, f64::min).min(reach_m - x_m)
            };
            // The required radius grows with arc length as far as the opposite side, and then decreases.
            let radius_m = |arc_m: f64| radius_m + slope * arc_m.min(PERIMETER_M - arc_m);
            let places = (0..=25).flat_map(|i| (0..600).map(move |k| {
                (1.0 + 0.01 * f64::from(i), 0.01 * f64::from(k))
            }));
            let best_m = places.map(|(x, s)| clear(x, s) - radius_m(s)).fold(f64::NEG_INFINITY, f64::max);
            let most_m = radius_m(PERIMETER_M / 2.0);
            let needed = Needed { radius_m: &radius_m, most_m, slope };
            let found = HoleFinder::default().has_circle(&store, (1.0, 1.25), [reach, None], &needed);
            // The brute-force grid is wrong by at most 5 mm in each direction, and the search by 1 mm.
            prop_assert!(!found || best_m + 0.009 > 0.0, "a circle is found with a margin of {best_m} m");
            prop_assert!(found || best_m <= 0.0022, "no circle is found with a margin of {best_m} m");
        }
    }
}
