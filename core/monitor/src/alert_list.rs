//! List of alerts with the life cycle of IMO MSC.302(87): raised, acknowledged, silenced, rectified, cleared.
//!
//! Each situation has one alert, whose number never changes. Conditions are checked at each update. Missed
//! stretches are added when their sections are judged. Commands take effect at their place in the packet
//! stream. The list is therefore the same in a replay, however the stream was cut into ticks. The list holds
//! figures, no texts: [`texts`] makes the texts for display. `docs/reference/alerts.md` has the table.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::console::Who;
pub use super::observations::{Occurrence, Occurrences};
use super::pilot_text::{AdviceFigures, CauseFigures};
use headrace_coverage::Stretch;
use headrace_fusion::NoFix;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;
use headrace_vehicle::{AlertTiming, LimitsConfig};

mod conditions;
pub mod json;
mod kind;
mod life_cycle;
mod runs;
pub mod texts;
mod timer;

pub(super) use conditions::Beat;
pub use json::{AlertCountsJson, LeftJson, ListedAlertJson, NoteJson, SettingJson, SpokenJson};
pub use kind::{AlertClass, ListKind, Priority};
pub(super) use life_cycle::Telling;
pub(super) use runs::RunInput;
pub use texts::TextContext;
use timer::Timer;

/// Maximum number of alerts kept. Beyond this number the oldest cleared alerts are dropped, and neighbouring
/// missed stretches share an alert.
pub const MOST_LISTED: usize = 256;
/// Time for which a sound is silenced. Source: MSC.302(87).
pub const SILENCE: DurNs = DurNs(30_000_000_000);

/// State of an alert in its life cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlertState {
    /// The alert's condition holds.
    Active,
    /// The condition no longer holds, but nobody has acknowledged the alert yet.
    Rectified,
    /// The alert has ended.
    Cleared,
}

/// Kind of change of an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlertChange {
    /// The alert is new, or its condition holds again.
    Raised,
    /// Somebody has acknowledged the alert.
    Acknowledged,
    /// The alert's sound is silenced for a while.
    Silenced,
    /// The condition no longer holds, and the alert waits for acknowledgement.
    Rectified,
    /// The alert has ended.
    Cleared,
    /// The alert's place, extent, figures or priority has changed.
    Changed,
}

impl AlertChange {
    /// Word used for the change in JSON.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Raised => "raised",
            Self::Acknowledged => "acknowledged",
            Self::Silenced => "silenced",
            Self::Rectified => "rectified",
            Self::Cleared => "cleared",
            Self::Changed => "changed",
        }
    }
}

/// Acknowledgement of an alert: person and time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Acknowledgement {
    /// Person or device that acknowledged the alert.
    pub by: Who,
    /// Time of the acknowledgement.
    pub at: MonoNs,
}

/// Figures with which an alert's texts are made.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Figures {
    /// The alert has no figures.
    None,
    /// Missed stretch: causes, arc length of the largest hole, m, and the speed advised when the alert was
    /// raised, m/s.
    ///
    /// The speed is zero if no speed was advised.
    Missed(CauseFigures, f64, f64),
    /// Figures of a stretch without a verdict.
    CannotSay(Stretch),
    /// Present speed and speed advice.
    Advice(AdviceFigures),
    /// Requirements that are missing for a position.
    MissingRequirement(NoFix),
    /// Position error, m, and whether staying stationary would reduce it.
    Error(f64, bool),
    /// Observation about the dive as a whole, such as a contradicted design profile.
    Deviation(Occurrences),
    /// A vehicle file setting that the measurements contradict.
    Setting(SettingDoubt, Occurrences),
    /// Remaining cable (m), time (seconds) or battery charge (percent).
    Left(f64),
}

/// An alert in the list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ListedAlert {
    /// Number of the alert, from 1; never reused.
    pub number: u32,
    /// Kind of the alert.
    pub kind: ListKind,
    /// Priority of the alert.
    pub priority: Priority,
    /// State of the alert in its life cycle.
    pub state: AlertState,
    /// Time at which the alert was first raised.
    pub since: MonoNs,
    /// Time at which the alert's condition ceased to hold.
    pub rectified: Option<MonoNs>,
    /// Time at which the alert ended.
    pub cleared: Option<MonoNs>,
    /// Acknowledgement of the alert, if any.
    pub acknowledged: Option<Acknowledgement>,
    /// Time until which the alert's sound is silenced.
    pub silenced_until: Option<MonoNs>,
    /// Sensor that the alert names.
    pub source: Option<SourceId>,
    /// Index of the missed stretch's first section, and index after its last section.
    pub stretch: Option<(i64, i64)>,
    /// Chainage of the vehicle when the alert was raised, m; `None` for an alert with a stretch.
    pub x_m: Option<f64>,
    /// Number of times that the alert was raised. For missed stretches: number of stretches that the alert
    /// represents.
    pub count: u32,
    /// Number of the alert's runs of flagged sections that aren't cleared yet.
    pub(super) open_runs: u32,
    /// Number of the alert into which this alert was merged.
    pub merged_into: Option<u32>,
    /// Figures for the alert's texts.
    pub figures: Figures,
}

impl ListedAlert {
    /// Whether the alert is live: it has not ended.
    pub fn is_live(&self) -> bool {
        self.state != AlertState::Cleared
    }

    /// Whether somebody must still acknowledge the alert.
    pub fn needs_acknowledgement(&self) -> bool {
        self.is_live() && self.priority != Priority::Caution && self.acknowledged.is_none()
    }

    /// Whether the alert sounds at `now`: its condition holds, and nobody has acknowledged or silenced it.
    pub fn sounds(&self, now: MonoNs) -> bool {
        let is_silenced = self.silenced_until.is_some_and(|until| now < until);
        self.state == AlertState::Active && self.needs_acknowledgement() && !is_silenced
    }

    /// Sort key for a list: most urgent first, newest first among equals.
    pub fn rank(&self) -> (u8, core::cmp::Reverse<u32>) {
        let rank = match (self.state, self.needs_acknowledgement(), self.priority) {
            (AlertState::Cleared, ..) => 6,
            (AlertState::Rectified, true, _) => 3,
            (_, true, Priority::EmergencyAlarm) => 0,
            (_, true, Priority::Alarm) => 1,
            (_, true, _) => 2,
            (_, false, Priority::Caution) => 5,
            (_, false, _) => 4,
        };
        (rank, core::cmp::Reverse(self.number))
    }
}

/// All alerts of a dive.
#[derive(Debug, Resource)]
pub struct AlertList {
    /// Alerts in order of their numbers.
    alerts: Vec<ListedAlert>,
    /// Number of alerts raised so far.
    raised: u32,
    /// Number of cleared alerts no longer kept.
    dropped: u64,
    /// For each run of flagged sections: number of its alert, or zero.
    by_run: Vec<u32>,
    /// Timers that raise and end alerts, by situation.
    timers: Vec<Timer>,
    /// Time of the first advice update.
    begun: Option<MonoNs>,
    /// Record of the data and positions that have arrived so far.
    had: conditions::Had,
    /// Largest speed advised at the last advice update, m/s; zero if none.
    v_max_mps: f64,
    /// Chainage of the vehicle at the last advice update, m.
    x_m: Option<f64>,
    recording_fails: bool,
    battery_pct: Option<f64>,
    timing: AlertTiming,
    limits: LimitsConfig,
}

stateful!(AlertList {
    state: raised, dropped, begun, had, v_max_mps, x_m, recording_fails, battery_pct;
    lists: alerts, by_run;
    slots: timers;
    fixed: timing, limits;
});

impl AlertList {
    /// Creates an empty list. `sections` is the number of sections, and so the largest possible number of
    /// runs.
    ///
    /// Allocates: at startup, all memory of the list.
    pub(super) fn new(timing: AlertTiming, limits: LimitsConfig, sections: usize) -> Self {
        Self {
            alerts: Vec::with_capacity(MOST_LISTED),
            raised: 0,
            dropped: 0,
            by_run: Vec::with_capacity(sections),
            timers: vec![Timer::default(); timer::COUNT],
            begun: None,
            had: conditions::Had::default(),
            v_max_mps: 0.0,
            x_m: None,
            recording_fails: false,
            battery_pct: None,
            timing,
            limits,
        }
    }

    /// All alerts kept, in order of their numbers.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &ListedAlert> + Clone {
        self.alerts.iter()
    }

    /// Alert with this number.
    pub fn get(&self, number: u32) -> Option<&ListedAlert> {
        self.alerts.get(self.place_of(number)?)
    }

    /// Number of alerts raised so far.
    pub fn raised(&self) -> u32 {
        self.raised
    }

    /// Number of cleared alerts no longer kept.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Last reported charge of the vehicle's battery, percent.
    pub fn battery_pct(&self) -> Option<f64> {
        self.battery_pct
    }

    /// Chainage of the vehicle at the last advice update, m.
    pub(super) fn x_m(&self) -> Option<f64> {
        self.x_m
    }

    fn place_of(&self, number: u32) -> Option<usize> {
        self.alerts.binary_search_by_key(&number, |alert| alert.number).ok()
    }

    fn get_mut(&mut self, number: u32) -> Option<&mut ListedAlert> {
        let place = self.place_of(number)?;
        self.alerts.get_mut(place)
    }
}

#[cfg(test)]
mod tests;
