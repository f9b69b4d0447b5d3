//! An alert: its state, changes and figures.

use serde::{Deserialize, Serialize};

use super::kind::{ListKind, Priority};
use crate::console::command::Who;
use crate::observations::Occurrences;
use crate::pilot_text::{AdviceFigures, CauseFigures};
use crate::unread::WithheldReadings;
use headrace_coverage::Stretch;
use headrace_fusion::NoFix;
use headrace_fusion::filter::setting_check::SettingDoubt;
use headrace_geometry::time::MonoNs;
use headrace_sensor::reading::SourceId;

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
    /// Requirement of a position that is not met, such as a heading.
    MissingRequirement(NoFix),
    /// Position error, m, and whether staying stationary would reduce it.
    Error(f64, bool),
    /// Observation about the dive as a whole, such as a contradicted design profile.
    Deviation(Occurrences),
    /// A vehicle file setting that the measurements contradict.
    Setting(SettingDoubt, Occurrences),
    /// Time for which the computer stalled, seconds.
    Stalled(u32),
    /// Withheld readings of a sensor.
    Withheld(WithheldReadings),
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
    /// Count of the alert's missed stretches that aren't cleared yet.
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
