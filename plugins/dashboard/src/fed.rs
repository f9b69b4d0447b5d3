//! Messages from the loop's thread to the page's, in a bounded queue.

use headrace_geometry::time::MonoNs;
use headrace_monitor::alert_list::NoteJson;
use headrace_monitor::live_state::json::LiveStateJson;
use serde::Serialize;
use serde_json::Value;

use crate::compared::ComparedJson;
use crate::wire::{SampleRecord, SectionRecord};

/// A message to the page's thread.
#[derive(Debug)]
pub enum Fed {
    /// New data since the last message.
    News(Box<News>),
    /// Playback has jumped; later messages refer to the new time.
    Jump(MonoNs),
    /// State of playback.
    Playback(PlaybackState),
    /// The dive has ended.
    End(Box<Value>),
}

/// New data.
#[derive(Debug)]
pub struct News {
    /// End of the tick.
    pub now: MonoNs,
    /// Whether a seek skips this tick: only its samples count, and the rest comes with the jump.
    pub is_skipped: bool,
    /// First time of the dive, once known.
    pub begun: Option<MonoNs>,
    /// The live state, as of the tick.
    pub state: Box<LiveStateJson>,
    /// Displayed data besides the live state.
    pub beside: Beside,
    /// New samples.
    pub samples: Vec<SampleRecord>,
    /// Samples sent again for these chainages, m, in place of dropped ones.
    pub mended: Vec<SampleRecord>,
    /// Changed sections.
    pub sections: Vec<SectionRecord>,
    /// Events, as JSON objects with a type.
    pub told: Vec<Value>,
    /// All notes, if there is a new one.
    pub notes: Option<Vec<NoteJson>>,
    /// Stretches to go back for, if they have changed.
    pub back: Option<Value>,
    /// Data dropped so far.
    pub dropped: Dropped,
}

/// Displayed data that isn't in the live state.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Beside {
    /// Pose of the vehicle in the cross-section.
    pub pose: Option<PoseJson>,
    /// The echosounders.
    pub echosounders: Vec<EchoJson>,
    /// Rate of readings of each sensor.
    pub rates: Vec<RateJson>,
    /// The recording.
    pub recording: RecordingJson,
    /// Verdicts of the same dive for a second target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<ComparedJson>,
    /// Status as one line of text.
    pub text: String,
}

/// Pose of the vehicle in the cross-section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseJson {
    /// Left of the axis, m.
    pub y_m: f64,
    /// Above the floor, m.
    pub z_m: f64,
    /// Roll, degrees.
    pub roll_deg: f64,
    /// Pitch, degrees.
    pub pitch_deg: f64,
    /// Yaw, degrees.
    pub yaw_deg: f64,
}

/// An echosounder.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EchoJson {
    /// Its id.
    pub id: String,
    /// Last range, m; `None` without an echo.
    pub range_m: Option<f64>,
    /// Age of that range, seconds.
    pub age_s: f64,
    /// Position of the echosounder in the cross-section, m.
    pub from: [f64; 2],
    /// Position of the echo, m.
    pub to: Option<[f64; 2]>,
}

/// Rate of a sensor's readings.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RateJson {
    /// Its id.
    pub id: String,
    /// Readings a second.
    pub hz: f64,
}

/// The recording.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct RecordingJson {
    /// Whether the dive is recorded.
    pub on: bool,
    /// Whether present data is lost, or would be lost in a power cut.
    pub fails: bool,
    /// Displayed text, the same on all screens; `None` while all is well.
    pub words: Option<String>,
    /// Path of the recording.
    pub path: Option<String>,
}

/// Data dropped because the queue was full.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Dropped {
    /// Samples; wall samples are sent again.
    pub samples: u64,
    /// Lines.
    pub told: u64,
}

/// State of playback.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackState {
    /// Whether it is paused.
    pub paused: bool,
    /// Speed as a multiple of real time; `None` is as fast as possible.
    pub speed: Option<f64>,
    /// Present position, seconds on the log's clock.
    pub at_s: f64,
    /// Start of the log, seconds.
    pub from_s: f64,
    /// End of the log, seconds.
    pub to_s: f64,
}
