//! Decides whether the cable counter still counts from its first zero.
//!
//! A count that restarts from zero gives no position. The counter may have been plugged in again or replaced, or the
//! log may have jumped back to an earlier time of the dive. The chainage is kept only if the counter alone was silent,
//! so that the other sensors carried the estimate. Derivation: `docs/why/navigation.md`, "When a counter begins again
//! from zero".

use headrace_geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::TetherLength;
use serde::{Deserialize, Serialize};

/// Detector of a cable counter that no longer counts from its first zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct CounterZero {
    /// Number of the counter's last restart.
    restarts: u32,
    /// Time of the counter's last reading.
    heard: Option<MonoNs>,
    /// `others` is the time of the last reading of any other sensor. `silence` is the longest silence of all other
    /// sensors since the counter's last reading.
    others: Option<MonoNs>,
    silence: DurNs,
    is_lost: bool,
}

impl CounterZero {
    /// Whether the counter has lost its zero, so that its count shows no chainage.
    pub fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Records the receive time of a reading from any sensor but the cable counter.
    pub fn hear_other(&mut self, received: MonoNs) {
        let before = self.others.replace(received).unwrap_or(received);
        self.silence = self.silence.max(received.since(before));
    }

    /// Processes a reading of the cable counter; `is_sure` means that the chainage is known without the counter.
    pub fn hear(&mut self, received: MonoNs, length: &TetherLength, is_sure: bool) {
        let number = length.restart.map_or(0, |restart| restart.number);
        let before = core::mem::replace(&mut self.restarts, number);
        let others = received.since(self.others.unwrap_or(received)).max(self.silence);
        self.silence = DurNs(0);
        let Some(heard) = self.heard.replace(received) else { return };
        let was_away = length.restart.is_some_and(|restart| restart.was_away);
        // If the whole vehicle or the log stops, all sensors are silent for about the same time. So the counter alone
        // was silent only if its silence is over twice as long as that of the other sensors.
        let is_alone = others.0.saturating_mul(2) < received.since(heard).0;
        self.is_lost |= number != before && !(was_away && is_alone && is_sure);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_sensor::reading::CountRestart;

    fn length(restart: Option<CountRestart>) -> TetherLength {
        TetherLength { length_m: 30.0, resolution_m: 0.001, restart }
    }

    /// Whether the counter's zero is lost after the counter and the other sensors were silent for these times, ms.
    fn is_lost(counter_ms: u64, others_ms: u64, was_away: bool, is_sure: bool) -> bool {
        let at = |ms: u64| MonoNs(1_000_000_000 + 1_000_000 * ms);
        let mut zero = CounterZero::default();
        zero.hear_other(at(0));
        zero.hear(at(0), &length(None), true);
        for ms in (others_ms..=counter_ms).step_by(10) {
            zero.hear_other(at(ms));
        }
        zero.hear(at(counter_ms), &length(Some(CountRestart { number: 1, was_away })), is_sure);
        zero.is_lost()
    }

    #[test]
    fn counter_restart_keeps_the_zero_only_if_the_other_sensors_kept_sending() {
        assert!(!is_lost(1000, 10, true, true));
        assert!(is_lost(1000, 10, false, true), "the counter was not away");
        assert!(is_lost(1000, 900, true, true), "all sensors were silent");
        assert!(is_lost(1000, 10, true, false), "the chainage was unknown without it");
    }

    #[test]
    fn counter_restart_before_the_first_reading_keeps_the_zero() {
        let mut zero = CounterZero::default();
        let restart = Some(CountRestart { number: 3, was_away: false });
        for ms in 0..3 {
            zero.hear(MonoNs(1_000_000 * ms), &length(restart), false);
            assert!(!zero.is_lost());
        }
    }
}
