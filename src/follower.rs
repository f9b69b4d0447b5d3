//! Who follows a dive besides the terminal: a page, another program.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;
use headrace_ports::Status;
use headrace_replay::log::RecordingEvent;

use crate::recording_state::RecordingState;

/// Follows a dive. Called on the loop's thread between ticks: it takes what it needs of the loop by value and hands it to a
/// thread of its own; it waits for nothing, unless the dive is a replay, which may wait for it.
pub(crate) trait Follower {
    /// A result of the last tick.
    fn notice(&mut self, _notice: &Notice, _dive: &Loop) {}
    /// After every tick, also where nothing has come.
    fn tick(&mut self, dive: &Loop);
    /// After a tick on the way of a jump, whose notices aren't shown.
    fn skipped(&mut self, _dive: &Loop) {}
    /// A replay begins to stand still or to play, or its speed changes.
    fn mode(&mut self, _paused: bool, _speed: Option<f64>) {}
    /// A sensor's connection has changed.
    fn sensor(&mut self, _id: &str, _status: &Status) {}
    /// Something has happened to a recording.
    fn recording(&mut self, _event: &RecordingEvent, _at: MonoNs) {}
    /// What to show of the recordings from now on.
    fn recorded(&mut self, _state: &RecordingState) {}
    /// A replay has paused, jumped or ended at `time` after its beginning: the loop's state may be another.
    fn stopped(&mut self, _dive: &Loop, _time: DurNs, _ended: bool) {}
    /// The dive has ended, and all is judged.
    fn end(&mut self, dive: &Loop);
}
