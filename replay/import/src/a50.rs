//! Files with the lines of JSON that a velocity log A50 or A125 sends.
//!
//! The time of a report is the device's time of transmission. It is UTC if the device's clock is set.

use headrace_a50::report::{Lines, MAX_LINE_BYTES};
use headrace_sensor::codec::Framing as _;
use headrace_sensor::codec::Verdict;

use crate::entry::{Clock, Entry, Step};
use crate::format::Format;

/// The format of an A50's lines. Its only stream is [`STREAM`].
#[derive(Debug, Clone, Copy, Default)]
pub struct A50Format {
    /// Time of the first velocity report; `None` before it.
    first_ns: Option<u64>,
    /// Time of the latest velocity report; `None` before the first.
    last_ns: Option<u64>,
}

/// Name of the only stream in a file with an A50's lines: all reports belong to it.
pub const STREAM: &str = "a50";

const NO_REPORT: &str = "lines that aren't reports of an A50: damaged, or without a required field";

impl Format for A50Format {
    fn clock(&self) -> Clock {
        Clock::of_first(self.first_ns)
    }

    fn step(&mut self, front: &[u8], end: bool, out: &mut Vec<Entry>) -> Step {
        if let Some(newline) = front.iter().take(MAX_LINE_BYTES).position(|byte| *byte == b'\n') {
            let used = newline + 1;
            return self.line(front.get(..used).unwrap_or_default().trim_ascii_start(), used, out);
        }
        if front.len() >= MAX_LINE_BYTES {
            return Step::Lost(MAX_LINE_BYTES, NO_REPORT);
        }
        // A last line that ends with its closing brace is complete, even without a newline.
        let line = [front.trim_ascii(), b"\n"].concat();
        if end && line.ends_with(b"}\n") && matches!(Lines.judge(&line), Verdict::Frame(_)) {
            return self.line(&line, front.len(), out);
        }
        Step::More
    }
}

impl A50Format {
    /// Reads a line that is `used` bytes long in the file.
    fn line(&mut self, line: &[u8], used: usize, out: &mut Vec<Entry>) -> Step {
        if line.is_empty() {
            return Step::Took(used);
        }
        if !matches!(Lines.judge(line), Verdict::Frame(_)) {
            return Step::Lost(used, NO_REPORT);
        }
        let Some(report) = Lines.read(line) else {
            // A report without a velocity belongs to no sensor. An empty entry counts it.
            let empty = |stamp_ns| Entry { stamp_ns, stream: String::new(), bytes: Vec::new() };
            out.extend(self.last_ns.map(empty));
            return Step::Took(used);
        };
        let Some([_, transmission_us]) = report.times_us else {
            return Step::Lost(
                used,
                "velocity reports without timestamps, as in json_v1: their times are unknown",
            );
        };
        let stamp_ns = u64::try_from(transmission_us).ok().and_then(|us| us.checked_mul(1000));
        let Some(stamp_ns) = stamp_ns.filter(|ns| *ns < 1 << 62) else {
            return Step::Lost(used, "velocity reports whose time is before 1970 or after 2116");
        };
        self.first_ns = self.first_ns.or(Some(stamp_ns));
        self.last_ns = Some(stamp_ns);
        out.push(Entry { stamp_ns, stream: STREAM.to_owned(), bytes: line.to_vec() });
        Step::Took(used)
    }
}

#[cfg(test)]
mod tests {
    use headrace_a50::report::{Against, Velocity};

    use super::*;
    use crate::tests::formats::cut;

    fn report(times_us: Option<[i64; 2]>) -> Vec<u8> {
        let (velocity_mps, fom_mps, altitude_m) = ([0.1, 0.2, 0.3], 0.002, 1.5);
        let (against, valid_beams, is_valid, status) = (Against::Bottom, 3, false, 1);
        Velocity { against, velocity_mps, fom_mps, altitude_m, valid_beams, is_valid, status, times_us }
            .encode()
    }

    #[test]
    fn lines_of_an_a50_keep_their_bytes_and_times() {
        let one = report(Some([1_700_000_000_000_000, 1_700_000_000_100_000]));
        let other = b"{\"ts\":1.5,\"x\":0.0,\"type\":\"position_local\"}\n";
        let (entries, lost, left) =
            cut(&mut A50Format::default(), &[&one[..], b"\r\n", other, &one[..20]].concat());
        assert_eq!((entries.len(), lost.len(), left), (2, 0, 20));
        assert_eq!((entries[0].stamp_ns, &entries[0].bytes), (1_700_000_000_100_000_000, &one));
        assert!(entries[1].stream.is_empty());
    }

    #[test]
    fn complete_last_line_needs_no_newline() {
        let one = report(Some([1_700_000_000_000_000, 1_700_000_000_100_000]));
        let without = one.trim_ascii_end();
        for further in [&b""[..], b"\r"] {
            let (entries, lost, left) =
                cut(&mut A50Format::default(), &[&one[..], without, further].concat());
            assert_eq!((entries.len(), lost.len(), left), (2, 0, 0));
            assert_eq!(entries[1].bytes, [without, b"\n"].concat());
        }
        let cut_short = &without[..without.len() - 1];
        let (entries, lost, left) = cut(&mut A50Format::default(), &[&one[..], cut_short].concat());
        assert_eq!((entries.len(), lost.len(), left), (1, 0, cut_short.len()));
    }

    #[test]
    fn unset_device_clock_is_not_utc() {
        for (transmission_us, expected) in [(5_000_000, Clock::Own), (1_700_000_000_100_000, Clock::Utc)] {
            let mut format = A50Format::default();
            let line = report(Some([transmission_us - 100_000, transmission_us]));
            assert_eq!(cut(&mut format, &line).0.len(), 1);
            assert_eq!(format.clock(), expected);
        }
    }

    #[test]
    fn lines_without_a_report_or_its_time_are_lost() {
        let (before, untimed) = (report(Some([0, -1])), report(None));
        let file =
            [b"{\"type\":\"velocity\",\"vx\":1}\n", &untimed[..], b"12:00 connected\n", &before].concat();
        let (entries, lost, left) = cut(&mut A50Format::default(), &file);
        let reasons: Vec<&str> = lost.iter().map(|(_, why)| *why).collect();
        assert_eq!((entries.len(), reasons.len(), left), (0, 4, 0), "{reasons:?}");
        assert_eq!((reasons[0], reasons[2]), (NO_REPORT, NO_REPORT));
        assert!(reasons[1].contains("json_v1") && reasons[3].contains("before 1970"), "{reasons:?}");
    }
}
