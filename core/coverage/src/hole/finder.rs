//! The search for the largest hole: tiles, their bounds, and the holes found.

use serde::{Deserialize, Serialize};

use super::division::Division;
use super::window::{Nearest, Window};
use crate::store::SampleStore;
use headrace_geometry::math;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::tunnel::WallPoint;

/// Maximum search radius, m. Wall that is farther than this from every sample counts as not swept by any head.
pub const FARTHEST_M: f64 = 12.0;
/// Half diagonal below which a tile is not halved again, m.
///
/// The bound of such a small tile is within 2e-10 m of the exact value.
const NO_FINER_M: f64 = 1e-10;
/// Upper limit of the rounding error of a computed distance, m.
pub(super) const ROUNDING_M: f64 = 1e-9;
/// Value of `owner` for a tile whose nearest sample isn't known.
pub(super) const NO_OWNER: (f64, f64) = (f64::INFINITY, f64::INFINITY);
/// Rounding tolerance for the proof that the bound at a corner is exact, m.
const PROVEN_M: f64 = 1e-11;

/// The largest empty circle with its centre in a section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Hole {
    /// Diameter of the largest empty circle found among the stored samples, m.
    pub diameter_m: f64,
    /// Lower bound of the hole's exact diameter, m: `diameter_m` less the possible effect of thinned and moved samples.
    pub least_m: f64,
    /// Upper bound of the hole's exact diameter, m. Infinite if the hole is not `bounded`.
    pub most_m: f64,
    /// Chainage of the circle's centre, m.
    pub x_m: f64,
    /// Arc length of the circle's centre, m.
    pub arc_m: f64,
    /// Whether there are samples around the hole.
    ///
    /// Without them, its exact diameter is at least `diameter_m`.
    pub bounded: bool,
}

impl Hole {
    /// Whether the bounds enclose the diameter, and the upper bound is finite exactly if the hole is bounded.
    pub fn is_consistent(&self) -> bool {
        let Self { diameter_m, least_m, most_m, x_m, arc_m, bounded } = *self;
        let are_bounds = 0.0 <= least_m && least_m <= diameter_m && diameter_m <= most_m;
        are_bounds
            && diameter_m.is_finite()
            && most_m.is_finite() == bounded
            && x_m.is_finite()
            && arc_m >= 0.0
    }

    /// Whether two holes differ by at most a centimetre in size and place.
    pub fn is_like(&self, other: &Self) -> bool {
        const LITTLE_M: f64 = 0.01;
        let grown_m = (self.diameter_m - other.diameter_m).abs();
        let moved_m = (self.x_m - other.x_m).abs().max((self.arc_m - other.arc_m).abs());
        grown_m <= LITTLE_M && moved_m <= LITTLE_M && self.bounded == other.bounded
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Tile {
    /// Centre of the tile, m. Its chainage is relative to the start of the section.
    pub(super) x_m: f64,
    pub(super) arc_m: f64,
    pub(super) half_x_m: f64,
    pub(super) half_arc_m: f64,
    /// Sample nearest to the tile's centre, relative to the centre, m.
    ///
    /// A search for an empty circle of given size stores any nearby sample here instead: its chainage from the start of
    /// the section, and its arc length.
    pub(super) owner: (f64, f64),
    /// Upper bound of the distance from a point of the tile to the nearest sample, m.
    pub(super) bound_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Best {
    distance_m: f64,
    at: WallPoint,
    /// Largest upper bound of a dropped tile, m.
    dropped_m: f64,
}

/// A point without a sample within the search radius.
#[derive(Debug, Clone, Copy)]
struct Beyond(WallPoint);

/// Result of searching for a sample near the centre of a tile.
pub(super) enum Near {
    /// No empty circle has its centre in the tile, because one sample is within the radius of all its points.
    Settled,
    /// The sample nearest to the centre, or any sample that is near enough.
    Sample(Nearest),
    /// No sample within the search radius.
    Nothing,
}

impl Near {
    /// Returns the sample and its distance, m; `None` for [`Near::Settled`].
    pub(super) fn unsettled(self) -> Option<(Option<Nearest>, f64)> {
        match self {
            Self::Settled => None,
            Self::Sample(found) => Some((Some(found), math::sqrt(found.distance2))),
            Self::Nothing => Some((None, f64::INFINITY)),
        }
    }
}

impl Tile {
    /// Centre of the tile. Its chainage is relative to the start of the section.
    pub(super) fn centre(&self) -> WallPoint {
        WallPoint { x_m: self.x_m, arc_m: self.arc_m }
    }

    /// Half diagonal of the tile, m.
    pub(super) fn half_m(&self) -> f64 {
        math::sqrt(self.half_x_m * self.half_x_m + self.half_arc_m * self.half_arc_m)
    }

    /// Both halves of the tile, cut across its longer side.
    fn halves(&self) -> [Self; 2] {
        let along_x = self.half_x_m > self.half_arc_m;
        [-0.5, 0.5].map(|side| {
            if along_x {
                Self { x_m: self.x_m + side * self.half_x_m, half_x_m: self.half_x_m / 2.0, ..*self }
            } else {
                let arc_m = self.arc_m + side * self.half_arc_m;
                Self { arc_m, half_arc_m: self.half_arc_m / 2.0, ..*self }
            }
        })
    }

    /// Searches for a sample near the tile's centre.
    ///
    /// No search is needed if `owner` is a known sample within the radius of all points of the tile. Otherwise, returns
    /// any sample that is near enough, or else the nearest one.
    pub(super) fn near(&self, window: &Window, radius_m: f64, within_m: f64) -> Near {
        // The margins are larger than the rounding errors of the distances.
        let enough_m = radius_m - self.half_m() - ROUNDING_M;
        let (dx, darc) = (self.owner.0 - self.x_m, self.owner.1 - self.arc_m);
        let owner_m = math::sqrt(dx * dx + darc * darc);
        if owner_m <= enough_m {
            return Near::Settled;
        }
        let within_m = within_m.min(owner_m + ROUNDING_M);
        window.near_enough(self.centre(), within_m, enough_m).map_or(Near::Nothing, Near::Sample)
    }

    /// Returns the halves of a tile. Their `owner` becomes the nearest sample, if one was found.
    pub(super) fn halves_of(mut self, nearest: Option<&Nearest>, perimeter_m: f64) -> [Self; 2] {
        if let Some(found) = nearest {
            self.owner = (found.x_m, found.arc_m + found.turns * perimeter_m);
        }
        self.halves()
    }

    /// Returns a sample's position relative to the tile's centre.
    ///
    /// The bits of the result do not depend on the point from which the search has found the sample.
    fn relative(&self, found: &Nearest, perimeter_m: f64) -> (f64, f64) {
        (found.x_m - self.x_m, (found.arc_m - self.arc_m) + found.turns * perimeter_m)
    }
}

/// Covers a section with roughly square tiles.
pub(super) fn first_tiles(perimeter_m: f64, length_m: f64) -> impl Iterator<Item = Tile> {
    let half_x_m = length_m / 2.0;
    let count = math::floor_to_i64(perimeter_m / length_m).clamp(1, 8192) + 1;
    let half_arc_m = perimeter_m / (2 * count) as f64;
    (0..count).map(move |k| Tile {
        x_m: half_x_m,
        arc_m: (2 * k + 1) as f64 * half_arc_m,
        half_x_m,
        half_arc_m,
        owner: (0.0, 0.0),
        bound_m: f64::INFINITY,
    })
}

/// Finds the largest hole of a stretch of wall. All searches share its working memory.
#[derive(Debug)]
pub struct HoleFinder {
    tolerance_m: f64,
    /// Radius of the previous hole, m, as the first guess for the next search.
    last_m: f64,
    /// Largest radius of circles that can be searched on the latest layout of the changed wall, m.
    pub(super) laid_m: f64,
    pub(super) window: Window,
    pub(super) tiles: Vec<Tile>,
    division: Division,
}

impl Default for HoleFinder {
    fn default() -> Self {
        Self::new(0.0)
    }
}

stateful!(HoleFinder { state: last_m; fixed: tolerance_m, laid_m, window, tiles, division; });

impl HoleFinder {
    /// Creates a finder that measures hole diameters with a tolerance, m. Zero means an exact search.
    ///
    /// Allocates: at startup, all memory that it will ever use.
    pub fn new(tolerance_m: f64) -> Self {
        Self {
            tolerance_m,
            last_m: 0.0,
            laid_m: 0.0,
            window: Window::default(),
            tiles: Vec::with_capacity(16_384),
            division: Division::default(),
        }
    }

    /// Returns the largest hole whose centre has a chainage in [`from_m`, `to_m`].
    ///
    /// Allocates: never, unless a section is over 4,000 cells large.
    pub fn largest(&mut self, store: &SampleStore, from_m: f64, to_m: f64) -> Hole {
        self.largest_since(store, from_m, to_m, 0)
    }

    /// Returns the largest hole among the samples of visits from `first_visit` on.
    ///
    /// Its `least_m` is then no lower bound, because a full cell does not store a sample near a sample of an earlier
    /// visit.
    ///
    /// Allocates: never, unless a section is over 4,000 cells large.
    pub fn largest_since(&mut self, store: &SampleStore, from_m: f64, to_m: f64, first_visit: u32) -> Hole {
        debug_assert!(from_m < to_m, "a section has a length: {from_m} to {to_m} m");
        let length_m = to_m - from_m;
        let mut reach_m = (1.25 * self.last_m + 0.1).min(FARTHEST_M);
        loop {
            let stretch_m = (-reach_m, length_m + reach_m);
            self.window.fill((store, first_visit), from_m, stretch_m, cell_m(reach_m));
            match self.search(length_m, reach_m) {
                Ok(best) => {
                    self.last_m = best.distance_m;
                    return self.bounded(store, &best, length_m);
                }
                Err(beyond) if reach_m >= FARTHEST_M => return unbounded(&self.window, &beyond),
                Err(_) => reach_m = (2.0 * reach_m + 0.5).min(FARTHEST_M),
            }
        }
    }

    /// Returns the point farthest from all samples.
    ///
    /// Errors: a point has no sample within `reach_m`.
    fn search(&mut self, length_m: f64, reach_m: f64) -> Result<Best, Beyond> {
        let mut best = Best { distance_m: 0.0, at: WallPoint::default(), dropped_m: 0.0 };
        self.tiles.clear();
        // A good first guess at the hole saves most of the work. So the centres of all tiles are evaluated before any
        // tile is divided, and the tile with the largest bound is divided first.
        let mut within_m = reach_m;
        for tile in first_tiles(self.window.perimeter_m(), length_m) {
            let tile = looked_at(&self.window, tile, within_m.min(reach_m), &mut best)?;
            // The next tile's centre is one tile edge away. The distance from it to the nearest sample is at most
            // longer by this edge, which limits the radius of the next search.
            within_m = math::hypot(tile.owner.0, tile.owner.1) + 2.0 * tile.half_arc_m + 1e-6;
            self.tiles.push(tile);
        }
        self.tiles.sort_unstable_by(|a, b| a.bound_m.total_cmp(&b.bound_m));
        while let Some(tile) = self.tiles.pop() {
            if self.is_settled(&tile, reach_m, &mut best)? {
                continue;
            }
            for part in tile.halves() {
                let part = looked_at(&self.window, part, reach_m, &mut best)?;
                self.tiles.push(part);
            }
        }
        Ok(best)
    }

    /// Divides a tile among samples until none of its points can be clearly farther from all samples than the best
    /// point.
    ///
    /// Returns false if the tile must be halved first.
    fn is_settled(&mut self, tile: &Tile, reach_m: f64, best: &mut Best) -> Result<bool, Beyond> {
        let enough = |best: &Best| best.distance_m + self.tolerance_m / 2.0;
        if tile.bound_m <= enough(best) || tile.half_m() < NO_FINER_M {
            best.dropped_m = best.dropped_m.max(tile.bound_m);
            return Ok(true);
        }
        self.division.begin((tile.half_x_m, tile.half_arc_m), tile.owner);
        while let Some(worst) = self.division.worst() {
            let bound_m = math::sqrt(worst.farthest2);
            if bound_m <= enough(best) {
                best.dropped_m = best.dropped_m.max(bound_m);
                return Ok(true);
            }
            let x_m = tile.x_m + (worst.owner.0 + worst.farthest.0);
            let arc_m = tile.arc_m + (worst.owner.1 + worst.farthest.1);
            let corner = WallPoint { x_m, arc_m };
            let Some(found) = self.window.nearest(corner, bound_m.min(reach_m)) else {
                if bound_m > reach_m {
                    return Err(Beyond(corner));
                }
                // Apart from rounding, the owner of the share is the sample nearest to the farthest corner.
                best.take(bound_m, corner);
                return Ok(true);
            };
            let distance_m = math::sqrt(found.distance2);
            best.take(distance_m, corner);
            if distance_m >= bound_m - PROVEN_M {
                best.dropped_m = best.dropped_m.max(bound_m);
                return Ok(true);
            }
            if !self.division.add(tile.relative(&found, self.window.perimeter_m())) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn bounded(&self, store: &SampleStore, best: &Best, length_m: f64) -> Hole {
        let radius_m = best.distance_m.max(best.dropped_m);
        let from_m = self.window.chainage_m(-radius_m);
        let fidelity = store.fidelity(from_m, self.window.chainage_m(length_m + radius_m));
        let diameter_m = 2.0 * best.distance_m;
        // A full window has dropped samples, which could reduce the diameter. Then the diameter's lower bound is zero.
        let least_m = diameter_m - 2.0 * (fidelity.thinned_m + fidelity.moved_m);
        let hole = Hole {
            diameter_m,
            least_m: if self.window.overfull { 0.0 } else { least_m.max(0.0) },
            most_m: 2.0 * (radius_m + fidelity.moved_m),
            x_m: self.window.chainage_m(best.at.x_m),
            arc_m: math::wrap(best.at.arc_m, self.window.perimeter_m()),
            bounded: true,
        };
        debug_assert!(hole.is_consistent(), "bounds enclose the diameter: {hole:?}");
        debug_assert!(best.is_within(length_m), "a hole is centred in a section of {length_m} m: {best:?}");
        hole
    }
}

impl Best {
    /// Whether the best point lies in a section of this length, with a sample within the search radius.
    fn is_within(&self, length_m: f64) -> bool {
        let is_inside = (-ROUNDING_M..=length_m + ROUNDING_M).contains(&self.at.x_m);
        is_inside && (0.0..=FARTHEST_M + ROUNDING_M).contains(&self.distance_m)
    }

    fn take(&mut self, distance_m: f64, at: WallPoint) {
        if distance_m > self.distance_m {
            *self = Self { distance_m, at, ..*self };
        }
    }
}

/// Evaluates a tile's centre: sets the tile's owner and bound, and updates the best point.
fn looked_at(window: &Window, tile: Tile, within_m: f64, best: &mut Best) -> Result<Tile, Beyond> {
    let found = window.nearest(tile.centre(), within_m).ok_or(Beyond(tile.centre()))?;
    best.take(math::sqrt(found.distance2), tile.centre());
    let owner = tile.relative(&found, window.perimeter_m());
    let (dx, darc) = (owner.0.abs() + tile.half_x_m, owner.1.abs() + tile.half_arc_m);
    let bound_m = tile.bound_m.min(math::sqrt(dx * dx + darc * darc));
    Ok(Tile { owner, bound_m, ..tile })
}

/// Cell size that suits a search radius, m.
pub(super) fn cell_m(reach_m: f64) -> f64 {
    (reach_m / 3.0).clamp(0.05, 0.5)
}

fn unbounded(window: &Window, Beyond(at): &Beyond) -> Hole {
    let diameter_m = 2.0 * FARTHEST_M;
    Hole {
        diameter_m,
        least_m: diameter_m,
        most_m: f64::INFINITY,
        x_m: window.chainage_m(at.x_m),
        arc_m: math::wrap(at.arc_m, window.perimeter_m()),
        bounded: false,
    }
}

#[cfg(test)]
mod tests;
