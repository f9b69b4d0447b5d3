//! A tunnel's design profile: a closed curve of straight lines and arcs, with exact ray casting.

mod closed_curve;
mod element;
mod nearest;
mod plane;
mod polygon;
mod support;
mod tree;

pub use closed_curve::{Profile, ProfileError, WallHit};
pub use element::Piece;
pub use nearest::Nearest;
pub use plane::Yz;
