//! Advice history: speed advice shown during the dive.

use bevy_ecs::prelude::Resource;
use serde::{Deserialize, Serialize};

use headrace_geometry::snapshot::stateful;
use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sampling::advice::Advice;

/// Time between two updates of the advice, in data time.
pub const ADVICE_PERIOD: DurNs = DurNs(200_000_000);

/// One entry of the advice history.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AdviceEntry {
    /// Time of the entry, in data time.
    pub at: MonoNs,
    /// Chainage of the vehicle at the entry's time, m; `None` without a fix.
    pub chainage_m: Option<f64>,
    /// Speed of the vehicle at the entry's time, m/s.
    pub speed_mps: f64,
    /// Speed advice shown at the entry's time.
    pub advice: Advice,
}

/// Advice history: speed advice shown during the dive.
///
/// An entry is added when the advice has changed significantly, or after ten seconds. When the history is
/// full, every other entry is dropped and the minimum time between entries is doubled. The history of a long
/// dive therefore still spans the whole dive, but with fewer entries per minute.
#[derive(Debug, Clone, Resource)]
pub struct AdviceLog {
    /// Entries of the advice history, in order of time.
    pub entries: Vec<AdviceEntry>,
    /// Number of advice entries dropped for lack of room.
    pub dropped: u64,
    /// Minimum time between two entries of the advice history.
    apart: DurNs,
}

stateful!(AdviceLog { state: dropped, apart; lists: entries; });

impl Default for AdviceLog {
    fn default() -> Self {
        Self { entries: Vec::with_capacity(Self::CAPACITY), dropped: 0, apart: DurNs(0) }
    }
}

impl AdviceLog {
    /// Maximum number of entries. An entry takes about 400 bytes.
    const CAPACITY: usize = 1 << 13;
    const EVERY: DurNs = DurNs(10_000_000_000);
    const CHANGE_MPS: f64 = 0.01;

    pub(super) fn take(&mut self, entry: &AdviceEntry) {
        let unchanged = |last: &AdviceEntry| {
            last.advice.reason == entry.advice.reason
                && last.advice.will_exceed == entry.advice.will_exceed
                && (last.advice.v_max_mps - entry.advice.v_max_mps).abs() < Self::CHANGE_MPS
                && (last.speed_mps - entry.speed_mps).abs() < Self::CHANGE_MPS
                && entry.at.since(last.at).0 < Self::EVERY.0
        };
        if self.entries.last().is_some_and(unchanged) {
            return;
        }
        if self.entries.last().is_some_and(|last| entry.at.since(last.at).0 < self.apart.0) {
            self.dropped += 1;
            return;
        }
        if self.entries.len() == Self::CAPACITY {
            self.thin_out();
        }
        self.entries.push(*entry);
    }

    fn thin_out(&mut self) {
        let before = self.entries.len();
        let mut number = 0_usize;
        self.entries.retain(|_| {
            number += 1;
            number % 2 == 1
        });
        self.dropped += (before - self.entries.len()) as u64;
        self.apart = DurNs((2 * self.apart.0).max(2 * ADVICE_PERIOD.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{advice, situation};

    /// Advice that changes at every update for ten hours is logged from beginning to end within the capacity.
    #[test]
    fn ten_hours_of_advice_fit_into_the_history() {
        let advice = advice(&situation(None));
        let mut log = AdviceLog::default();
        let room = log.entries.capacity();
        let updates = 180_000_u32;
        for update in 0..updates {
            let at = MonoNs(u64::from(update) * ADVICE_PERIOD.0.unsigned_abs());
            let speed_mps = f64::from(update % 2);
            log.take(&AdviceEntry { at, chainage_m: None, speed_mps, advice });
        }
        assert_eq!(log.entries.capacity(), room);
        assert!(log.entries.len() > AdviceLog::CAPACITY / 2 - 1, "{}", log.entries.len());
        assert!(log.dropped > 0, "dropped entries are counted");
        let apart_s = log.entries.windows(2).map(|two| two[1].at.since(two[0].at).as_secs_f64());
        assert!(apart_s.fold(0.0, f64::max) < 12.0);
        assert_eq!(log.entries[0].at, MonoNs(0));
    }
}
