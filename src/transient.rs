//! Flag for a transient last line on the terminal, such as progress or the dive's state. The line has no line
//! end.
//!
//! A log message of any thread clears the line first.

use std::sync::atomic::{AtomicBool, Ordering};

static SHOWN: AtomicBool = AtomicBool::new(false);

/// Sets the flag, after a transient line was written.
pub(crate) fn shown() {
    SHOWN.store(true, Ordering::Relaxed);
}

/// Returns whether a transient line is shown, and resets the flag.
pub(crate) fn take() -> bool {
    SHOWN.swap(false, Ordering::Relaxed)
}
