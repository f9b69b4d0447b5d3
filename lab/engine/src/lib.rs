//! Campaigns: the dives of a folder or bucket. Each dive is replayed once, and SQL queries its tables.
//!
//! The manual is `docs/how-to/replay-many-dives.md`.

pub mod about;
pub mod cache;
pub mod campaign;
#[cfg(feature = "cluster")]
pub mod cluster;
pub mod dives;
pub mod error;
pub mod maker;
pub mod output;
pub mod picture;
pub mod place;
pub mod provider;
pub mod questions;

pub use error::Error;
