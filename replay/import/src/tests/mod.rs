//! Tests of the import and of the formats, on constructed files.

mod doubt;
pub(crate) mod formats;
mod machinery;
