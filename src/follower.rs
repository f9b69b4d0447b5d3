//! Interface of a dive's followers: the page, the full-screen display, and outputs to other programs.

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_monitor::live_messages::LiveMessage;
use headrace_monitor::messages::Notice;
use headrace_monitor::run::Loop;
use headrace_ports::Status;
use headrace_replay::log::RecordingEvent;

use crate::recording_state::RecordingState;

/// Follows a dive. The methods are called on the loop's thread between ticks.
///
/// A follower takes values from the loop and hands them to a thread of its own. In a live dive a follower
/// never waits; a replay may wait for its followers.
pub(crate) trait Follower {
    /// Called before each call of [`notice`](Self::notice), [`tick`](Self::tick) and [`end`](Self::end), with
    /// the live messages that the result, the tick or the end of the dive causes.
    fn messages(&mut self, _told: &[LiveMessage], _dive: &Loop) {}
    /// Called for each result of the latest tick.
    fn notice(&mut self, _notice: &Notice, _dive: &Loop) {}
    /// Called after every tick, even without packets.
    fn tick(&mut self, dive: &Loop);
    /// Called after each tick that playback runs without showing it, because it jumps to a later time. The notices of
    /// such a tick aren't shown.
    fn skipped(&mut self, _dive: &Loop) {}
    /// Called when a replay pauses or resumes, or its speed changes.
    fn mode(&mut self, _paused: bool, _speed: Option<f64>) {}
    /// Called when a sensor's connection has changed.
    fn sensor(&mut self, _id: &str, _status: &Status) {}
    /// Called for an event of a recording.
    fn recording(&mut self, _event: &RecordingEvent, _at: MonoNs) {}
    /// Called with a new state of the recordings, which is shown from now on.
    fn recorded(&mut self, _state: &RecordingState) {}
    /// Called when a replay has paused, jumped or ended. `time` is a dive time. It may differ from the time of the
    /// loop's state.
    fn stopped(&mut self, _dive: &Loop, _time: DurNs, _ended: bool) {}
    /// Called when the state of an interrupted dive has been rebuilt from its log.
    fn rebuilt(&mut self, _dive: &Loop) {}
    /// Called when a dive on ports ends, before its last sections are judged.
    fn ending(&mut self) {}
    /// Called when the dive has ended and all sections are judged.
    fn end(&mut self, dive: &Loop);
}
