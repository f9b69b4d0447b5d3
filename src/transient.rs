//! Flag for a transient last line of the terminal, one without a line end: progress, or the dive's state. Log messages,
//! from any thread, clear it first.

use std::sync::atomic::{AtomicBool, Ordering};

/// Goes to the beginning of the line and clears it.
pub(crate) const CLEAR: &[u8] = b"\r\x1b[K";

static SHOWN: AtomicBool = AtomicBool::new(false);

/// A transient line was written.
pub(crate) fn shown() {
    SHOWN.store(true, Ordering::Relaxed);
}

/// Whether a transient line is shown; resets the flag.
pub(crate) fn take() -> bool {
    SHOWN.swap(false, Ordering::Relaxed)
}
