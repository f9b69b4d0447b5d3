//! Typed access to TOML files that people write. Errors name the file, line, key, value and allowed values.
//!
//! The caller reads the file's text. [`Section::finish`] reports unread keys as errors. [`Document::read`] finds all
//! errors of a file in one pass; [`Document::root`] stops at the first.
//!
//! ```
//! use headrace_config::Document;
//!
//! let root = Document::new("sensor.toml", "id = \"depth\"\nrate_hz = 500\n").root()?;
//! assert_eq!(root.text("id")?.as_deref(), Some("depth"));
//! assert_eq!(root.boolean("vented")?, None);
//! let error = root.number("rate_hz", 0.1..=100.0).unwrap_err();
//! assert_eq!(error.to_string(), "sensor.toml:2: rate_hz = 500: must be a number from 0.1 to 100");
//! # Ok::<(), headrace_config::ConfigError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::cast_possible_truncation))]
#![cfg_attr(test, allow(clippy::cast_possible_truncation))]

mod changes;
mod document;
mod error;
mod nearest;
pub mod plain;
mod reader;
#[cfg(test)]
mod tests;

pub use changes::changed;
pub use document::Document;
pub use error::{ConfigError, ConfigErrors};
pub use reader::{Loader, NamedFile, Section};
