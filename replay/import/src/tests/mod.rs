//! The import and the formats, each on constructed files.

mod formats;
mod machinery;
