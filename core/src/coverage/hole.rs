//! The largest hole of a section: the largest empty circle on the unrolled wall with its centre in the section.
//!
//! Let f(c) be the distance from a place c to the nearest sample. D = 2 max f over the section (metrics.md). f changes
//! by no more than one moves, so that a rectangle with half diagonal h about c holds nothing above f(c) + h. Rectangles
//! that can't beat the best place found are dropped, the others halved. Once only a few samples can own a place of a
//! rectangle, it is divided among them exactly: each owner's share is the rectangle clipped by its bisectors with the
//! others, a convex polygon on which the distance to the owner is largest at a corner. What the clipping gives is exact
//! but for rounding; nothing depends on a triangulation, so that lattices, lines and repeated samples need no care.

use super::store::{Found, SampleIndex, SampleStore};
use crate::math;

/// A place is looked for no farther than this from its nearest sample, m; beyond, the wall counts as not passed.
pub const FARTHEST_M: f64 = 12.0;
/// Half diagonal below which a rectangle needs no exact division: its bound is within 2e-10 m of the truth.
const NO_FINER_M: f64 = 1e-10;
/// The most samples among which a rectangle is divided exactly.
const MAX_OWNERS: usize = 48;

/// The largest empty circle with its centre in a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hole {
    /// Its diameter D, m. When `bounded` is false the hole is at least this large.
    pub diameter_m: f64,
    /// Chainage of its centre, m.
    pub x_m: f64,
    /// Arc length of its centre, m.
    pub sigma_m: f64,
    /// Whether there are samples around it.
    pub bounded: bool,
}

#[derive(Debug, Clone, Copy)]
struct Tile {
    x_m: f64,
    sigma_m: f64,
    half_x_m: f64,
    half_sigma_m: f64,
    /// No place in the tile is farther than this from its nearest sample.
    bound_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Best {
    distance_m: f64,
    x_m: f64,
    sigma_m: f64,
}

impl Tile {
    /// Distance from the centre to a corner.
    fn half_m(&self) -> f64 {
        math::sqrt(self.half_x_m * self.half_x_m + self.half_sigma_m * self.half_sigma_m)
    }

    /// The tile cut across its longer side.
    fn halves(&self) -> [Self; 2] {
        let along_x = self.half_x_m > self.half_sigma_m;
        [-0.5, 0.5].map(|side| {
            if along_x {
                Self { x_m: self.x_m + side * self.half_x_m, half_x_m: self.half_x_m / 2.0, ..*self }
            } else {
                let sigma_m = self.sigma_m + side * self.half_sigma_m;
                Self { sigma_m, half_sigma_m: self.half_sigma_m / 2.0, ..*self }
            }
        })
    }
}

/// Covers a section with about square tiles.
fn first_tiles(perimeter_m: f64, from_m: f64, to_m: f64) -> impl Iterator<Item = Tile> {
    let half_x_m = (to_m - from_m) / 2.0;
    let count = math::floor_to_i64(perimeter_m / (2.0 * half_x_m)).clamp(1, 8192) + 1;
    let half_sigma_m = perimeter_m / (2 * count) as f64;
    (0..count).map(move |k| Tile {
        x_m: from_m + half_x_m,
        sigma_m: (2 * k + 1) as f64 * half_sigma_m,
        half_x_m,
        half_sigma_m,
        bound_m: f64::INFINITY,
    })
}

/// The tile with its bound by the distance of its middle, which may be the best place so far; `None` where no sample is
/// in reach.
fn looked_at(store: &SampleStore, tile: Tile, as_of: SampleIndex, best: &mut Best) -> Option<Tile> {
    let nearest = store.nearest(tile.x_m, tile.sigma_m, tile.bound_m.min(FARTHEST_M), as_of)?;
    let distance_m = math::sqrt(nearest.distance2());
    if distance_m > best.distance_m {
        *best = Best { distance_m, x_m: tile.x_m, sigma_m: tile.sigma_m };
    }
    Some(Tile { bound_m: tile.bound_m.min(distance_m + tile.half_m()), ..tile })
}

fn unbounded(tile: &Tile, perimeter_m: f64) -> Hole {
    Hole {
        diameter_m: 2.0 * FARTHEST_M,
        x_m: tile.x_m,
        sigma_m: math::wrap(tile.sigma_m, perimeter_m),
        bounded: false,
    }
}

/// Finds the largest hole of a stretch of wall; keeps its working memory from one search to the next.
#[derive(Debug)]
pub struct HoleFinder {
    tiles: Vec<Tile>,
    owners: Vec<Found>,
    share: Polygon,
}

impl Default for HoleFinder {
    fn default() -> Self {
        Self {
            tiles: Vec::with_capacity(16_384),
            owners: Vec::with_capacity(MAX_OWNERS),
            share: Polygon::with_capacity(MAX_OWNERS + 4),
        }
    }
}

impl HoleFinder {
    /// The largest hole whose centre has a chainage in [`from_m`, `to_m`], as of a moment.
    ///
    /// Allocates: never, unless a section is over 4,000 cells large.
    pub fn largest(&mut self, store: &SampleStore, from_m: f64, to_m: f64, as_of: SampleIndex) -> Hole {
        let mut best = Best { distance_m: 0.0, x_m: from_m, sigma_m: 0.0 };
        self.tiles.clear();
        // A good first guess spares most of the work: every tile's middle is looked at before any is divided, and the
        // most promising is divided first.
        for tile in first_tiles(store.perimeter_m(), from_m, to_m) {
            match looked_at(store, tile, as_of, &mut best) {
                Some(tile) => self.tiles.push(tile),
                None => return unbounded(&tile, store.perimeter_m()),
            }
        }
        self.tiles.sort_unstable_by(|a, b| a.bound_m.total_cmp(&b.bound_m));
        while let Some(tile) = self.tiles.pop() {
            let half_m = tile.half_m();
            if tile.bound_m <= best.distance_m || half_m < NO_FINER_M {
                continue;
            }
            // Worth dividing exactly only when the tile is small beside its distance from the samples.
            let small = half_m < 0.6 * (tile.bound_m - half_m);
            if small && self.find_owners(store, &tile, tile.bound_m + half_m, as_of) {
                if self.reach_m(&tile) > best.distance_m {
                    self.divide(&tile, &mut best);
                }
                continue;
            }
            for part in tile.halves() {
                match looked_at(store, part, as_of, &mut best) {
                    Some(part) => self.tiles.push(part),
                    None => return unbounded(&part, store.perimeter_m()),
                }
            }
        }
        Hole {
            diameter_m: 2.0 * best.distance_m,
            x_m: best.x_m,
            sigma_m: math::wrap(best.sigma_m, store.perimeter_m()),
            bounded: true,
        }
    }

    /// Collects the samples that are nearest to some place of the tile: those within `reach_m` of its centre.
    ///
    /// Gives false when there are too many.
    fn find_owners(&mut self, store: &SampleStore, tile: &Tile, reach_m: f64, as_of: SampleIndex) -> bool {
        self.owners.clear();
        let owners = &mut self.owners;
        let mut fits = true;
        let perimeter_m = store.perimeter_m();
        // Half the perimeter on, the tile's far side may be nearer to a sample the other way round.
        let farthest_image_m = perimeter_m / 2.0 + tile.half_sigma_m;
        store.visit_within(tile.x_m, tile.sigma_m, reach_m, as_of, |found| {
            for turn in [0.0, -perimeter_m, perimeter_m] {
                let image = Found { dsigma_m: found.dsigma_m + turn, ..found };
                if image.dsigma_m.abs() > farthest_image_m {
                    continue;
                }
                // A vehicle that stands still lays samples on samples; one of them owns for all.
                let repeated = |other: &Found| {
                    (other.dx_m - image.dx_m).abs() + (other.dsigma_m - image.dsigma_m).abs() <= 0.0
                };
                if owners.iter().any(repeated) {
                    continue;
                }
                if owners.len() < MAX_OWNERS {
                    owners.push(image);
                } else {
                    fits = false;
                }
            }
        });
        fits
    }

    /// A closer bound, from the owners: no place of the tile is farther from its nearest sample than its farthest corner
    /// is from any one owner.
    fn reach_m(&self, tile: &Tile) -> f64 {
        let corner2 = |owner: &Found| {
            let (dx, dsigma) = (owner.dx_m.abs() + tile.half_x_m, owner.dsigma_m.abs() + tile.half_sigma_m);
            dx * dx + dsigma * dsigma
        };
        math::sqrt(self.owners.iter().map(corner2).fold(f64::INFINITY, f64::min))
    }

    /// Divides the tile among its owners, and takes the farthest corner of any share.
    fn divide(&mut self, tile: &Tile, best: &mut Best) {
        let half_m = tile.half_m();
        for (k, owner) in self.owners.iter().enumerate() {
            if math::sqrt(owner.distance2()) + half_m <= best.distance_m {
                continue;
            }
            // In coordinates about the owner, differences of near places are exact.
            let (left, right) = (-owner.dx_m - tile.half_x_m, -owner.dx_m + tile.half_x_m);
            let (low, high) = (-owner.dsigma_m - tile.half_sigma_m, -owner.dsigma_m + tile.half_sigma_m);
            self.share.set_rectangle(left, right, low, high);
            let best2 = best.distance_m * best.distance_m;
            for (other, rival) in self.owners.iter().enumerate() {
                // Once no corner beats the best place, the rest of the share can't either.
                if self.share.farthest2 <= best2 {
                    break;
                }
                if other != k {
                    self.share.clip(rival.dx_m - owner.dx_m, rival.dsigma_m - owner.dsigma_m);
                }
            }
            if self.share.farthest2 > best2
                && let Some((dx, dsigma)) = self.share.farthest()
            {
                *best = Best {
                    distance_m: math::sqrt(self.share.farthest2),
                    x_m: tile.x_m + owner.dx_m + dx,
                    sigma_m: tile.sigma_m + owner.dsigma_m + dsigma,
                };
            }
        }
    }
}

/// A convex polygon about a sample at the origin, and the room to clip it in.
#[derive(Debug)]
struct Polygon {
    corners: Vec<(f64, f64)>,
    clipped: Vec<(f64, f64)>,
    /// Squared distance of the farthest corner; zero when none is left.
    farthest2: f64,
}

impl Polygon {
    fn with_capacity(corners: usize) -> Self {
        Self { corners: Vec::with_capacity(corners), clipped: Vec::with_capacity(corners), farthest2: 0.0 }
    }

    fn set_rectangle(&mut self, left: f64, right: f64, low: f64, high: f64) {
        self.corners.clear();
        self.corners.extend([(left, low), (right, low), (right, high), (left, high)]);
        self.measure();
    }

    fn measure(&mut self) {
        self.farthest2 = self.corners.iter().map(square).fold(0.0, f64::max);
    }

    /// Keeps the part that is at least as near to the origin as to a rival at (`nx`, `ny`).
    fn clip(&mut self, nx: f64, ny: f64) {
        let half = 0.5 * (nx * nx + ny * ny);
        // A rival more than twice as far as the farthest corner cuts nothing: half > 2 farthest^2.
        if half > 2.0 * self.farthest2 {
            return;
        }
        let excess = |corner: (f64, f64)| nx * corner.0 + ny * corner.1 - half;
        if self.corners.iter().all(|corner| excess(*corner) <= 0.0) {
            return;
        }
        self.clipped.clear();
        let mut before = self.corners.last().copied().unwrap_or_default();
        let mut excess_before = excess(before);
        for corner in &self.corners {
            let excess_here = excess(*corner);
            if (excess_before > 0.0) != (excess_here > 0.0) {
                let share = excess_before / (excess_before - excess_here);
                let cut =
                    (before.0 + share * (corner.0 - before.0), before.1 + share * (corner.1 - before.1));
                self.clipped.push(cut);
            }
            if excess_here <= 0.0 {
                self.clipped.push(*corner);
            }
            before = *corner;
            excess_before = excess_here;
        }
        core::mem::swap(&mut self.corners, &mut self.clipped);
        self.measure();
    }

    fn farthest(&self) -> Option<(f64, f64)> {
        self.corners.iter().max_by(|a, b| square(a).total_cmp(&square(b))).copied()
    }
}

fn square(corner: &(f64, f64)) -> f64 {
    corner.0 * corner.0 + corner.1 * corner.1
}

#[cfg(test)]
mod tests;
