//! Tunnel design profiles with exact ray casting, and the unrolled wall.

mod profile;
pub mod shapes;

use serde::{Deserialize, Serialize};

pub use profile::{Nearest, Piece, Profile, ProfileError, WallHit, Yz};

/// A point on the unrolled wall.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct WallPoint {
    /// Chainage, m.
    pub x_m: f64,
    /// Arc length, m.
    pub arc_m: f64,
}
