//! What comes to the thread that draws.

use super::keys::Key;
use super::shot::Shot;

/// A picture, a key, or the end.
pub(super) enum Message {
    Shot(Box<Shot>),
    Key(Key),
    /// Ctrl-C.
    Interrupted,
    End,
}
