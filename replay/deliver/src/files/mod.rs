//! Files for other programs: points, sections, profile, findings, track, map and wall.
//!
//! Each encoder takes plain values and a stream, and writes the same bytes each time. Positions are in the tunnel frame.
//! [`encode_to`] adds the path to an encoder's errors.
//!
//! Points arrive once, during the replay. [`ply::PointWriter`] writes them as they come, and [`ply::read_points`] reads
//! them back for the other formats.

pub mod data;
pub mod dxf;
pub mod e57;
pub mod error;
pub mod glb;
pub mod las;
pub mod map;
pub mod palette;
pub mod ply;
mod rounding;
pub mod tables;
pub mod xyz;

#[cfg(test)]
mod tests;

pub use error::{FileError, PathError, encode_to};
