//! Address at which the tests of this folder serve the page.

/// Serves the page on any free port.
pub(crate) const ANY: &str = "--page=127.0.0.1:0";
