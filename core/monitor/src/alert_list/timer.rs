//! Hold time and dead band of a situation: decides when its alert is raised and when it ends.

use serde::{Deserialize, Serialize};

use super::kind::ListKind;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};

/// Number of timers: one for each kind of alert and each sensor. Kinds that name no sensor use the timer of the
/// first sensor.
pub(super) const COUNT: usize = ListKind::ALL.len() * MAX_SOURCES;

/// Index of the timer for a situation that can raise an alert.
pub(super) fn place(kind: ListKind, source: Option<SourceId>) -> usize {
    kind as usize * MAX_SOURCES + source.map_or(0, |source| source.index() % MAX_SOURCES)
}

/// Timer that decides when a situation's alert is raised and ends.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Timer {
    /// Number of the active alert; zero if no alert is active.
    pub(super) number: u32,
    /// Time since which the condition has held, short breaks included.
    on: Option<MonoNs>,
    /// Beginning of the present break in the condition.
    off: Option<MonoNs>,
}

/// Action on the alert that its timer requires.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// Raise: the condition has held long enough.
    Raise,
    /// Continue: the active alert goes on.
    GoesOn,
    /// End: the condition has been absent long enough.
    End,
    /// No action on the alert.
    Nothing,
}

impl Timer {
    /// Updates the timer at time `at`.
    ///
    /// A break shorter than `off` doesn't end an alert. A break shorter than `hold` doesn't restart the hold
    /// time.
    pub(super) fn take(&mut self, at: MonoNs, holds: bool, hold: DurNs, off: DurNs) -> Due {
        let is_active = self.number != 0;
        if holds {
            self.off = None;
            // A clock that goes back restarts the timer.
            let on = self.on.filter(|on| *on <= at).unwrap_or(at);
            self.on = Some(on);
            return match (is_active, at.since(on).0 >= hold.0) {
                (true, _) => Due::GoesOn,
                (false, true) => Due::Raise,
                (false, false) => Due::Nothing,
            };
        }
        if self.on.is_none() && !is_active {
            return Due::Nothing;
        }
        let begun = self.off.filter(|off| *off <= at).unwrap_or(at);
        self.off = Some(begun);
        if at.since(begun).0 < if is_active { off.0 } else { hold.0 } {
            return Due::Nothing;
        }
        (self.on, self.off) = (None, None);
        if is_active { Due::End } else { Due::Nothing }
    }
}
