//! Receive times of data that were read late, in one burst.
//!
//! While the computer or a line stalls, a device's data wait, and then all of them are read at once. Each part of the
//! data gets the time at which it would have been read without the stall. This time follows from the device's usual
//! period, or from spreading the data evenly over the stall.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use headrace_geometry::time::{DurNs, MonoNs};

/// Shortest and longest gap before a burst. Shorter gaps are ordinary jitter. After a longer gap, the times of the data
/// aren't known, because the computer was suspended, or because the data may be from any part of the gap.
const SHORTEST: DurNs = DurNs::from_millis(100);
const LONGEST: DurNs = DurNs::from_millis(8_000);
/// A line has stalled if nothing arrives for this many usual gaps, and then several messages arrive at once. They must
/// be at least `LEAST_MESSAGES`, and at least the share `LEAST_SHARE` of the usual number. A device that was only
/// silent comes back with a single message.
const UNUSUAL: f64 = 3.0;
const LEAST_MESSAGES: f64 = 2.0;
const LEAST_SHARE: f64 = 0.1;
/// Share of the usual number of messages from which on a burst counts as complete. It is less than 1, because the usual
/// period is inexact.
const COMPLETE: f64 = 0.9;
/// Number of reads after which the usual gap is known, and number of reads over which it is averaged.
const KNOWN_AFTER: u32 = 8;
const AVERAGED: f64 = 16.0;
/// Longest time that a part of a byte stream spans. A frame gets the time of the part in which it begins.
const PART: DurNs = DurNs::from_millis(5);

/// Time that other lines need to read their late data, after one line has read its own.
const SETTLES: DurNs = DurNs::from_millis(20);

/// Time at which a line last read late data. The loop then waits until all lines have read their late data, because it
/// takes waiting packets in the order of their receive times.
#[derive(Debug, Clone, Default)]
pub struct LateData(Arc<AtomicU64>);

impl LateData {
    /// Records that late data were found at `now`.
    pub(crate) fn found(&self, now: MonoNs) {
        self.0.fetch_max(now.0, Ordering::Relaxed);
    }

    /// Whether other lines may still have late data to read.
    pub(crate) fn is_recent(&self, now: MonoNs) -> bool {
        let found = self.0.load(Ordering::Relaxed);
        found > 0 && now.since(MonoNs(found)) < SETTLES
    }
}

/// Usual gap and size of a line's reads, from which the times of a burst follow.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ReadTimes {
    last: Option<MonoNs>,
    reads: u32,
    gap_ns: f64,
    bytes: f64,
}

/// Times of the parts of a burst.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    after: MonoNs,
    now: MonoNs,
    /// Time between two messages, ns, and usual length of a message.
    step_ns: f64,
    bytes: f64,
}

impl ReadTimes {
    /// Whether a read at `received` may be the first of a burst. `is_late` tells whether the program itself read later
    /// than intended.
    pub(crate) fn may_be_burst(&self, received: MonoNs, is_late: bool) -> bool {
        let Some(last) = self.last.filter(|_| self.reads >= KNOWN_AFTER) else { return false };
        let gap = received.since(last);
        (SHORTEST..=LONGEST).contains(&gap) && (is_late || gap.0 as f64 >= UNUSUAL * self.gap_ns)
    }

    /// Takes an ordinary read of `bytes` bytes, and updates the usual gap and size.
    pub(crate) fn take(&mut self, received: MonoNs, bytes: usize) {
        if let Some(last) = self.last {
            self.reads = self.reads.saturating_add(1);
            let weight = 1.0 / f64::from(self.reads).min(AVERAGED);
            // One long gap or one long read says little about the device's usual messages.
            let is_known = self.reads > KNOWN_AFTER;
            let most = |usual: f64| if is_known { 2.0 * UNUSUAL * usual } else { f64::INFINITY };
            let gap_ns = received.since(last).0 as f64;
            let gap_ns = gap_ns.clamp(0.0, most(self.gap_ns).max(SHORTEST.0 as f64));
            self.gap_ns += weight * (gap_ns - self.gap_ns);
            self.bytes += weight * ((bytes as f64).min(most(self.bytes)) - self.bytes);
        }
        self.last = Some(received);
    }

    /// Takes all bytes that waited until `now`. Returns their times; `None` if they did not arrive late.
    ///
    /// If the program itself was late, the read says nothing about the device. If not, the device may have changed its
    /// period or its messages, so the read counts like any other read.
    pub(crate) fn take_waiting(&mut self, now: MonoNs, bytes: usize, is_late: bool) -> Option<Spread> {
        let spread = self.spread(now, bytes, is_late);
        if is_late {
            self.last = Some(now);
        } else {
            self.take(now, bytes);
        }
        spread
    }

    fn spread(&self, now: MonoNs, bytes: usize, is_late: bool) -> Option<Spread> {
        let after = self.last?;
        let gap_ns = now.since(after).0 as f64;
        let messages = bytes as f64 / self.bytes.max(1.0);
        if !is_late && messages < LEAST_MESSAGES.max(LEAST_SHARE * gap_ns / self.gap_ns.max(1.0)) {
            return None;
        }
        // If the program was late, the system may have dropped the newest data, or the device may have waited to be
        // asked. In both cases the data are from the beginning of the gap.
        let is_short = messages * self.gap_ns < COMPLETE * gap_ns;
        let step_ns = if is_late && is_short { self.gap_ns } else { gap_ns / messages.max(1.0) };
        Some(Spread { after, now, step_ns, bytes: self.bytes.max(1.0) })
    }
}

impl Spread {
    /// Receive time of a byte that follows `bytes_before` other bytes of the burst.
    pub(crate) fn at(&self, bytes_before: usize) -> MonoNs {
        let since_ns = self.step_ns * (1.0 + bytes_before as f64 / self.bytes);
        (self.after + DurNs::from_secs_f64(since_ns / 1e9)).min(self.now)
    }

    /// Length of the parts into which a byte stream is divided, so that each part spans a short time.
    pub(crate) fn part_bytes(&self) -> usize {
        let count = self.bytes * PART.0 as f64 / self.step_ns.max(1.0);
        #[expect(clippy::cast_possible_truncation, reason = "float to integer casts saturate, as intended")]
        let count = count as usize;
        count.max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: MonoNs = MonoNs(1_000_000_000);

    fn at_ms(ms: i64) -> MonoNs {
        START + DurNs::from_millis(ms)
    }

    /// A device that has sent a message of 10 bytes in each period of 50 ms; the last one came at 1000 ms.
    fn device() -> ReadTimes {
        let mut times = ReadTimes::default();
        (0..=20).for_each(|k| times.take(at_ms(50 * k), 10));
        times
    }

    fn times_ms(spread: &Spread, messages: usize) -> Vec<i64> {
        let ms = |at: MonoNs| (at.since(START).0 + 500_000) / 1_000_000;
        (0..messages).map(|number| ms(spread.at(10 * number))).collect()
    }

    #[test]
    fn messages_of_a_burst_have_the_times_of_the_devices_period() {
        let mut times = device();
        assert!(times.may_be_burst(at_ms(1220), true) && times.may_be_burst(at_ms(1220), false));
        let spread = times.take_waiting(at_ms(1204), 40, true).unwrap();
        assert_eq!(times_ms(&spread, 4), [1051, 1102, 1153, 1204]);
        // The system has dropped the newest two of the four messages.
        let spread = device().take_waiting(at_ms(1220), 20, true).unwrap();
        assert_eq!(times_ms(&spread, 2), [1050, 1100]);
        // The line has held back a device that sends at another rate.
        let spread = device().take_waiting(at_ms(1220), 20, false).unwrap();
        assert_eq!(times_ms(&spread, 2), [1110, 1220]);
    }

    #[test]
    fn times_of_a_burst_increase_and_lie_in_the_gap() {
        for (gap_ms, bytes) in [(100, 7), (100, 4000), (1300, 35), (5000, 1000), (7999, 1 << 20)] {
            for is_late in [false, true] {
                let now = at_ms(1000 + gap_ms);
                let Some(spread) = device().take_waiting(now, bytes, is_late) else { continue };
                let times: Vec<MonoNs> =
                    (0..bytes).step_by(spread.part_bytes()).map(|at| spread.at(at)).collect();
                assert!(
                    times.is_sorted() && times[0] > at_ms(1000) && times[times.len() - 1] <= now,
                    "{spread:?}"
                );
                let longest = times.windows(2).map(|two| two[1].since(two[0])).max();
                let of_a_byte = DurNs::from_secs_f64(spread.step_ns / spread.bytes / 1e9);
                assert!(
                    longest.is_none_or(|longest| longest.0 <= PART.0.max(of_a_byte.0) + 1_000),
                    "{longest:?}"
                );
            }
        }
    }

    #[test]
    fn device_that_changes_its_period_and_its_messages_soon_gets_the_times_of_arrival_again() {
        let mut times = ReadTimes::default();
        // Ten answers of 13 bytes in quick succession, then a profile of 236 bytes every 100 ms.
        (0..10).for_each(|k| times.take(at_ms(4 * k), 13));
        let is_spread = |k: i64| {
            let now = at_ms(100 * k);
            let is_burst = times.may_be_burst(now, false);
            if !is_burst {
                times.take(now, 236);
            }
            is_burst && times.take_waiting(now, 236, false).is_some()
        };
        let spread: Vec<bool> = (1..60).map(is_spread).collect();
        let last = spread.iter().rposition(|is_spread| *is_spread);
        assert!(last.is_some_and(|last| last < 16), "{last:?}: {spread:?}");
    }

    #[test]
    fn ordinary_jitter_silence_and_suspension_are_no_bursts() {
        let times = device();
        assert!(!times.may_be_burst(at_ms(1099), true), "short gap");
        assert!(!times.may_be_burst(at_ms(1140), false), "less than three periods");
        assert!(!times.may_be_burst(at_ms(9001), true), "the computer was suspended");
        assert!(!ReadTimes::default().may_be_burst(at_ms(500), true), "nothing is known about the device");
        // A device comes back with one message after a silence of one second, or with three messages after five
        // seconds.
        assert!(
            times.may_be_burst(at_ms(2000), false) && device().take_waiting(at_ms(2000), 10, false).is_none()
        );
        assert!(device().take_waiting(at_ms(6000), 30, false).is_none());
    }
}
