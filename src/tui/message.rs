//! Messages to the renderer's thread.

use super::keys::Key;
use super::shot::Shot;

/// A frame, a key, or the end.
pub(super) enum Message {
    Shot(Box<Shot>),
    Key(Key),
    /// Ctrl-C.
    Interrupted,
    End,
}
