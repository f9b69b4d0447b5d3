//! Handles logs whose messages have timestamps from several clocks, e.g. time since boot and UNIX time.
//!
//! Such timestamps have no common order. Only messages of the clock with the most messages are played. All other
//! messages are dropped and reported.

use std::path::PathBuf;

use headrace_geometry::time::{DiveClock, MonoNs};
use headrace_monitor::console::CONSOLE_ID;
use headrace_monitor::ring::MAX_PACKET_BYTES;

use crate::log::{DiveLog, LogError, LogMessage, MessageKind};

/// Minimum offset between two clocks, far longer than any dive. Timestamps with smaller gaps come from one clock.
const YEAR_NS: u64 = 365 * 24 * 3600 * 1_000_000_000;
/// Maximum number of clocks that are distinguished. Messages of any further clock aren't counted.
const MAX_CLOCKS: usize = 100;

/// A clock, described by the range of its timestamps. The ranges of two clocks are more than a year apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Clock {
    from: MonoNs,
    to: MonoNs,
    messages: u64,
}

impl Clock {
    /// Whether a timestamp may come from this clock.
    pub(crate) fn is_of(&self, at: MonoNs) -> bool {
        (self.from.0.saturating_sub(YEAR_NS)..=self.to.0.saturating_add(YEAR_NS)).contains(&at.0)
    }

    /// Returns the offset of another clock's timestamp from this clock's range, as text.
    pub(crate) fn distance(&self, at: MonoNs) -> String {
        let (ns, side) = if at < self.from {
            (self.from.0.saturating_sub(at.0), "before")
        } else {
            (at.0.saturating_sub(self.to.0), "after")
        };
        format!("{:.1} years {side}", ns as f64 / YEAR_NS as f64)
    }
}

/// Returns the clock with the most raw messages; `None` if the log has only one clock.
///
/// Messages are read only if the times in the chunk headers span more than a year.
///
/// Errors: the log can't be read.
pub(crate) fn of(files: &[PathBuf], times: Option<(MonoNs, MonoNs)>) -> Result<Option<Clock>, LogError> {
    if times.is_none_or(|(from, to)| to.0.saturating_sub(from.0) <= YEAR_NS) {
        return Ok(None);
    }
    let mut log = DiveLog::open(files)?;
    let mut clocks: Vec<Clock> = Vec::new();
    let mut others = 0_u64;
    while let Some(message) = log.next()? {
        if matches!(message.kind, MessageKind::Raw { .. }) {
            others += u64::from(!count(&mut clocks, message.log_time));
        }
    }
    let several = clocks.len() > 1 || others > 0;
    // If two clocks have equally many messages, the clock with the earlier timestamps is chosen, because a monotonic
    // clock starts at zero.
    let most = clocks.into_iter().min_by_key(|clock| (core::cmp::Reverse(clock.messages), clock.from));
    Ok(most.filter(|_| several))
}

/// Returns the dive's clock of the log in these files, as in a replay.
///
/// The clock starts with the first packet of a sensor. Packets of a clock that isn't played don't count.
///
/// Errors: the log can't be read.
pub fn clock_of(files: &[PathBuf]) -> Result<DiveClock, LogError> {
    let mut log = DiveLog::open(files)?;
    let clock = of(files, log.times())?;
    let mut found = DiveClock::default();
    while found.zero().is_none() {
        let Some(LogMessage { kind, log_time, data, .. }) = log.next()? else { break };
        let MessageKind::Raw { source } = kind else { continue };
        let is_played = clock.is_none_or(|clock| clock.is_of(log_time)) && data.len() <= MAX_PACKET_BYTES;
        if is_played && log.source_id(source) != Some(CONSOLE_ID) {
            found.start(log_time);
        }
    }
    Ok(found)
}

/// Counts a message for its clock. Returns `false` if there are too many clocks.
fn count(clocks: &mut Vec<Clock>, at: MonoNs) -> bool {
    if let Some(clock) = clocks.iter_mut().find(|clock| clock.is_of(at)) {
        (clock.from, clock.to) = (clock.from.min(at), clock.to.max(at));
        clock.messages += 1;
        return true;
    }
    let fits = clocks.len() < MAX_CLOCKS;
    if fits {
        clocks.push(Clock { from: at, to: at, messages: 1 });
    }
    fits
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timestamps_years_apart_belong_to_different_clocks() {
        let mut clocks = Vec::new();
        for at in [5, YEAR_NS * 50, 7, YEAR_NS * 50 + 9, YEAR_NS / 2, YEAR_NS * 4] {
            count(&mut clocks, MonoNs(at));
        }
        let seen: Vec<_> = clocks.iter().map(|clock| (clock.from.0, clock.messages)).collect();
        assert_eq!(seen, [(5, 3), (YEAR_NS * 50, 2), (YEAR_NS * 4, 1)]);
        let [first, ..] = clocks[..] else { panic!() };
        assert!(first.is_of(MonoNs(YEAR_NS)) && !first.is_of(MonoNs(YEAR_NS * 2)));
        assert_eq!(first.distance(MonoNs(YEAR_NS * 11 / 2)), "5.0 years after");
        for at in 0..190 {
            count(&mut clocks, MonoNs(at * 3 * YEAR_NS));
        }
        assert_eq!(clocks.len(), MAX_CLOCKS);
        // If there are too many clocks, a timestamp of another clock doesn't extend the range of a known clock.
        assert!(!count(&mut clocks, MonoNs(YEAR_NS * 580)) && count(&mut clocks, MonoNs(8)));
        assert!(clocks.iter().all(|clock| clock.to.0 - clock.from.0 <= YEAR_NS));
    }
}
