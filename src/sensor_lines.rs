//! Lines about the sensors' ports: until a device runs again, each of its states is shown at most once.

use std::collections::{BTreeMap, BTreeSet};

use headrace_ports::{Phase, Status};

/// Statuses that have been shown, by sensor.
#[derive(Default)]
pub(crate) struct SensorLines(BTreeMap<usize, BTreeSet<String>>);

impl SensorLines {
    /// Records a status. Returns whether the status is new, which means not shown since the device last ran.
    ///
    /// A silent device has one status, whatever the text. Other statuses that differ only in numbers, such as a count
    /// of messages, are the same.
    pub(crate) fn is_new(&mut self, status: &Status) -> bool {
        let shown = self.0.entry(status.source).or_default();
        if status.phase == Phase::Running {
            shown.clear();
        }
        shown.insert(status.to_string().replace(|c: char| c.is_ascii_digit(), ""))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use headrace_geometry::time::MonoNs;

    #[test]
    fn alternating_states_of_a_port_give_one_line_each_until_the_device_runs() {
        let mut lines = SensorLines::default();
        let mut is_new = |source: usize, phase: Phase, words: &str| {
            lines.is_new(&Status { source, since: MonoNs(0), phase, words: words.to_owned() })
        };
        let mut shown = 0;
        for _ in 0..10 {
            shown += u32::from(is_new(0, Phase::Closed, "opening tcp:1.2.3.4:9: refused"));
            shown += u32::from(is_new(0, Phase::Silent, "the line is open, but no frame has arrived yet"));
            shown += u32::from(is_new(0, Phase::Silent, "no data for 5 s; is it switched on?"));
        }
        assert_eq!(shown, 3);
        assert!(!is_new(0, Phase::Silent, "no data for 10 s; is it switched on?"), "only the number differs");
        assert!(is_new(1, Phase::Silent, "no data for 5 s; is it switched on?"), "another device");
        assert!(is_new(0, Phase::Running, "A50"));
        assert!(is_new(0, Phase::Silent, "no data for 5 s; is it switched on?"), "it ran since");
    }
}
