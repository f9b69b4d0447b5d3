//! Computes D_true: the hole diameter D over the places where beams truly met the wall.
//!
//! The results of simulated dives are compared with D_true. The computation finds circles by the Voronoi vertices and
//! edges of a triangulation, and arc lengths without ray casting. The program uses neither of these methods.

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
