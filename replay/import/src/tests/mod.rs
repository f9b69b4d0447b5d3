//! The machinery and the formats, each on files of its own making.

mod formats;
mod machinery;
