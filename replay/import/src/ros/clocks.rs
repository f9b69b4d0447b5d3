//! Compares the timestamps in message headers with the times at which the messages were recorded.

/// If a header's timestamp is later than the record time by more than this, it must come from another clock, ns.
const AHEAD_NS: i64 = 5_000_000;
/// Maximum recording delay of messages from a computer with a synchronised clock, ns.
const LATE_NS: i64 = 1_000_000_000;
/// Maximum variation of the recording delay, ns. A larger variation means late messages or another clock.
const VARIES_NS: i64 = 500_000_000;
/// If two clocks differ by more than this, they have different epochs, ns. Smaller offsets are clock errors.
const OTHER_BASE_NS: i64 = 3_600_000_000_000;
/// If a header's timestamp deviates from the present clock offset by more than this, a new offset begins, ns.
const ASTRAY_NS: i64 = 10_000_000_000;

/// Choice of the time that applies to a message's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Base {
    /// The time at which the message was recorded applies.
    #[default]
    Record,
    /// The timestamp in the message's header applies.
    Header,
}

/// Statistics of the header timestamps of one topic.
#[derive(Debug, Clone, Default)]
pub(super) struct Clocks {
    base: Base,
    messages: u64,
    /// Number of messages whose header has a zero timestamp.
    unstamped: u64,
    /// Least and greatest value of the record time minus the header's timestamp, ns.
    lag_ns: Option<(i64, i64)>,
    before_ns: u64,
    backwards: u64,
    /// Offset that is added to header timestamps, ns. It is 0 if the clocks agree within 1 s, and `None` before the
    /// first header timestamp is used.
    moved_ns: Option<i64>,
    anew: u64,
}

impl Clocks {
    pub(super) fn new(base: Base) -> Self {
        Self { base, ..Self::default() }
    }

    /// Returns the time of a message's values, and whether this time comes from the header's timestamp.
    pub(super) fn time(&mut self, record_ns: u64, stamp_ns: Option<u64>) -> (u64, bool) {
        self.messages += 1;
        let Some(stamp_ns) = stamp_ns.filter(|stamp_ns| *stamp_ns > 0) else {
            self.unstamped += 1;
            return (record_ns, false);
        };
        let lag_ns = difference(record_ns, stamp_ns);
        let (least, most) = self.lag_ns.unwrap_or((lag_ns, lag_ns));
        self.lag_ns = Some((least.min(lag_ns), most.max(lag_ns)));
        self.backwards += u64::from(stamp_ns < self.before_ns);
        self.before_ns = stamp_ns;
        if self.base == Base::Record {
            return (record_ns, false);
        }
        let near = if lag_ns.abs() > LATE_NS { lag_ns } else { 0 };
        let moved_ns = *self.moved_ns.get_or_insert(near);
        if lag_ns.abs_diff(moved_ns) <= ASTRAY_NS.unsigned_abs() {
            return (stamp_ns.saturating_add_signed(moved_ns), true);
        }
        self.anew += 1;
        self.moved_ns = Some(near);
        (stamp_ns.saturating_add_signed(near), true)
    }

    /// Returns the findings about the topic's timestamps for the user, as text.
    pub(super) fn words(&self) -> Vec<String> {
        let mut all = Vec::new();
        if self.messages == 0 {
            return all;
        }
        let followed = self.base == Base::Header;
        if self.unstamped > 0 && (followed || self.unstamped < self.messages) {
            let (unstamped, messages) = (self.unstamped, self.messages);
            all.push(format!(
                "{unstamped} of {messages} messages have no header stamp; they get their time of recording"
            ));
        }
        let Some((least, most)) = self.lag_ns else { return all };
        let done = match self.moved_ns {
            Some(0) => "they are used unchanged".to_owned(),
            Some(moved) => format!("they are used, shifted by {} s", seconds(moved)),
            None => "the times of recording are used".to_owned(),
        };
        let problem = if least.abs() > OTHER_BASE_NS || most.abs() > OTHER_BASE_NS {
            Some(format!("header stamps are on another time base, {} s before recording", range(least, most)))
        } else if least < -AHEAD_NS {
            Some(format!(
                "header stamps are up to {} s later than recording: they come from another clock",
                seconds(-least)
            ))
        } else if most - least > VARIES_NS {
            Some(format!(
                "header stamps are {} s before recording: messages arrived late, or come from another clock",
                range(least, most)
            ))
        } else if most > LATE_NS {
            Some(format!(
                "header stamps are {} s before recording: they come from another clock",
                range(least, most)
            ))
        } else {
            None
        };
        all.extend(problem.map(|problem| format!("{problem}; {done}")));
        if self.backwards > 0 {
            all.push(format!("header stamps go back {} times", self.backwards));
        }
        if self.anew > 0 {
            all.push(format!(
                "header stamps jump by over 10 s against recording {} times, and get a new shift each time",
                self.anew
            ));
        }
        all
    }
}

fn difference(one_ns: u64, other_ns: u64) -> i64 {
    let difference = i128::from(one_ns) - i128::from(other_ns);
    // The limit is half the range of i64, so that the difference of two clock offsets fits into an i64.
    let most = i128::from(i64::MAX / 2);
    i64::try_from(difference.clamp(-most, most)).unwrap_or_default()
}

fn seconds(ns: i64) -> String {
    format!("{:.3}", ns as f64 / 1e9)
}

fn range(least: i64, most: i64) -> String {
    let (least, most) = (seconds(least), seconds(most));
    if least == most { least } else { format!("{least} to {most}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn words(base: Base, pairs: &[(u64, u64)]) -> (Vec<u64>, String) {
        let mut clocks = Clocks::new(base);
        let times = pairs.iter().map(|(record, stamp)| clocks.time(*record, Some(*stamp)).0).collect();
        (times, clocks.words().join("; "))
    }

    #[test]
    fn header_times_that_agree_with_record_times_give_no_findings() {
        let (times, said) = words(Base::Record, &[(1000 * S, 1000 * S - 3), (1001 * S, 1001 * S - 900)]);
        assert_eq!((times, said.as_str()), (vec![1000 * S, 1001 * S], ""));
        assert_eq!(words(Base::Header, &[(1000 * S, 1000 * S - 3)]).0, [1000 * S - 3]);
    }

    #[test]
    fn timestamps_of_another_epoch_are_reported_and_shifted() {
        let pairs = [(50_000 * S, 10 * S), (50_001 * S, 10 * S + 900_000_000)];
        let (times, said) = words(Base::Record, &pairs);
        assert_eq!(times, [50_000 * S, 50_001 * S]);
        assert!(said.contains("another time base, 49990.000 to 49990.100 s before"), "{said}");
        assert!(said.contains("the times of recording are used"), "{said}");
        let (times, said) = words(Base::Header, &pairs);
        assert_eq!(times, [50_000 * S, 50_000 * S + 900_000_000]);
        assert!(said.contains("shifted by 49990.000 s"), "{said}");
    }

    #[test]
    fn clock_offsets_of_message_headers_are_reported() {
        assert!(words(Base::Record, &[(10 * S, 11 * S)]).1.contains("up to 1.000 s later"));
        assert!(
            words(Base::Record, &[(10 * S, 8 * S)])
                .1
                .contains("2.000 s before recording: they come from another clock")
        );
        assert!(
            words(Base::Record, &[(10 * S, 10 * S), (20 * S, 19 * S)]).1.contains("messages arrived late")
        );
        assert!(words(Base::Record, &[(10 * S, 9 * S), (11 * S, 8 * S)]).1.contains("go back 1 times"));
        let (times, said) =
            words(Base::Header, &[(100 * S, 100 * S), (101 * S, 501 * S), (102 * S, 502 * S)]);
        assert_eq!(times, [100 * S, 101 * S, 102 * S]);
        assert!(said.contains("jump by over 10 s against recording 1 times"), "{said}");
        let mut clocks = Clocks::new(Base::Header);
        assert_eq!(clocks.time(5, Some(0)), (5, false));
        assert!(clocks.words()[0].contains("no header stamp"));
        assert_eq!(difference(0, u64::MAX), -(i64::MAX / 2));
    }
}
