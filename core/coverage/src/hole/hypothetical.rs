//! Hypothetical holes on a changed wall.
//!
//! Missing samples are put back, the wall is compressed or stretched, or stretches count as covered.

use super::finder::{HoleFinder, NO_OWNER, ROUNDING_M, Tile, cell_m, first_tiles};
use crate::frontier::Reach;
use crate::store::SampleStore;
use headrace_geometry::tunnel::WallPoint;

/// Search resolution as a share of the required radius. A circle that exceeds this radius by a smaller share may be
/// missed.
const FINE: f64 = 0.01;

/// Hypothetical changes to the wall.
#[derive(Debug, Clone, Copy)]
pub struct WallChanges {
    /// Factor by which distances along the tunnel are multiplied, above 0. A factor above 1 stretches the wall.
    pub along: f64,
    /// Factor by which distances around the perimeter are multiplied.
    pub around: f64,
    /// Stretches whose wall counts as covered.
    pub covered: [Option<Reach>; 4],
    /// Stretch where samples may still land.
    ///
    /// The wall in it is taken as the mirror image of the wall outside.
    pub to_come: Option<Reach>,
}

impl WallChanges {
    /// Wall without any change.
    pub const NOTHING: Self = Self { along: 1.0, around: 1.0, covered: [None; 4], to_come: None };

    /// Distance from a chainage to the nearest stretch that is covered or where samples may still land, m.
    fn clear_m(&self, x_m: f64) -> f64 {
        let off_m = |reach: &Reach| (reach.from_m - x_m).max(x_m - reach.to_m).max(0.0);
        let covered_m = self.covered.iter().flatten().map(off_m).fold(f64::INFINITY, f64::min) * self.along;
        self.to_come.as_ref().map(off_m).map_or(covered_m, |to_come_m| covered_m.min(to_come_m))
    }

    /// Chainage at which the wall is mirrored, m: the finite end of the stretch where samples may still land.
    fn mirror_m(&self) -> Option<f64> {
        self.to_come.iter().flat_map(|reach| [reach.from_m, reach.to_m]).find(|x_m| x_m.is_finite())
    }
}

/// Returns a stretch and its mirror image, in ascending order.
///
/// They are joined if they meet. A gap between them belongs to neither.
fn with_mirrored([from_m, to_m]: [f64; 2], mirror_m: f64) -> [Option<[f64; 2]>; 2] {
    let image_m = [2.0 * mirror_m - to_m, 2.0 * mirror_m - from_m];
    if image_m[0] > to_m {
        return [Some([from_m, to_m]), Some(image_m)];
    }
    if image_m[1] < from_m {
        return [Some(image_m), Some([from_m, to_m])];
    }
    [Some([from_m.min(image_m[0]), to_m.max(image_m[1])]), None]
}

impl HoleFinder {
    /// Lays out the wall with the changes in `otherwise` and the additional samples `more`.
    ///
    /// The layout suffices for circles of up to `radius_m` centred between the two chainages. Stored samples of visits
    /// before `first_visit` are ignored.
    ///
    /// Allocates: never.
    pub fn lay_otherwise(
        &mut self,
        (store, first_visit): (&SampleStore, u32),
        (from_m, to_m): (f64, f64),
        radius_m: f64,
        otherwise: &WallChanges,
        more: impl Iterator<Item = WallPoint>,
    ) {
        self.laid_m = radius_m;
        let window = &mut self.window;
        let WallChanges { along, around, .. } = *otherwise;
        debug_assert!(
            along > 0.0 && around > 0.0,
            "the wall is scaled by positive factors: {along}, {around}"
        );
        let length_m = (to_m - from_m) * along;
        let perimeter_m = store.perimeter_m() * around;
        let reach_m = radius_m + ROUNDING_M;
        window.begin(perimeter_m, from_m, (-reach_m, length_m + reach_m), cell_m(radius_m));
        let mirror_m = otherwise.mirror_m();
        let mut take = |WallPoint { x_m, arc_m }: WallPoint| {
            window.push(WallPoint { x_m: (x_m - from_m) * along, arc_m: arc_m * around });
            if let Some(mirror_m) = mirror_m {
                let x_m = (2.0 * mirror_m - x_m - from_m) * along;
                window.push(WallPoint { x_m, arc_m: arc_m * around });
            }
        };
        let ends_m = [from_m - reach_m / along, to_m + reach_m / along];
        let stretches_m = mirror_m.map_or([Some(ends_m), None], |mirror_m| with_mirrored(ends_m, mirror_m));
        for [least_m, most_m] in stretches_m.into_iter().flatten() {
            store.each_between(least_m, most_m, |at, visit| {
                if visit >= first_visit {
                    take(at);
                }
            });
        }
        more.for_each(take);
        window.sort();
    }

    /// Whether a circle of `radius_m` centred between two chainages contains no sample.
    ///
    /// Call [`lay_otherwise`](Self::lay_otherwise) first, with at least this radius. A layout for a smaller radius
    /// lacks samples near the circle.
    ///
    /// Allocates: never, unless a section is over 4,000 cells large.
    pub fn has_circle_otherwise(
        &mut self,
        (from_m, to_m): (f64, f64),
        radius_m: f64,
        otherwise: &WallChanges,
    ) -> bool {
        debug_assert!(radius_m <= self.laid_m, "the wall is laid out for {} m: {radius_m} m", self.laid_m);
        let Self { window, tiles, .. } = self;
        let (length_m, perimeter_m) = ((to_m - from_m) * otherwise.along, window.perimeter_m());
        tiles.clear();
        tiles.extend(first_tiles(perimeter_m, length_m).map(|tile| Tile { owner: NO_OWNER, ..tile }));
        while let Some(tile) = tiles.pop() {
            let half_m = tile.half_m();
            let near = tile.near(window, radius_m, radius_m + half_m);
            let Some((nearest, near_m)) = near.unsettled() else { continue };
            let nearest_m = near_m.min(otherwise.clear_m(from_m + tile.x_m / otherwise.along));
            if nearest_m > radius_m {
                return true;
            }
            if nearest_m + half_m > radius_m && half_m > FINE * radius_m {
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

    /// Whether there is an empty circle on a wall of 10 m perimeter with these changes.
    ///
    /// The wall has samples every 0.5 m along and around, where `is_in` is true.
    fn has(
        is_in: impl Fn(u32, u32) -> bool,
        radius_m: f64,
        otherwise: &WallChanges,
        more: &[WallPoint],
    ) -> bool {
        let layout = StoreLayout { perimeter_m: 10.0, from_m: 0.0, to_m: 10.0, cell_m: 0.25, capacity: 1000 };
        let mut store = SampleStore::new(layout);
        for (i, k) in (0..20).flat_map(|i| (0..20).map(move |k| (i, k))).filter(|(i, k)| is_in(*i, *k)) {
            let (x_m, arc_m) = (0.5 * f64::from(i), 0.5 * f64::from(k));
            store.insert(WallSample { x_m, arc_m, head: 0, step_m: None, visit: 0 }).unwrap();
        }
        let more = more.iter().copied();
        let (mut finder, between_m) = (HoleFinder::default(), (5.0, 5.5));
        finder.lay_otherwise((&store, 0), between_m, 1.2 * radius_m, otherwise, more);
        finder.has_circle_otherwise(between_m, radius_m, otherwise)
    }

    #[test]
    fn hypothetically_added_samples_fill_the_hole() {
        let gone = |i: u32, k: u32| !(i == 10 && k == 4);
        let hole_m = 0.5;
        assert!(has(gone, 0.99 * hole_m, &WallChanges::NOTHING, &[]));
        assert!(!has(gone, 1.03 * hole_m, &WallChanges::NOTHING, &[]));
        assert!(!has(gone, 0.99 * hole_m, &WallChanges::NOTHING, &[WallPoint { x_m: 5.0, arc_m: 2.0 }]));
    }

    #[test]
    fn hypothetically_compressed_wall_has_smaller_holes() {
        let all = |_, _| true;
        // The hole's radius is half the diagonal of a mesh. The mesh is 0.5 by 0.5 m, or 0.25 by 0.5 m.
        for (otherwise, radius_m) in [
            (WallChanges::NOTHING, 0.3535),
            (WallChanges { along: 0.5, ..WallChanges::NOTHING }, 0.2795),
            (WallChanges { around: 0.5, ..WallChanges::NOTHING }, 0.2795),
        ] {
            assert!(has(all, 0.98 * radius_m, &otherwise, &[]), "{otherwise:?}");
            assert!(!has(all, 1.03 * radius_m, &otherwise, &[]), "{otherwise:?}");
        }
    }

    /// A stretch of 2.5 m without samples is compressed to 0.75 m.
    ///
    /// After that, the samples on both of its sides bound the hole.
    #[test]
    fn search_on_compressed_wall_includes_samples_from_farther_away() {
        let sides = |i: u32, _| i <= 8 || i >= 13;
        let otherwise = WallChanges { along: 0.3, ..WallChanges::NOTHING };
        assert!(has(sides, 0.44, &otherwise, &[]));
        assert!(!has(sides, 0.47, &otherwise, &[]));
    }

    #[test]
    fn wall_is_mirrored_into_the_stretch_not_yet_sampled() {
        // Without mirroring, a circle at the end of the samples extends ahead on the compressed wall, to where no
        // sample has landed yet.
        let ends = |i: u32, _| i <= 10;
        let otherwise = WallChanges { along: 0.3, ..WallChanges::NOTHING };
        let to_come = Some(Reach { from_m: 5.25, to_m: f64::INFINITY });
        assert!(has(ends, 0.275, &otherwise, &[]));
        assert!(!has(ends, 0.275, &WallChanges { to_come, ..otherwise }, &[]));
        // A strip that no head sees remains a hole.
        let strip = |i: u32, k: u32| i <= 11 && k != 4;
        let to_come = Some(Reach { from_m: 6.0, to_m: f64::INFINITY });
        assert!(has(strip, 0.4, &WallChanges { to_come, ..otherwise }, &[]));
    }

    #[test]
    fn stretch_joins_its_mirror_image_only_if_they_touch_or_overlap() {
        let same = |found: [Option<[f64; 2]>; 2], expected: &[[f64; 2]]| {
            assert_eq!(found.into_iter().flatten().collect::<Vec<_>>(), expected);
        };
        same(with_mirrored([10.0, 12.0], 100.0), &[[10.0, 12.0], [188.0, 190.0]]);
        same(with_mirrored([10.0, 12.0], 5.0), &[[-2.0, 0.0], [10.0, 12.0]]);
        same(with_mirrored([10.0, 12.0], 11.5), &[[10.0, 13.0]]);
        same(with_mirrored([10.0, 12.0], 12.0), &[[10.0, 14.0]]);
    }

    #[test]
    fn no_hole_is_found_in_a_stretch_counted_as_covered() {
        let behind = |i: u32, _| i <= 9;
        assert!(has(behind, 0.4, &WallChanges::NOTHING, &[]));
        let ahead = Some(Reach { from_m: 4.7, to_m: f64::INFINITY });
        assert!(!has(
            behind,
            0.4,
            &WallChanges { covered: [None, ahead, None, None], ..WallChanges::NOTHING },
            &[]
        ));
    }
}
