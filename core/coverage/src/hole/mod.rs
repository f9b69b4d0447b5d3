//! The largest hole of a section: the largest empty circle on the unrolled wall with its centre in the section.
//!
//! Let f(c) be the distance from a point c to the nearest sample. D = 2 max f over the section
//! (docs/reference/glossary.md). Branch and bound over tiles finds D:
//!
//! 1. A tile is divided among a few samples. The share of each is a convex polygon, so its point farthest from the
//!    sample is a corner.
//! 2. The farthest corner gives an upper bound of f in the tile, because additional samples only lower f.
//! 3. The sample nearest to that corner either proves the bound, or gets a share and lowers the bound.
//! 4. Tiles whose bound cannot exceed f at the best point found are dropped. So only the worst areas are divided
//!    finely.
//!
//! Clipping is exact except for rounding. The search uses no triangulation, so lattices, lines and duplicate samples
//! need no special handling.

mod certain;
mod division;
mod finder;
mod hypothetical;
mod window;

pub use certain::Needed;
pub use finder::{FARTHEST_M, Hole, HoleFinder};
pub use hypothetical::WallChanges;
