//! Whether a fail is certain before its hole is: whether an empty circle lies wholly where no sample can come any more.

use super::frontier::Reach;
use super::store::SampleStore;
use crate::math;

/// Places are told apart to this, m; a circle that is only so much larger isn't certain yet.
const FINE_M: f64 = 1e-3;
/// Rectangles that wait to be looked at.
const ROOM: usize = 4096;

#[derive(Debug, Clone, Copy)]
struct Tile {
    x_m: f64,
    sigma_m: f64,
    half_x_m: f64,
    half_sigma_m: f64,
}

/// Looks for certain fails; keeps its working memory.
#[derive(Debug)]
pub struct CertainFinder(Vec<Tile>);

impl Default for CertainFinder {
    fn default() -> Self {
        Self(Vec::with_capacity(ROOM))
    }
}

impl CertainFinder {
    /// Whether a circle of `radius_m` with its centre between two chainages holds no sample and lies outside of `reach`,
    /// where samples may still land.
    ///
    /// g(c), the distance to the nearest sample or to the reach, changes by no more than one moves: as for holes, tiles
    /// whose bound is too small are dropped and the others halved.
    /// Allocates: never.
    pub fn has_circle(
        &mut self,
        store: &SampleStore,
        (from_m, to_m): (f64, f64),
        reach: Option<Reach>,
        radius_m: f64,
    ) -> bool {
        let perimeter_m = store.perimeter_m();
        let half_x_m = (to_m - from_m) / 2.0;
        let count = (math::floor_to_i64(perimeter_m / (2.0 * half_x_m)) + 1).clamp(1, ROOM as i64 / 4);
        let half_sigma_m = perimeter_m / (2 * count) as f64;
        self.0.clear();
        self.0.extend((0..count).map(|k| Tile {
            x_m: from_m + half_x_m,
            sigma_m: (2 * k + 1) as f64 * half_sigma_m,
            half_x_m,
            half_sigma_m,
        }));
        while let Some(tile) = self.0.pop() {
            let half_m = math::hypot(tile.half_x_m, tile.half_sigma_m);
            let clear_m = clear_of(reach, tile.x_m);
            if clear_m + tile.half_x_m < radius_m {
                continue;
            }
            let nearest = store.nearest(tile.x_m, tile.sigma_m, radius_m + half_m);
            let nearest_m = nearest.map_or(f64::INFINITY, |found| math::sqrt(found.distance2()));
            if nearest_m.min(clear_m) > radius_m {
                return true;
            }
            if nearest_m + half_m > radius_m && half_m > FINE_M && self.0.len() + 2 <= ROOM {
                self.halve(tile);
            }
        }
        false
    }

    fn halve(&mut self, tile: Tile) {
        let along_x = tile.half_x_m > tile.half_sigma_m;
        self.0.extend([-0.5, 0.5].map(|side| {
            if along_x {
                Tile { x_m: tile.x_m + side * tile.half_x_m, half_x_m: tile.half_x_m / 2.0, ..tile }
            } else {
                let sigma_m = tile.sigma_m + side * tile.half_sigma_m;
                Tile { sigma_m, half_sigma_m: tile.half_sigma_m / 2.0, ..tile }
            }
        }));
    }
}

/// How far a chainage is from where samples may still land, m.
pub fn clear_of(reach: Option<Reach>, x_m: f64) -> f64 {
    reach.map_or(f64::INFINITY, |reach| (reach.from_m - x_m).max(x_m - reach.to_m).max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coverage::store::{StoreLayout, WallSample};
    use proptest::prelude::*;

    const PERIMETER_M: f64 = 6.0;

    proptest! {
        /// Against looking at every place of a fine grid.
        #[test]
        fn a_circle_is_found_where_there_is_one_and_nowhere_else(
            samples in proptest::collection::vec((0.0f64..4.0, 0.0f64..PERIMETER_M), 0..40),
            reach_m in 1.0f64..4.0,
            radius_m in 0.1f64..1.2,
        ) {
            let layout =
                StoreLayout { perimeter_m: PERIMETER_M, from_m: -2.0, to_m: 6.0, cell_m: 0.3, capacity: 1000 };
            let mut store = SampleStore::new(layout);
            for (x_m, sigma_m) in &samples {
                store.insert(WallSample { x_m: *x_m, sigma_m: *sigma_m, step_from: None }).unwrap();
            }
            let reach = Some(Reach { from_m: reach_m, to_m: 5.0 });
            let clear = |x_m: f64, sigma_m: f64| {
                let nearest = samples.iter().map(|(x, s)| {
                    let around = (s - sigma_m).abs() % PERIMETER_M;
                    math::hypot(x - x_m, around.min(PERIMETER_M - around))
                });
                nearest.fold(f64::INFINITY, f64::min).min(reach_m - x_m)
            };
            let places = (0..=25).flat_map(|i| (0..600).map(move |k| {
                (1.0 + 0.01 * f64::from(i), 0.01 * f64::from(k))
            }));
            let best = places.map(|(x, s)| clear(x, s)).fold(0.0, f64::max);
            let found = CertainFinder::default().has_circle(&store, (1.0, 1.25), reach, radius_m);
            // The grid is 5 mm off a place at most in each direction, and the search a millimetre.
            prop_assert!(!found || best + 0.008 > radius_m, "found {radius_m}, there is {best}");
            prop_assert!(found || best <= radius_m + 0.002, "not found {radius_m}, there is {best}");
        }
    }
}
