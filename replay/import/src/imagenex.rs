//! Files written by Imagenex's own software.

use crate::calendar::{DAY_NS, days_since_1970};
use crate::entry::{Clock, Entry, Step};
use crate::format::Format;
use headrace_geometry::time::DurNs;
use headrace_imagenex881::logfile::{LogFile, LogFileError};

/// The Imagenex format. Its only stream is [`STREAM`].
#[derive(Debug, Clone, Copy, Default)]
pub struct ImagenexFormat;

/// Name of the only stream in an Imagenex file: all returns belong to it.
pub const STREAM: &str = "imagenex";

const HEADER_BYTES: usize = 100;

impl Format for ImagenexFormat {
    fn clock(&self) -> Clock {
        Clock::Local
    }

    fn step(&mut self, front: &[u8], _: bool, out: &mut Vec<Entry>) -> Step {
        let mut shots = LogFile::new(front);
        let shot = match shots.next() {
            None | Some(Err(LogFileError::Short { .. })) => return Step::More,
            Some(Err(_)) => return Step::Lost(1, "no shot where one is expected"),
            Some(Ok(shot)) => shot,
        };
        let total =
            front.get(4..6).and_then(<[u8]>::first_chunk).map_or(0, |bytes| u16::from_be_bytes(*bytes));
        let used = usize::from(total).max(HEADER_BYTES);
        let stamp = shot.date.zip(shot.time_of_day).and_then(|(date, time)| stamp_ns(date, time));
        let Some(stamp_ns) = stamp else {
            return Step::Lost(used, "shots whose header has no date and time");
        };
        out.push(Entry { stamp_ns, stream: STREAM.to_owned(), bytes: shot.raw.to_vec() });
        Step::Took(used)
    }
}

/// Converts a date (day, month, year) and a time of that day to nanoseconds since 1970.
fn stamp_ns((day, month, year): (u8, u8, u16), time: DurNs) -> Option<u64> {
    let days = days_since_1970(year.into(), month.into(), day.into())?;
    Some(days * DAY_NS + time.0.unsigned_abs())
}
