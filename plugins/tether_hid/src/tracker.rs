//! Converts a counter that wraps, jumps and restarts into a continuous count of cable paid out.
//!
//! - A counter wraps. Changes are therefore taken the short way round.
//! - A change faster than the winch is rejected and counted. Rejected reports are compared with each other. If
//!   [`PERSIST`] consecutive reports agree, the counter has really moved, and the reports weren't corrupt.
//!   - If the first of the agreeing reports was near zero, the device counts from zero again. The length continues from
//!     its latest value. The restart is recorded, because the device may have been replugged.
//!   - Otherwise the counter's new value is accepted.
//! - A step back to near zero is accepted at once only if the winch can cover it in a second. This rule also applies
//!   after a silence.
//! - After an accepted jump, and whenever counts may have been lost, the length is uncertain. `re_zero_needed` is then
//!   set, and stays set.

use headrace_sensor::geometry::time::{DurNs, MonoNs};
use headrace_sensor::reading::CountRestart;
use headrace_sensor::stateful;
use serde::{Deserialize, Serialize};

use crate::report::{Report, Width};

/// Number of consecutive reports, consistent with each other, that are needed to accept a jump of the count.
pub const PERSIST: u32 = 5;

/// Time added to the interval between two reports when the change of the count is checked, s. It is needed because
/// reports that were queued in the kernel arrive together, with hardly any time between them.
const SLACK_S: f64 = 0.1;

/// Maximum time for which a replugged device has already counted when its first report arrives, s.
const FRESH_S: f64 = 1.0;

/// Minimum silence of a device that is unplugged and plugged in again. Source: USB 2.0, 7.1.7.3, debounce
/// interval.
const AWAY: DurNs = DurNs::from_millis(100);

/// Meaning of a report's count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counting {
    /// Count since the device's zero. The count wraps.
    Absolute,
    /// Change of the count since the previous report.
    Delta,
}

/// Health of a cable counter's tracking. The numbers only grow, and the flag stays set once it is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TrackerHealth {
    /// Number of reports rejected because the change was faster than the winch.
    pub rejected: u64,
    /// Number of reports missing from the sequence.
    pub lost: u64,
    /// Whether counts may have been lost, so that the zero of the cable length is uncertain.
    pub re_zero_needed: bool,
}

/// Tracks the count of a cable counter through wraps, jumps and restarts.
#[derive(Debug, Clone)]
pub struct CountTracker {
    counting: Counting,
    width: Width,
    max_counts_per_s: f64,
    accepted: Option<Seen>,
    jumped: Option<Jump>,
    sequence: Option<u8>,
    total: i64,
    health: TrackerHealth,
    restart: Option<CountRestart>,
}

stateful!(CountTracker { state: accepted, jumped, sequence, total, health, restart; fixed: counting, width, max_counts_per_s; });

/// A count with its receive time.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Seen {
    count: i64,
    at: MonoNs,
}

/// Consecutive rejected reports that agree with each other.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
struct Jump {
    from_zero: bool,
    /// Time of the first of the rejected reports that agree.
    since: MonoNs,
    last: Seen,
    agreeing: u32,
}

impl CountTracker {
    /// Creates a tracker; `max_counts_per_s` is the maximum speed of the winch or the vehicle, in counts per second.
    pub fn new(counting: Counting, width: Width, max_counts_per_s: f64) -> Self {
        Self {
            counting,
            width,
            max_counts_per_s,
            accepted: None,
            jumped: None,
            sequence: None,
            total: 0,
            health: TrackerHealth::default(),
            restart: None,
        }
    }

    /// The latest restart of the count from zero, if any.
    pub fn restart(&self) -> Option<CountRestart> {
        self.restart
    }

    /// Health of the counter's tracking.
    pub fn health(&self) -> TrackerHealth {
        self.health
    }

    /// Processes a report received at `at`; returns the counts since zero, or `None` if the report is rejected.
    pub fn take(&mut self, at: MonoNs, report: &Report) -> Option<i64> {
        let repeated = self.note_sequence(report.sequence);
        let now = Seen { count: report.count, at };
        match self.counting {
            // A repeated change must not be added twice. Reading the same absolute count twice is harmless.
            Counting::Delta if repeated => None,
            Counting::Delta => self.take_delta(now),
            Counting::Absolute => self.take_absolute(now),
        }
    }

    fn note_sequence(&mut self, sequence: Option<u8>) -> bool {
        let before = core::mem::replace(&mut self.sequence, sequence);
        let (Some(before), Some(sequence)) = (before, sequence) else { return false };
        if before == sequence {
            return true;
        }
        let lost = sequence.wrapping_sub(before).wrapping_sub(1);
        self.health.lost += u64::from(lost);
        self.health.re_zero_needed |= lost > 0 && self.counting == Counting::Delta;
        false
    }

    fn take_delta(&mut self, now: Seen) -> Option<i64> {
        let before = self.accepted.replace(now);
        if before.is_some_and(|before| !self.reaches(before.at, now.at, now.count)) {
            self.health.rejected += 1;
            self.health.re_zero_needed = true;
            return None;
        }
        self.total = self.total.saturating_add(now.count);
        Some(self.total)
    }

    fn take_absolute(&mut self, now: Seen) -> Option<i64> {
        let Some(before) = self.accepted else {
            self.accepted = Some(now);
            self.total = now.count;
            return Some(self.total);
        };
        if let Some(jump) = self.jumped
            && self.reaches(jump.last.at, now.at, self.width.difference(jump.last.count, now.count))
        {
            return self.agree(before, jump, now);
        }
        let change = self.width.difference(before.count, now.count);
        let from_zero = self.within(FRESH_S, self.width.difference(0, now.count));
        let back_at_once = from_zero && !self.within(FRESH_S, change);
        if back_at_once || !self.reaches(before.at, now.at, change) {
            self.health.rejected += 1;
            self.jumped = Some(Jump { from_zero, since: now.at, last: now, agreeing: 1 });
            return None;
        }
        // During a long silence, the counter may have wrapped any number of times.
        let half = (1_u64 << self.width.bits()) as f64 / 2.0;
        self.health.re_zero_needed |= self.max_counts_per_s * now.at.since(before.at).as_secs_f64() >= half;
        self.accept(now, change)
    }

    /// Handles another report that agrees with the rejected reports of a possible jump.
    fn agree(&mut self, before: Seen, jump: Jump, now: Seen) -> Option<i64> {
        let agreeing = jump.agreeing + 1;
        if agreeing < PERSIST {
            self.health.rejected += 1;
            self.jumped = Some(Jump { last: now, agreeing, ..jump });
            return None;
        }
        self.health.re_zero_needed = true;
        if jump.from_zero {
            let number = self.restart.map_or(0, |restart| restart.number).saturating_add(1);
            let silence_ns = jump.since.since(before.at).0;
            let period_ns = now.at.since(jump.since).0 / i64::from(PERSIST - 1);
            let was_away = silence_ns >= AWAY.0 && silence_ns > period_ns.saturating_mul(2);
            self.restart = Some(CountRestart { number, was_away });
        }
        let reference = if jump.from_zero { 0 } else { before.count };
        self.accept(now, self.width.difference(reference, now.count))
    }

    #[expect(clippy::unnecessary_wraps, reason = "the callers pass it on")]
    fn accept(&mut self, now: Seen, change: i64) -> Option<i64> {
        self.jumped = None;
        self.accepted = Some(now);
        self.total = self.total.saturating_add(change);
        Some(self.total)
    }

    /// Whether the winch can have moved the cable by `change` counts between two times.
    fn reaches(&self, from: MonoNs, to: MonoNs, change: i64) -> bool {
        self.within(to.since(from).as_secs_f64().max(0.0), change)
    }

    /// Whether the winch can have moved the cable by `change` counts in `elapsed_s`. One count more than the winch can
    /// do is allowed, because counts are rounded.
    fn within(&self, elapsed_s: f64, change: i64) -> bool {
        (change as f64).abs() <= self.max_counts_per_s * (elapsed_s + SLACK_S) + 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Maximum count rate: three metres per second at 2000 counts per metre.
    const FASTEST: f64 = 6000.0;

    fn at_ms(ms: u64) -> MonoNs {
        MonoNs(ms * 1_000_000)
    }

    fn counted(count: i64) -> Report {
        Report { sequence: None, status: None, count, auxiliary: None }
    }

    fn take_all(tracker: &mut CountTracker, counts: &[i64]) -> Vec<Option<i64>> {
        let reports = counts.iter().zip(0..);
        reports.map(|(count, i)| tracker.take(at_ms(20 * i), &counted(*count))).collect()
    }

    #[test]
    fn length_is_continuous_where_a_narrow_counter_wraps() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits8, FASTEST);
        let totals = take_all(&mut tracker, &[250, 6, 20, 250, 6]);
        assert_eq!(totals, [250, 262, 276, 250, 262].map(Some));
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits16, FASTEST);
        assert_eq!(take_all(&mut tracker, &[65_530, 4, 65_530]), [65_530, 65_540, 65_530].map(Some));
        assert_eq!(tracker.health(), TrackerHealth::default());
    }

    #[test]
    fn garbled_report_is_rejected_without_changing_the_length() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        let totals = take_all(&mut tracker, &[120_000, 0, 120_010, -9_000_000, 120_020]);
        assert_eq!(totals, [Some(120_000), None, Some(120_010), None, Some(120_020)]);
        assert_eq!(tracker.health(), TrackerHealth { rejected: 2, ..TrackerHealth::default() });
    }

    #[test]
    fn replugged_device_continues_from_the_length_before_unplugging() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        let totals = take_all(&mut tracker, &[120_000, 0, 2, 4, 6, 8, 10]);
        assert_eq!(totals, [Some(120_000), None, None, None, None, Some(120_008), Some(120_010)]);
        let health = TrackerHealth { rejected: 4, lost: 0, re_zero_needed: true };
        assert_eq!(tracker.health(), health);
    }

    #[test]
    fn restart_after_a_long_silence_keeps_the_length_before_the_silence() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        tracker.take(at_ms(0), &counted(120_000));
        let totals = (0..5).map(|i| tracker.take(at_ms(60_000 + 20 * i), &counted(300 + i as i64)));
        assert_eq!(totals.last(), Some(Some(120_304)));
        assert!(tracker.health().re_zero_needed);
    }

    #[test]
    fn count_restarted_from_zero_is_marked_with_or_without_prior_silence() {
        for (silence_ms, was_away) in [(20, false), (60_000, true)] {
            let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
            tracker.take(at_ms(0), &counted(120_000));
            assert_eq!(tracker.restart(), None);
            for (count, i) in [0, 2, 4, 6, 8].into_iter().zip(0..) {
                tracker.take(at_ms(silence_ms + 20 * i), &counted(count));
            }
            assert_eq!(tracker.restart(), Some(CountRestart { number: 1, was_away }));
        }
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        take_all(&mut tracker, &[120_000, 90_000, 90_001, 90_002, 90_003, 90_004]);
        assert_eq!(tracker.restart(), None, "a jump isn't a restart");
    }

    #[test]
    fn slow_reports_of_a_replugged_device_continue_from_the_length_before_unplugging() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        let counts = [20_000, 0, 100, 200, 300, 400];
        let totals = counts.iter().zip(0..).map(|(count, s)| tracker.take(at_ms(1000 * s), &counted(*count)));
        assert_eq!(totals.last(), Some(Some(20_400)));
    }

    #[test]
    fn persistent_jump_of_the_count_is_accepted() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        let totals = take_all(&mut tracker, &[120_000, 90_000, 90_001, 90_002, 90_003, 90_004]);
        assert_eq!(totals, [Some(120_000), None, None, None, None, Some(90_004)]);
        assert!(tracker.health().re_zero_needed);
    }

    #[test]
    fn reports_received_at_the_same_time_are_not_rejected_as_too_fast() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits32, FASTEST);
        for report in 0..50 {
            let total = tracker.take(at_ms(1000), &counted(report * 120));
            assert_eq!(total, Some(report * 120));
        }
    }

    #[test]
    fn silence_long_enough_to_wrap_marks_the_length_uncertain() {
        let mut tracker = CountTracker::new(Counting::Absolute, Width::Bits16, FASTEST);
        tracker.take(at_ms(0), &counted(0));
        assert_eq!(tracker.take(at_ms(5000), &counted(100)), Some(100));
        assert!(!tracker.health().re_zero_needed);
        assert_eq!(tracker.take(at_ms(11_000), &counted(200)), Some(200));
        assert!(tracker.health().re_zero_needed);
    }

    #[test]
    fn repeated_report_of_a_change_is_added_once() {
        let mut tracker = CountTracker::new(Counting::Delta, Width::Bits8, FASTEST);
        let mut take = |ms, sequence, count| {
            let report = Report { sequence: Some(sequence), ..counted(count) };
            (tracker.take(at_ms(ms), &report), tracker.health())
        };
        let good = TrackerHealth::default();
        assert_eq!(take(0, 254, 5), (Some(5), good));
        assert_eq!(take(20, 255, -7), (Some(-2), good));
        assert_eq!(take(20, 255, -7), (None, good));
        assert_eq!(take(40, 0, 2), (Some(0), good));
        let marked = TrackerHealth { rejected: 0, lost: 2, re_zero_needed: true };
        assert_eq!(take(100, 3, 1), (Some(1), marked));
    }

    #[test]
    fn change_faster_than_the_winch_is_skipped_and_reported() {
        let mut tracker = CountTracker::new(Counting::Delta, Width::Bits32, FASTEST);
        let totals = take_all(&mut tracker, &[5, 5, 800_000, 5]);
        assert_eq!(totals, [Some(5), Some(10), None, Some(15)]);
        assert_eq!(tracker.health(), TrackerHealth { rejected: 1, lost: 0, re_zero_needed: true });
    }
}
