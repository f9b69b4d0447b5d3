//! Messages from the loop's thread to the page's thread, passed through a bounded queue.

use headrace_geometry::time::{DiveClock, MonoNs};
use headrace_monitor::alert_list::NoteJson;
use headrace_monitor::live_state::json::LiveStateJson;
use serde::Serialize;
use serde_json::Value;

use crate::compared::ComparedJson;
use crate::wire::{SampleRecord, SectionRecord};

/// A message from the loop's thread to the page's thread.
#[derive(Debug)]
pub enum Fed {
    /// New data since the previous message.
    News(Box<News>),
    /// Playback has jumped to this time. All later messages refer to the time after the jump.
    Jump(MonoNs),
    /// State of playback.
    Playback(PlaybackState),
    /// The dive has ended.
    End(Box<Value>),
}

/// New data of one or several ticks.
#[derive(Debug)]
pub struct News {
    /// End time of the latest tick.
    pub now: MonoNs,
    /// Whether a seek skips this tick. Only the samples of a skipped tick are used, because the state is sent after the
    /// jump.
    pub is_skipped: bool,
    /// Clock of the dive.
    pub clock: DiveClock,
    /// The live state at the end of the tick.
    pub state: Box<LiveStateJson>,
    /// Displayed data that isn't in the live state.
    pub beside: Beside,
    /// Samples since the previous message.
    pub samples: Vec<SampleRecord>,
    /// Wall samples read from the loop's store to replace dropped samples.
    pub mended: Vec<SampleRecord>,
    /// Sections that have changed since the previous message.
    pub sections: Vec<SectionRecord>,
    /// Events since the previous message, as JSON objects with a type.
    pub events: Vec<Value>,
    /// All notes of the dive; `None` if there is no new note.
    pub notes: Option<Vec<NoteJson>>,
    /// Missed stretches to go back to; `None` if the list hasn't changed.
    pub back: Option<Value>,
    /// Counts of samples and events dropped so far.
    pub dropped: Dropped,
}

/// Displayed data that isn't in the live state.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Beside {
    /// Pose of the vehicle in the cross-section.
    pub pose: Option<PoseJson>,
    /// Depth below the water level by the latest reading of the pressure sensor, m; `None` without one.
    pub depth_m: Option<f64>,
    /// Latest pings of the echosounders.
    pub echosounders: Vec<EchoJson>,
    /// Rate of readings of each sensor.
    pub rates: Vec<RateJson>,
    /// State of the recording.
    pub recording: RecordingJson,
    /// Verdicts of the same dive for a second target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<ComparedJson>,
    /// Status of the dive as one line of text.
    pub text: String,
}

/// Pose of the vehicle in the cross-section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseJson {
    /// Distance to the left of the tunnel's axis, m.
    pub y_m: f64,
    /// Height above the floor, m.
    pub z_m: f64,
    /// Roll, degrees.
    pub roll_deg: f64,
    /// Pitch, degrees.
    pub pitch_deg: f64,
    /// Yaw, degrees.
    pub yaw_deg: f64,
}

/// The latest ping of an echosounder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EchoJson {
    /// Sensor id.
    pub id: String,
    /// Latest range, m; `None` without an echo.
    pub range_m: Option<f64>,
    /// Time since the ping, seconds.
    pub age_s: f64,
    /// Position of the echosounder in the cross-section, m.
    pub from: [f64; 2],
    /// Position of the echo in the cross-section, m; `None` without an echo.
    pub to: Option<[f64; 2]>,
}

/// Rate of a sensor's readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RateJson {
    /// Sensor id.
    pub id: String,
    /// Readings per second.
    pub hz: f64,
}

/// State of the recording.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct RecordingJson {
    /// Whether the dive is recorded.
    pub on: bool,
    /// Whether data is being lost now, or will be lost if the power fails.
    pub fails: bool,
    /// Text about the recording, the same on all screens; `None` if recording works.
    pub words: Option<String>,
    /// Share of an interrupted dive's log that has been read again, percent; `None` if the dive's state is complete.
    pub read_again_pct: Option<u8>,
    /// Path of the recording.
    pub path: Option<String>,
}

/// Counts of samples and events that were dropped because the queue to the page's thread was full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Dropped {
    /// Number of dropped samples. Wall samples among these are sent again from the loop's store.
    pub samples: u64,
    /// Number of dropped events.
    #[serde(rename = "told")]
    pub events: u64,
}

/// State of playback.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackState {
    /// Whether playback is paused.
    pub paused: bool,
    /// Speed as a multiple of real time; `None` plays as fast as possible.
    pub speed: Option<f64>,
    /// Present position, seconds of dive time.
    pub at_s: f64,
    /// Start of the log, seconds of dive time.
    pub from_s: f64,
    /// End of the log, seconds of dive time.
    pub to_s: f64,
}
