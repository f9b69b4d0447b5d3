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
        self.lay_tiles(store, from_m, to_m);
        let mut best = Best { distance_m: 0.0, x_m: from_m, sigma_m: 0.0 };
        while let Some(tile) = self.tiles.pop() {
            if tile.bound_m <= best.distance_m {
                continue;
            }
            let half_m = math::hypot(tile.half_x_m, tile.half_sigma_m);
            let Some(nearest) = store.nearest(tile.x_m, tile.sigma_m, tile.bound_m.min(FARTHEST_M), as_of)
            else {
                return Hole {
                    diameter_m: 2.0 * FARTHEST_M,
                    x_m: tile.x_m,
                    sigma_m: math::wrap(tile.sigma_m, store.perimeter_m()),
                    bounded: false,
                };
            };
            let distance_m = math::sqrt(nearest.distance2());
            if distance_m > best.distance_m {
                best = Best { distance_m, x_m: tile.x_m, sigma_m: tile.sigma_m };
            }
            let bound_m = distance_m + half_m;
            if bound_m <= best.distance_m || half_m < NO_FINER_M {
                continue;
            }
            // Worth dividing exactly only when the tile is small beside its distance from the samples.
            let owners_known =
                half_m < 0.5 * distance_m && self.find_owners(store, &tile, bound_m + half_m, as_of);
            if owners_known {
                self.divide(&tile, &mut best);
            } else {
                self.halve(&tile, bound_m, store);
            }
        }
        Hole {
            diameter_m: 2.0 * best.distance_m,
            x_m: best.x_m,
            sigma_m: math::wrap(best.sigma_m, store.perimeter_m()),
            bounded: true,
        }
    }

    /// Covers the section with about square tiles.
    fn lay_tiles(&mut self, store: &SampleStore, from_m: f64, to_m: f64) {
        self.tiles.clear();
        let half_x_m = (to_m - from_m) / 2.0;
        let perimeter_m = store.perimeter_m();
        let count = math::floor_to_i64(perimeter_m / (2.0 * half_x_m)).clamp(1, 8192) + 1;
        let half_sigma_m = perimeter_m / (2 * count) as f64;
        for k in 0..count {
            self.tiles.push(Tile {
                x_m: from_m + half_x_m,
                sigma_m: (2 * k + 1) as f64 * half_sigma_m,
                half_x_m,
                half_sigma_m,
                bound_m: f64::INFINITY,
            });
        }
    }

    fn halve(&mut self, tile: &Tile, bound_m: f64, store: &SampleStore) {
        let along_x = tile.half_x_m > tile.half_sigma_m;
        let (half_x_m, half_sigma_m) = if along_x {
            (tile.half_x_m / 2.0, tile.half_sigma_m)
        } else {
            (tile.half_x_m, tile.half_sigma_m / 2.0)
        };
        for side in [-1.0, 1.0] {
            let (x_m, sigma_m) = if along_x {
                (tile.x_m + side * half_x_m, tile.sigma_m)
            } else {
                (tile.x_m, tile.sigma_m + side * half_sigma_m)
            };
            let sigma_m = if sigma_m < 0.0 { sigma_m + store.perimeter_m() } else { sigma_m };
            self.tiles.push(Tile { x_m, sigma_m, half_x_m, half_sigma_m, bound_m });
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
                let repeated = |other: &Found| other.dx_m == image.dx_m && other.dsigma_m == image.dsigma_m;
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

    /// Divides the tile among its owners, and takes the farthest corner of any share.
    fn divide(&mut self, tile: &Tile, best: &mut Best) {
        for (k, owner) in self.owners.iter().enumerate() {
            // In coordinates about the owner, differences of near places are exact.
            let (left, right) = (-owner.dx_m - tile.half_x_m, -owner.dx_m + tile.half_x_m);
            let (low, high) = (-owner.dsigma_m - tile.half_sigma_m, -owner.dsigma_m + tile.half_sigma_m);
            self.share.set_rectangle(left, right, low, high);
            for (other, rival) in self.owners.iter().enumerate() {
                if other != k {
                    self.share.clip(rival.dx_m - owner.dx_m, rival.dsigma_m - owner.dsigma_m);
                }
            }
            if let Some((dx, dsigma)) = self.share.farthest() {
                let distance_m = math::sqrt(dx * dx + dsigma * dsigma);
                if distance_m > best.distance_m {
                    *best = Best {
                        distance_m,
                        x_m: tile.x_m + owner.dx_m + dx,
                        sigma_m: tile.sigma_m + owner.dsigma_m + dsigma,
                    };
                }
            }
        }
    }
}

/// A convex polygon about a sample at the origin, and the room to clip it in.
#[derive(Debug)]
struct Polygon {
    corners: Vec<(f64, f64)>,
    clipped: Vec<(f64, f64)>,
}

impl Polygon {
    fn with_capacity(corners: usize) -> Self {
        Self { corners: Vec::with_capacity(corners), clipped: Vec::with_capacity(corners) }
    }

    fn set_rectangle(&mut self, left: f64, right: f64, low: f64, high: f64) {
        self.corners.clear();
        self.corners.extend([(left, low), (right, low), (right, high), (left, high)]);
    }

    /// Keeps the part that is at least as near to the origin as to a rival at (`nx`, `ny`).
    fn clip(&mut self, nx: f64, ny: f64) {
        let half = (nx * nx + ny * ny) / 2.0;
        let excess = |corner: (f64, f64)| nx * corner.0 + ny * corner.1 - half;
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
    }

    fn farthest(&self) -> Option<(f64, f64)> {
        let square = |corner: &(f64, f64)| corner.0 * corner.0 + corner.1 * corner.1;
        self.corners.iter().max_by(|a, b| square(a).total_cmp(&square(b))).copied()
    }
}

#[cfg(test)]
mod tests;
