//! D_true: D of the places where beams truly met the wall. By Voronoi vertices and edges of a triangulation that the program's own
//! search for holes doesn't use, on arc lengths that share no ray casting with it; and simulated dives whose verdicts are held against it.

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
