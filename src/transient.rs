//! Flag for a transient last line of the terminal without a line end: progress, or the dive's state.
//!
//! Log messages of any thread clear it first.

use std::sync::atomic::{AtomicBool, Ordering};

static SHOWN: AtomicBool = AtomicBool::new(false);

/// Sets the flag after a transient line was written.
pub(crate) fn shown() {
    SHOWN.store(true, Ordering::Relaxed);
}

/// Whether a transient line is shown; resets the flag.
pub(crate) fn take() -> bool {
    SHOWN.swap(false, Ordering::Relaxed)
}
