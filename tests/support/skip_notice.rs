//! Notice for a skipped test.

use std::io::Write as _;

/// Prints that a test is skipped, with the reason. `.ci/count-skipped` counts these lines at the end of a run.
///
/// The line goes straight to standard error, because Cargo shows the `eprintln!` output of failed tests only. It is
/// written in one piece, because tests run in parallel.
#[expect(clippy::unwrap_used, reason = "a test that can't report a skip fails")]
pub fn skipped(why: &str) {
    std::io::stderr().write_all(format!("skipped: {why}\n").as_bytes()).unwrap();
}
