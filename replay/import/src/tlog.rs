//! Telemetry logs of the MAVLink protocol.

use crate::entry::{Clock, Entry, Step};
use crate::format::Format;
use headrace_mavlink::frame::Frames;
use headrace_mavlink::tlog::{Tlog, TlogError};
use headrace_sensor::codec::{Framing as _, Verdict};

/// The telemetry format. Its only stream is [`STREAM`].
#[derive(Debug, Default)]
pub struct TlogFormat {
    /// Whether the reader has lost the position of the next entry.
    astray: bool,
    last_us: u64,
}

/// Name of the only stream in a telemetry log: all frames belong to it.
pub const STREAM: &str = "mavlink";

/// Maximum difference between the times of two entries, µs. After damage, an entry with a larger difference is a false
/// match.
const DAY_US: u64 = 86_400_000_000;
/// Latest valid time of an entry, in 2106, µs.
const LATEST_US: u64 = 4_294_967_296_000_000;

impl Format for TlogFormat {
    fn clock(&self) -> Clock {
        Clock::Utc
    }

    fn step(&mut self, front: &[u8], _: bool, out: &mut Vec<Entry>) -> Step {
        let logged = match Tlog::new(front).next() {
            // After damage, an entry that seems truncated is probably no entry at all. This is certain only at the end
            // of the file.
            None | Some(Err(TlogError::Short { .. })) => return Step::More,
            Some(Err(_)) => return self.lost(),
            Some(Ok(logged)) => logged,
        };
        let used = front.len().min(8 + logged.frame.len());
        let good = matches!(Frames.judge(logged.frame), Verdict::Frame(_));
        let near = logged.utc_us <= LATEST_US
            && (self.last_us == 0 || logged.utc_us.abs_diff(self.last_us) < DAY_US);
        if self.astray && !(good && near) || logged.utc_us > LATEST_US {
            return self.lost();
        }
        self.astray = false;
        if !good {
            return Step::Lost(used, "frames that fit no known message and its checksum");
        }
        self.last_us = logged.utc_us;
        let (stamp_ns, stream) = (logged.utc_us.saturating_mul(1000), STREAM.to_owned());
        out.push(Entry { stamp_ns, stream, bytes: logged.frame.to_vec() });
        Step::Took(used)
    }
}

impl TlogFormat {
    fn lost(&mut self) -> Step {
        self.astray = true;
        Step::Lost(1, "no time and frame where they are expected")
    }
}
