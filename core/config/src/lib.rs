//! Files that people write, as TOML: typed access whose errors name file, line, key, value and what is allowed.
//!
//! Reading the file itself is the caller's.

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

mod changes;
mod reader;

pub use changes::changed;
pub use reader::{ConfigError, Document, Loader, NamedFile, Section};
