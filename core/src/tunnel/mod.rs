//! The tunnel: design profiles with exact ray casting, and the unrolled wall.

pub mod named;
mod profile;

pub use profile::{Nearest, Piece, Profile, ProfileError, WallHit, Yz};
