//! Hold time and dead band of a situation: when what holds is told, and when it is over.

use serde::{Deserialize, Serialize};

use super::ListKind;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::{MAX_SOURCES, SourceId};

/// Number of situations: one of each kind, and one of each kind and sensor where it names one.
pub(super) const COUNT: usize = ListKind::ALL.len() * MAX_SOURCES;

/// Place of a situation's timer.
pub(super) fn place(kind: ListKind, source: Option<SourceId>) -> usize {
    kind as usize * MAX_SOURCES + source.map_or(0, |source| source.index() % MAX_SOURCES)
}

/// A situation.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Timer {
    /// Number of its alert while that is active; zero else.
    pub(super) number: u32,
    /// Since when it has held, short breaks included.
    on: Option<MonoNs>,
    /// Since when it hasn't, within a break.
    off: Option<MonoNs>,
}

/// What is due.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Due {
    /// It has held for long enough.
    Raise,
    /// It goes on.
    GoesOn,
    /// It hasn't held for long enough.
    End,
    /// Neither.
    Nothing,
}

impl Timer {
    /// Takes what holds at `at`. A break shorter than `off` ends nothing, one shorter than `hold` begins nothing anew.
    pub(super) fn take(&mut self, at: MonoNs, holds: bool, hold: DurNs, off: DurNs) -> Due {
        let is_active = self.number != 0;
        if holds {
            self.off = None;
            // A clock that goes back begins anew.
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
