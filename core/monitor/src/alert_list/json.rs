//! Alerts and notes as JSON. The field names are a contract; `docs/reference/live-state.schema.json` is the
//! schema.
//!
//! Allocates: outlets only.

use serde::Serialize;

use super::alert::{AlertState, Figures, ListedAlert};
use super::kind::Priority;
use super::list::AlertList;
use super::texts::TextContext;
use crate::live_state::state::LiveState;
use crate::notes::{Note, Spoken};
use crate::observations::Occurrences;
use crate::pilot_text::station;
use crate::source::SourceInfo;
use headrace_fusion::filter::setting_check::{Setting, SettingDoubt};
use headrace_geometry::time::{DiveClock, MonoNs};

/// Maximum number of alerts in the JSON list.
pub const MOST_SHOWN: usize = 64;
/// Cleared alerts are added to the JSON list up to this length.
const RECENT: usize = 20;

/// An alert in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListedAlertJson {
    /// Number of the alert, from 1; never reused.
    pub number: u32,
    /// Priority: `emergency_alarm`, `alarm`, `warning` or `caution`.
    pub priority: &'static str,
    /// Class: `coverage`, `speed`, `position`, `sensor`, `recording` or `setting`.
    pub class: &'static str,
    /// Kind of the alert.
    pub kind: &'static str,
    /// Text of the problem that the alert reports.
    pub text: String,
    /// Action to take; empty if there is none.
    pub advice: String,
    /// State: `active`, `rectified` or `cleared`.
    pub state: AlertState,
    /// Dive time at which the alert was first raised, seconds.
    pub since_s: f64,
    /// Dive time at which the alert's condition ceased to hold, seconds.
    pub rectified_s: Option<f64>,
    /// Dive time at which the alert ended, seconds.
    pub cleared_s: Option<f64>,
    /// Acknowledgement of the alert, if any.
    pub acknowledged: Option<AcknowledgedJson>,
    /// Dive time until which the alert's sound is silenced, seconds.
    pub silenced_until_s: Option<f64>,
    /// Whether the alert's sound is on now.
    pub sounds: bool,
    /// Whether somebody must still acknowledge the alert.
    pub needs_acknowledgement: bool,
    /// Beginning of the alert's stretch, or chainage of the vehicle when the alert was raised, m.
    pub from_m: Option<f64>,
    /// End of the alert's stretch, m.
    pub to_m: Option<f64>,
    /// Place to go back to in order to pass the missed stretch again, m.
    pub back_to_m: Option<f64>,
    /// Largest speed for passing the missed stretch again or, in an alert about speed, v_max; m/s.
    pub at_most_mps: Option<f64>,
    /// Id of the sensor that the alert names.
    pub sensor: Option<String>,
    /// Number of times that the alert was raised. For missed stretches: number of stretches that the alert
    /// represents.
    pub count: u32,
    /// Number of occurrences in the dive so far, see [`Occurrences`]; `None` unless the alert reports an
    /// observation about the dive as a whole.
    pub occurrences: Option<u64>,
    /// Chainage of the first occurrence, m.
    pub first_m: Option<f64>,
    /// Largest deviation in any occurrence of this alert, m; 0 in alerts about a doubtful setting.
    pub worst_m: Option<f64>,
    /// Doubtful setting, as judged most recently; `None` for other alerts.
    pub setting: Option<SettingJson>,
    /// Number of the alert into which this alert was merged.
    pub merged_into: Option<u32>,
}

/// A vehicle file setting that the measured ranges contradict.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SettingJson {
    /// `range_scale`, `head_turned`, `head_pitched`, `head_yawed`, `wrong_way_round` or `swapped`.
    pub what: &'static str,
    /// Name of the sensor that has the doubtful setting; `None` if no single source has the setting.
    pub source: Option<String>,
    /// Name of the other sensor, if two sensors are swapped.
    pub other: Option<String>,
    /// Ratio of measured ranges to the ranges that the design predicts; `None` unless the range scale is doubtful.
    pub range_ratio: Option<f64>,
    /// Angle to be added to the angle in the vehicle file, degrees; `None` unless an angle is doubtful.
    ///
    /// The doubtful angle is an angle about the head's axis, a pitch or a yaw.
    pub angle_deg: Option<f64>,
    /// Difference between the file's value and the correct value, in standard deviations.
    pub sure_ratio: f64,
}

/// Acknowledgement of an alert, with person and time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AcknowledgedJson {
    /// Person or device that acknowledged the alert.
    pub by: String,
    /// Dive time of the acknowledgement, seconds.
    pub at_s: f64,
}

/// Counts of alerts that have not ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct AlertCountsJson {
    /// Number of alerts that somebody must still acknowledge.
    pub unacknowledged: u32,
    /// Number of alerts whose condition holds.
    pub active: u32,
    /// Number of emergency alarms that have not ended.
    pub emergency_alarm: u32,
    /// Number of alarms that have not ended.
    pub alarm: u32,
    /// Number of warnings that have not ended.
    pub warning: u32,
    /// Number of cautions that have not ended.
    pub caution: u32,
}

/// Remaining cable, time and charge. An unknown amount is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct LeftJson {
    /// Length of cable left beyond the vehicle's chainage, m.
    pub cable_m: Option<f64>,
    /// Remaining dive time, seconds; negative after the end of the planned dive time.
    pub time_s: Option<f64>,
    /// Charge of the battery, percent.
    pub battery_pct: Option<f64>,
}

/// A note in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoteJson {
    /// Number of the note, from 1.
    pub number: u32,
    /// Dive time of the note, seconds.
    pub at_s: f64,
    /// Author of the note.
    pub by: String,
    /// Text of the note; empty for a mark or a voice note.
    pub text: String,
    /// Recording that belongs to the note; `None` unless this is a voice note.
    pub voice: Option<SpokenJson>,
    /// Chainage of the vehicle, m; `None` without a position.
    pub chainage_m: Option<f64>,
    /// Chainage of the vehicle as stationing, such as 1+240.50.
    pub station: Option<String>,
}

/// Recording of a voice note.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SpokenJson {
    /// Id that ties the note to its recording in the log.
    pub id: u32,
    /// Length of the recording, seconds; `None` until the recording is in the log.
    pub seconds: Option<u32>,
}

impl NoteJson {
    /// Text that displays show for the note.
    pub fn words(&self) -> String {
        match &self.voice {
            Some(SpokenJson { seconds: Some(seconds), .. }) => format!("voice, {seconds} s"),
            Some(SpokenJson { seconds: None, .. }) => "voice".to_owned(),
            None if self.text.is_empty() => "mark".to_owned(),
            None => format!("note: {}", self.text),
        }
    }
}

impl NoteJson {
    /// The note as JSON.
    pub fn of(note: &Note, clock: DiveClock) -> Self {
        Self {
            number: note.number,
            at_s: clock.seconds(note.at),
            by: note.by.as_str().to_owned(),
            text: note.text.as_str().to_owned(),
            voice: note.voice.map(|Spoken { id, seconds }| SpokenJson {
                id,
                seconds: Some(seconds).filter(|seconds| *seconds > 0),
            }),
            chainage_m: note.chainage_m,
            station: note.chainage_m.map(station),
        }
    }
}

impl SettingJson {
    fn of(doubt: &SettingDoubt, sources: &[SourceInfo]) -> Self {
        let name =
            |source: u16| sources.get(usize::from(source)).map_or_else(String::new, |info| info.id.clone());
        let SettingDoubt { setting, source, sure_sd } = *doubt;
        Self {
            what: setting.as_str(),
            source: source.map(name),
            other: setting.other().map(name),
            range_ratio: matches!(setting, Setting::RangeScale(_)).then_some(1.0 + setting.figure()),
            angle_deg: setting.angle_rad().map(f64::to_degrees),
            sure_ratio: sure_sd,
        }
    }
}

impl Figures {
    /// Occurrences of the observation that the alert reports, and the doubtful setting.
    fn observed(&self) -> (Option<Occurrences>, Option<SettingDoubt>) {
        match *self {
            Self::Deviation(occurrences) => (Some(occurrences), None),
            Self::Setting(doubt, occurrences) => (Some(occurrences), Some(doubt)),
            _ => (None, None),
        }
    }
}

impl ListedAlert {
    /// The alert as JSON, with its state at time `now`.
    pub fn json(&self, around: &TextContext<'_>, now: MonoNs) -> ListedAlertJson {
        let (from_m, to_m) = self.bounds_m(around.section_m);
        let seconds = |at: Option<MonoNs>| at.map(|at| around.clock.seconds(at));
        let at_most_mps = match self.figures {
            Figures::Missed(causes, _, mps) => Some(causes.again_mps(mps)),
            Figures::Advice(figures) => Some(figures.v_max_mps),
            _ => None,
        };
        let is_missed = matches!(self.figures, Figures::Missed(..));
        let (occurrences, setting) = self.figures.observed();
        ListedAlertJson {
            number: self.number,
            priority: self.priority.as_str(),
            class: self.kind.class().as_str(),
            kind: self.kind.as_str(),
            text: self.text(around),
            advice: self.advice(around),
            state: self.state,
            since_s: around.clock.seconds(self.since),
            rectified_s: seconds(self.rectified),
            cleared_s: seconds(self.cleared),
            acknowledged: self.acknowledged.map(|by| AcknowledgedJson {
                by: by.by.as_str().to_owned(),
                at_s: around.clock.seconds(by.at),
            }),
            silenced_until_s: seconds(self.silenced_until),
            sounds: self.sounds(now),
            needs_acknowledgement: self.needs_acknowledgement(),
            from_m,
            to_m,
            back_to_m: from_m.filter(|_| is_missed).map(|from_m| around.sections.back_to_m(from_m)),
            at_most_mps: at_most_mps.filter(|mps| *mps > 0.0),
            sensor: self.source.and_then(|source| Some(around.sources.get(source.index())?.id.clone())),
            count: self.count,
            occurrences: occurrences.map(|all| all.count),
            first_m: occurrences.map(|all| all.first_m),
            worst_m: occurrences.map(|all| all.worst_m),
            setting: setting.map(|doubt| SettingJson::of(&doubt, around.sources)),
            merged_into: self.merged_into,
        }
    }
}

impl AlertList {
    /// Alerts to show, most urgent first, and the number of live alerts left out for lack of room.
    ///
    /// A few ended alerts come last.
    pub fn shown(&self) -> (Vec<&ListedAlert>, usize) {
        let mut all: Vec<&ListedAlert> = self.iter().collect();
        all.sort_by_key(|alert| alert.rank());
        let live = all.iter().filter(|alert| alert.is_live()).count();
        all.truncate(if live > RECENT { live.min(MOST_SHOWN) } else { RECENT });
        (all, live.saturating_sub(MOST_SHOWN))
    }

    /// Counts of the alerts that have not ended.
    pub fn counts(&self) -> AlertCountsJson {
        let mut counts = AlertCountsJson::default();
        for alert in self.iter().filter(|alert| alert.is_live()) {
            counts.unacknowledged += u32::from(alert.needs_acknowledgement());
            counts.active += u32::from(alert.state == AlertState::Active);
            let of_priority = match alert.priority {
                Priority::EmergencyAlarm => &mut counts.emergency_alarm,
                Priority::Alarm => &mut counts.alarm,
                Priority::Warning => &mut counts.warning,
                Priority::Caution => &mut counts.caution,
            };
            *of_priority += 1;
        }
        counts
    }

    /// Remaining cable, time and charge at the time of a live state.
    pub fn left(&self, state: &LiveState) -> LeftJson {
        LeftJson {
            cable_m: self.cable_left_m(state.chainage_m),
            time_s: self.time_left_s(state.at.unwrap_or(state.now)),
            battery_pct: self.battery_pct(),
        }
    }
}
