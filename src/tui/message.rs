//! Messages to the renderer's thread.

use super::frame::ScreenFrame;
use super::keys::Key;

/// A message: a frame, a key, or the end.
pub(super) enum Message {
    ScreenFrame(Box<ScreenFrame>),
    Key(Key),
    /// Ctrl-C was pressed.
    Interrupted,
    End,
}
