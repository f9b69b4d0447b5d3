//! Kind and state of the dive that the screen shows.

use crossbeam::channel::Sender;
use headrace_replay::playback::PlaybackCommand;

/// Kind of dive shown.
pub(crate) enum Mode {
    /// A dive on ports. No thread of the dive may wait for the screen.
    Live,
    /// The simulated dive of `headrace demo`.
    Demo,
    /// A dive from a log, at the playback's speed.
    Source,
    /// A replay that takes commands, and its initial speed.
    Replay(Sender<PlaybackCommand>, Option<f64>),
}

/// Reason why a replay is stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Stop {
    Paused,
    Ended,
}
