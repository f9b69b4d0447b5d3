//! How a test says what it leaves out.

use std::io::Write as _;

/// Says that something isn't tested here, and why. `.ci/count-skipped` counts these lines at the end of a run.
///
/// Straight to standard error, because cargo shows what `eprintln!` prints of failed tests alone; in one piece, because
/// tests run side by side.
pub(crate) fn skipped(why: &str) {
    std::io::stderr().write_all(format!("skipped: {why}\n").as_bytes()).unwrap();
}
