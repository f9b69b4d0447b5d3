//! The list: all alerts of a dive.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use super::alert::ListedAlert;
use super::timer::{self, Timer};
use headrace_coverage::Stretch;
use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DiveClock, DurNs, MonoNs};
use headrace_vehicle::{AlertTiming, LimitsConfig};

/// Maximum number of alerts kept. Beyond this number the oldest cleared alerts are dropped, and neighbouring
/// missed stretches share an alert.
pub const MOST_LISTED: usize = 256;
/// Time for which a sound is silenced. Source: MSC.302(87).
pub const SILENCE: DurNs = DurNs(30_000_000_000);

/// Record of which kinds of data and positions have arrived so far.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Had {
    pub(super) position: bool,
    pub(super) sure_position: bool,
    pub(super) sonar: bool,
    pub(super) turning: u64,
    /// Most recent stretch without a verdict, and the time at which it grew most recently.
    pub(super) unsure: Option<(Stretch, MonoNs)>,
}

/// All alerts of a dive.
#[derive(Debug, Resource)]
pub struct AlertList {
    /// Alerts in order of their numbers.
    pub(super) alerts: Vec<ListedAlert>,
    /// Number of alerts raised so far.
    pub(super) raised: u32,
    /// Number of cleared alerts no longer kept.
    pub(super) dropped: u64,
    /// Alert number of each missed stretch, by the stretch's number; zero if it has no alert.
    pub(super) by_run: Vec<u32>,
    /// Timers that raise and end alerts, by situation.
    pub(super) timers: Vec<Timer>,
    /// Clock of the dive, from which the remaining dive time is found.
    pub(crate) clock: DiveClock,
    /// Time of the first advice update.
    pub(super) begun: Option<MonoNs>,
    /// Record of the data and positions that have arrived so far.
    pub(super) had: Had,
    /// Largest speed advised at the last advice update, m/s; zero if none.
    pub(super) v_max_mps: f64,
    /// Chainage of the vehicle at the last advice update, m.
    pub(super) x_m: Option<f64>,
    pub(super) recording_fails: bool,
    /// End and duration (seconds) of the computer's last stall.
    pub(super) stalled: Option<(MonoNs, u32)>,
    pub(super) battery_pct: Option<f64>,
    pub(super) timing: AlertTiming,
    pub(super) limits: LimitsConfig,
}

stateful!(AlertList {
    state: raised, dropped, clock, begun, had, v_max_mps, x_m, recording_fails, stalled, battery_pct;
    lists: alerts, by_run;
    slots: timers;
    fixed: timing, limits;
});

impl AlertList {
    /// Creates an empty list. `sections` is the number of sections, and so the largest possible number of
    /// missed stretches.
    ///
    /// Allocates: at startup, all memory of the list.
    pub(crate) fn new(timing: AlertTiming, limits: LimitsConfig, sections: usize) -> Self {
        Self {
            alerts: Vec::with_capacity(MOST_LISTED),
            raised: 0,
            dropped: 0,
            by_run: Vec::with_capacity(sections),
            timers: vec![Timer::default(); timer::COUNT],
            clock: DiveClock::default(),
            begun: None,
            had: Had::default(),
            v_max_mps: 0.0,
            x_m: None,
            recording_fails: false,
            stalled: None,
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
    pub(crate) fn x_m(&self) -> Option<f64> {
        self.x_m
    }

    fn place_of(&self, number: u32) -> Option<usize> {
        self.alerts.binary_search_by_key(&number, |alert| alert.number).ok()
    }

    pub(super) fn get_mut(&mut self, number: u32) -> Option<&mut ListedAlert> {
        let place = self.place_of(number)?;
        self.alerts.get_mut(place)
    }
}
