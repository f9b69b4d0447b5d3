//! Alerts with a life, as at sea (IMO MSC.302(87)): raised, acknowledged, silenced, rectified, cleared. One alert per situation,
//! by a number that stays.
//!
//! What holds is found at the beats, and missed stretches when they are judged; commands take effect where they were consumed. So
//! the list is the same in a replay, however the stream was cut into ticks. It has figures, no words: [`words`] makes those when
//! they are shown. `docs/reference/alerts.md` has the table.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::console::Who;
use super::pilot_text::{AdviceFigures, CauseFigures};
use headrace_coverage::Stretch;
use headrace_fusion::NoFix;
use headrace_fusion::filter::suspicion::SettingDoubt;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::SourceId;
use headrace_vehicle::{AlertTiming, LimitsConfig};

pub mod json;
mod kind;
mod life;
mod observed;
mod runs;
mod timer;
pub mod words;

pub use json::{AlertCountsJson, LeftJson, ListedAlertJson, NoteJson, SpokenJson};
pub use kind::{AlertClass, ListKind, Priority};
pub(super) use life::Telling;
pub(super) use observed::Beat;
pub(super) use runs::RunInput;
use timer::Timer;
pub use words::Surroundings;

/// Alerts that are kept. Beyond, the oldest cleared ones are dropped, and missed stretches share an alert with their neighbours.
pub const MOST_LISTED: usize = 256;
/// How long a sound is silenced. Source: MSC.302(87).
pub const SILENCE: DurNs = DurNs(30_000_000_000);

/// Where an alert is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlertState {
    /// What it tells of holds.
    Active,
    /// It holds no longer, and nobody has acknowledged it yet.
    Rectified,
    /// It is over.
    Cleared,
}

/// What has happened to an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AlertChange {
    /// It is new, or holds again.
    Raised,
    /// Somebody knows of it.
    Acknowledged,
    /// Its sound is off for a while.
    Silenced,
    /// It holds no longer, and waits to be acknowledged.
    Rectified,
    /// It is over.
    Cleared,
    /// Its place, extent, figures or priority have changed.
    Changed,
}

impl AlertChange {
    /// The word used in JSON.
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

/// Who has acknowledged an alert, and when.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Acknowledgement {
    /// By whom.
    pub by: Who,
    /// When.
    pub at: MonoNs,
}

/// What the words of an alert need.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Figures {
    /// Nothing.
    None,
    /// Of a missed stretch: causes, arc length of the largest hole, m, and the speed advised when it was raised, m/s, zero
    /// if none.
    Missed(CauseFigures, f64, f64),
    /// Of a stretch of which nothing can be said.
    CannotSay(Stretch),
    /// Speed and advice.
    Advice(AdviceFigures),
    /// What is lacking for a position.
    Lacking(NoFix),
    /// By how much the position may be off, m, and whether standing still would help.
    Error(f64, bool),
    /// Of an alert about the dive as a whole: place and largest deviation, m.
    Deviation(f64, f64),
    /// A setting in doubt, and the place where it was found, m.
    Setting(SettingDoubt, f64),
    /// What is left: m, seconds or percent.
    Left(f64),
}

/// An alert of the list.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ListedAlert {
    /// Its number, from 1; never given again.
    pub number: u32,
    /// Its kind.
    pub kind: ListKind,
    /// Its priority.
    pub priority: Priority,
    /// Where it is in its life.
    pub state: AlertState,
    /// When it was raised first.
    pub since: MonoNs,
    /// Since when it holds no longer.
    pub rectified: Option<MonoNs>,
    /// Since when it is over.
    pub cleared: Option<MonoNs>,
    /// Who knows of it.
    pub acknowledged: Option<Acknowledgement>,
    /// Until when its sound is off.
    pub silenced_until: Option<MonoNs>,
    /// The sensor that it names.
    pub source: Option<SourceId>,
    /// Sections from which and before which it holds.
    pub stretch: Option<(i64, i64)>,
    /// Where the vehicle was when it was raised, m; of an alert with a stretch, `None`.
    pub x_m: Option<f64>,
    /// Times that it was raised; of missed stretches, those that it stands for.
    pub count: u32,
    /// Runs of flagged sections that are open in it.
    pub(super) open_runs: u32,
    /// The alert that stands for it now.
    pub merged_into: Option<u32>,
    /// What its words need.
    pub figures: Figures,
}

impl ListedAlert {
    /// Whether it isn't over.
    pub fn is_live(&self) -> bool {
        self.state != AlertState::Cleared
    }

    /// Whether somebody must still acknowledge it.
    pub fn needs_acknowledgement(&self) -> bool {
        self.is_live() && self.priority != Priority::Caution && self.acknowledged.is_none()
    }

    /// Whether it sounds at `now`: it holds, nobody has acknowledged it, and it isn't silenced.
    pub fn sounds(&self, now: MonoNs) -> bool {
        let is_silenced = self.silenced_until.is_some_and(|until| now < until);
        self.state == AlertState::Active && self.needs_acknowledgement() && !is_silenced
    }

    /// Its place in a list: what is most urgent first, and of those the newest.
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

/// All alerts.
#[derive(Debug, Resource)]
pub struct AlertList {
    /// By number.
    alerts: Vec<ListedAlert>,
    /// Alerts raised so far.
    raised: u32,
    /// Cleared ones that are no longer kept.
    dropped: u64,
    /// By run of flagged sections: the number of its alert, or zero.
    by_run: Vec<u32>,
    /// By situation.
    timers: Vec<Timer>,
    /// Since when there are beats.
    begun: Option<MonoNs>,
    /// What has been there once, of [`observed`].
    had: observed::Had,
    /// The largest speed advised at the last beat, m/s; zero if none.
    v_max_mps: f64,
    /// The vehicle's place at the last beat, m.
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
    /// None yet. `sections` is the number of sections, the most runs that there can be.
    ///
    /// Allocates: startup only; all that it will ever use.
    pub(super) fn new(timing: AlertTiming, limits: LimitsConfig, sections: usize) -> Self {
        Self {
            alerts: Vec::with_capacity(MOST_LISTED),
            raised: 0,
            dropped: 0,
            by_run: Vec::with_capacity(sections),
            timers: vec![Timer::default(); timer::COUNT],
            begun: None,
            had: observed::Had::default(),
            v_max_mps: 0.0,
            x_m: None,
            recording_fails: false,
            battery_pct: None,
            timing,
            limits,
        }
    }

    /// All that are kept, by number.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &ListedAlert> + Clone {
        self.alerts.iter()
    }

    /// The alert of a number.
    pub fn get(&self, number: u32) -> Option<&ListedAlert> {
        self.alerts.get(self.place_of(number)?)
    }

    /// Alerts raised so far.
    pub fn raised(&self) -> u32 {
        self.raised
    }

    /// Cleared alerts that are no longer kept.
    pub fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Charge of the vehicle's battery as last told, percent.
    pub fn battery_pct(&self) -> Option<f64> {
        self.battery_pct
    }

    /// The vehicle's place at the last beat, m.
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
