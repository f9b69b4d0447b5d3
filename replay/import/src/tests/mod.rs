//! Tests of the import and of the formats, on constructed files.

mod formats;
mod machinery;
