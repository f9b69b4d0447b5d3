//! What tests of any crate need: recordings of others, the page of hard cases, and a word for what is skipped.

pub mod hard_cases;
pub mod recordings;

use std::io::Write as _;

/// Says that something isn't tested here, and why. `.ci/count-skipped` counts these lines at the end of a run.
///
/// Straight to standard error, because cargo shows what `eprintln!` prints of failed tests alone; in one piece, because
/// tests run side by side.
#[expect(clippy::unwrap_used, reason = "a test that can't say what it skips fails")]
pub fn skipped(why: &str) {
    std::io::stderr().write_all(format!("skipped: {why}\n").as_bytes()).unwrap();
}
