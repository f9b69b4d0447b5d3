//! Rules of this repository: layers, circles, what the core may use, and what each crate states about itself.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test stops at what it can't do")]

mod circles;
mod english;
mod hard_cases;
mod image;
mod imports;
mod promises;
mod supply;
mod tidy;
mod workspace;
