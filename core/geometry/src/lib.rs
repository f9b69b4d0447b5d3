//! Basis of every other crate: units, time, frames, mathematics, site, tunnel profiles, snapshots.
//!
//! The type of a vector contains its frame. A place on a tunnel's wall is given by chainage and arc length. The crate
//! is pure: no I/O, no threads, no clock, no randomness. It takes transcendental functions only from [`math`].
//!
//! ```
//! use headrace_geometry::tunnel::shapes;
//!
//! // A ray to the left from the middle of a tunnel of 3 m radius (y left, z up, from the floor's centre).
//! let tunnel = shapes::circle(3.0)?;
//! let hit = tunnel.cast([0.0, 3.0], [1.0, 0.0]).unwrap();
//! assert!((hit.range_m - 3.0).abs() < 1e-12);
//! // Arc length grows from the floor's centre via the left wall.
//! assert!((hit.arc_m - tunnel.perimeter_m() / 4.0).abs() < 1e-12);
//! assert_eq!(tunnel.clock(hit.arc_m), "9:00");
//! # Ok::<(), headrace_geometry::tunnel::ProfileError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

pub mod frames;
pub mod math;
pub mod site;
pub mod snapshot;
pub mod time;
pub mod tunnel;
