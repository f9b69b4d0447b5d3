//! Rules of this repository: layers, import cycles, a core without I/O, language, and the metadata of each crate.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a failed step ends the test")]

mod dependencies;
mod english;
mod entry_points;
mod hard_cases;
mod image;
mod import_cycles;
mod imports;
mod layers;
mod promises;
mod workspace;
