//! D_true: D of the places where beams truly met the wall. By Voronoi vertices and edges of a triangulation that the program's own
//! search for holes doesn't use, on arc lengths that share no ray casting with it.

pub(crate) mod blocks;
pub mod outline;
pub mod second;
pub mod truth;
pub mod wall;
