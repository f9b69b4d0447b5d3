//! Rules of this repository: layers, import cycles, limits of the core, and the metadata of each crate.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod circles;
mod english;
mod hard_cases;
mod image;
mod imports;
mod promises;
mod supply;
mod tidy;
mod workspace;
