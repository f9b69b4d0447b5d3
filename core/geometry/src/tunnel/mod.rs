//! Tunnel design profiles with exact ray casting, and the unrolled wall.

mod profile;
pub mod shapes;

pub use profile::{Nearest, Piece, Profile, ProfileError, WallHit, Yz};
