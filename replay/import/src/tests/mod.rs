//! Tests of the import and of the formats, on constructed files.

mod doubt;
mod formats;
mod machinery;
