//! Logs whose messages are stamped by several clocks: one counts from when its machine was started, another from 1970.
//!
//! Such a log has no order. Messages of the clock that stamped most are played, and the others are left out and said to be.

use std::path::PathBuf;

use headrace_geometry::time::MonoNs;

use crate::log::{DiveLog, LogError, MessageKind};

/// No dive and no stay in the store between two of them lasts so long.
const YEAR_NS: u64 = 365 * 24 * 3600 * 1_000_000_000;
/// More clocks than that aren't told from one another.
const MAX_CLOCKS: usize = 100;

/// A clock by the times that it has stamped: none of them is a year from the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Clock {
    from: MonoNs,
    to: MonoNs,
    messages: u64,
}

impl Clock {
    /// Whether a time may be of this clock.
    pub(crate) fn is_of(&self, at: MonoNs) -> bool {
        (self.from.0.saturating_sub(YEAR_NS)..=self.to.0.saturating_add(YEAR_NS)).contains(&at.0)
    }

    /// How far another clock's time is from this one's, in words.
    pub(crate) fn distance(&self, at: MonoNs) -> String {
        let (ns, side) = if at < self.from {
            (self.from.0.saturating_sub(at.0), "before")
        } else {
            (at.0.saturating_sub(self.to.0), "after")
        };
        format!("{:.1} years {side}", ns as f64 / YEAR_NS as f64)
    }
}

/// The clock of most messages of sources; `None` where there is but one. The log is only read for it when the heads of its
/// chunks tell of years.
///
/// Errors: the log can't be read.
pub(crate) fn of(files: &[PathBuf], times: Option<(MonoNs, MonoNs)>) -> Result<Option<Clock>, LogError> {
    if times.is_none_or(|(from, to)| to.0.saturating_sub(from.0) <= YEAR_NS) {
        return Ok(None);
    }
    let mut log = DiveLog::open(files)?;
    let mut clocks: Vec<Clock> = Vec::new();
    while let Some(message) = log.next()? {
        if matches!(message.kind, MessageKind::Raw { .. }) {
            count(&mut clocks, message.log_time);
        }
    }
    let several = clocks.len() > 1;
    // Of two with as many messages the earlier one: a monotonic clock starts at zero.
    let most = clocks.into_iter().min_by_key(|clock| (core::cmp::Reverse(clock.messages), clock.from));
    Ok(most.filter(|_| several))
}

fn count(clocks: &mut Vec<Clock>, at: MonoNs) {
    let full = clocks.len() >= MAX_CLOCKS;
    if let Some(clock) = clocks.iter_mut().find(|clock| full || clock.is_of(at)) {
        (clock.from, clock.to) = (clock.from.min(at), clock.to.max(at));
        clock.messages += 1;
    } else {
        clocks.push(Clock { from: at, to: at, messages: 1 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_years_apart_are_of_different_clocks() {
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
    }
}
