//! Address of the page in these tests.

/// Serves the page on any free port.
pub(crate) const ANY: &str = "--page=127.0.0.1:0";
