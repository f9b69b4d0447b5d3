//! Support for tests of any crate: public recordings, the page of hard cases, and a notice for skipped tests.

pub mod hard_cases;
pub mod recordings;
mod skip_notice;

pub use skip_notice::skipped;
