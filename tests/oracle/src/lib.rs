//! Computes D_true: the hole diameter D over the places where beams truly met the wall.
//!
//! Simulated dives are compared with D_true. Its computation uses Voronoi vertices and edges of a triangulation, and
//! arc lengths without ray casting. The program uses neither method.

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
