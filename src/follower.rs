//! Interface of followers of a dive besides the terminal: a page, another program.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;
use headrace_ports::Status;
use headrace_replay::log::RecordingEvent;

use crate::recording_state::RecordingState;

/// Follows a dive. It is called on the loop's thread between ticks.
///
/// It takes values from the loop and hands them to a thread of its own. It never waits, except in a replay,
/// which may wait for it.
pub(crate) trait Follower {
    /// A result of the last tick.
    fn notice(&mut self, _notice: &Notice, _dive: &Loop) {}
    /// Called after every tick, even without packets.
    fn tick(&mut self, dive: &Loop);
    /// Called after a tick during a jump, whose notices aren't shown.
    fn skipped(&mut self, _dive: &Loop) {}
    /// Called when a replay pauses or resumes, or its speed changes.
    fn mode(&mut self, _paused: bool, _speed: Option<f64>) {}
    /// Called when a sensor's connection has changed.
    fn sensor(&mut self, _id: &str, _status: &Status) {}
    /// Called for an event of a recording.
    fn recording(&mut self, _event: &RecordingEvent, _at: MonoNs) {}
    /// Called with the state of the recordings to show from now on.
    fn recorded(&mut self, _state: &RecordingState) {}
    /// Called when a replay has paused, jumped or ended at `time` after its beginning. The loop's state may
    /// differ.
    fn stopped(&mut self, _dive: &Loop, _time: DurNs, _ended: bool) {}
    /// Called when the dive has ended, and all is judged.
    fn end(&mut self, dive: &Loop);
}
