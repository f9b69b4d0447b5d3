//! Whether the terminal's last line is one that will be overwritten: a progress line or the dive's state. Whoever writes a
//! permanent line from any thread clears it first.

use std::sync::atomic::{AtomicBool, Ordering};

/// Goes to the beginning of the line and clears it.
pub(crate) const CLEAR: &[u8] = b"\r\x1b[K";

static SHOWN: AtomicBool = AtomicBool::new(false);

/// Such a line has been written, without a line end.
pub(crate) fn shown() {
    SHOWN.store(true, Ordering::Relaxed);
}

/// Whether such a line stands there; it no longer counts as shown.
pub(crate) fn take() -> bool {
    SHOWN.swap(false, Ordering::Relaxed)
}
