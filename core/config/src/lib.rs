//! Typed access to hand-written TOML files; errors name file, line, key, value and the allowed values.
//!
//! File I/O is left to the caller.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

mod changes;
mod reader;

pub use changes::changed;
pub use reader::{ConfigError, Document, Loader, NamedFile, Section};
