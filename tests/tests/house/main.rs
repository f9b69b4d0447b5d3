//! Rules of this repository: layers, import cycles, limits of the core, and the metadata of each crate.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod dependencies;
mod english;
mod hard_cases;
mod image;
mod import_cycles;
mod imports;
mod layers;
mod promises;
mod workspace;
