//! What kind of dive is shown, and whether it goes on.

use crossbeam::channel::Sender;
use headrace_replay::playback::PlaybackCommand;

/// What kind of dive is shown.
pub(crate) enum Mode {
    /// On ports: nothing may wait.
    Live,
    /// A simulated one.
    Demo,
    /// From a log, as fast as it is played.
    Source,
    /// A replay, which takes commands; its speed at the beginning.
    Replay(Sender<PlaybackCommand>, Option<f64>),
}

/// Why a replay stands still.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    Paused,
    Ended,
}
