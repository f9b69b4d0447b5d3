//! What the loop's thread hands to the page's: values, in a bounded queue.

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
    /// What is new since the last one.
    News(Box<News>),
    /// Playback has jumped: all that follows is as of then.
    Jump(MonoNs),
    /// How a replay plays.
    Playback(PlaybackState),
    /// The dive has ended.
    End(Box<Value>),
}

/// What is new.
#[derive(Debug)]
pub struct News {
    /// The end of the tick.
    pub now: MonoNs,
    /// Of a tick on the way of a jump: only its samples count, the rest comes with the jump.
    pub is_skipped: bool,
    /// The first time of the dive, once there is one.
    pub begun: Option<MonoNs>,
    /// The live state, as of the tick.
    pub state: Box<LiveStateJson>,
    /// What is shown of it besides.
    pub beside: Beside,
    /// New samples.
    pub samples: Vec<SampleRecord>,
    /// Samples that are sent anew: those of these chainages, m, were dropped.
    pub mended: Vec<SampleRecord>,
    /// Sections that have changed.
    pub sections: Vec<SectionRecord>,
    /// What was told: JSON objects with a type.
    pub told: Vec<Value>,
    /// All notes, if there is a new one.
    pub notes: Option<Vec<NoteJson>>,
    /// What to go back for, if that has changed.
    pub back: Option<Value>,
    /// What has found no room so far.
    pub dropped: Dropped,
}

/// What of the state comes from elsewhere than the live state.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Beside {
    /// The vehicle in the cross-section.
    pub pose: Option<PoseJson>,
    /// The echosounders.
    pub echosounders: Vec<EchoJson>,
    /// Readings a second of each sensor.
    pub rates: Vec<RateJson>,
    /// The recording.
    pub recording: RecordingJson,
    /// The same dive held to another target.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub compared: Option<ComparedJson>,
    /// The status in a line.
    pub text: String,
}

/// The vehicle in the cross-section.
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
    /// Its last range, m; `None` where there was no echo.
    pub range_m: Option<f64>,
    /// How long ago that was, seconds.
    pub age_s: f64,
    /// Where it is in the cross-section, m.
    pub from: [f64; 2],
    /// Where the echo is, m.
    pub to: Option<[f64; 2]>,
}

/// Readings a second of a sensor.
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
    /// Whether what comes now is lost, or would be with the power.
    pub fails: bool,
    /// What to show of it, as all screens say it; `None` while all is well.
    pub words: Option<String>,
    /// Where to.
    pub path: Option<String>,
}

/// What has found no room in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Dropped {
    /// Samples; those of wall are sent anew.
    pub samples: u64,
    /// Lines.
    pub told: u64,
}

/// How a replay plays.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlaybackState {
    /// Whether it stands still.
    pub paused: bool,
    /// Seconds of the dive a second; `None` is as fast as possible.
    pub speed: Option<f64>,
    /// Where it is, seconds on the log's clock.
    pub at_s: f64,
    /// Where the log begins, seconds.
    pub from_s: f64,
    /// Where it ends, seconds.
    pub to_s: f64,
}
