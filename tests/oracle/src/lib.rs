//! Computes D_true, the hole diameter D over the places where beams truly met the wall.
//!
//! It uses Voronoi vertices and edges of a triangulation, and arc lengths without ray casting; the program shares
//! neither. Simulated dives are compared with it.

mod blocks;
mod cpu;
pub mod dive;
mod error;
pub mod outline;
pub mod second;
pub mod truth;
pub mod wall;

pub use cpu::{cpu_s, timed};
pub use error::TruthError;
