//! Files written by Imagenex's own software.

use crate::entry::{Clock, Entry, Step};
use crate::format::Format;
use headrace_geometry::time::DurNs;
use headrace_imagenex881::logfile::{LogFile, LogFileError};

/// The Imagenex format. Its only stream is [`STREAM`].
#[derive(Debug, Clone, Copy, Default)]
pub struct ImagenexFormat;

/// Name of the only stream in an Imagenex file: all returns belong to it.
pub const STREAM: &str = "imagenex";

const DAY_NS: u64 = 86_400_000_000_000;
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
    const LENGTHS: [u64; 12] = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];
    let leap = |year: u16| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    if !(1970..2200).contains(&year) || !(1..=31).contains(&day) || !(1..=12).contains(&month) {
        return None;
    }
    let years: u64 = (1970..year).map(|year| if leap(year) { 366 } else { 365 }).sum();
    let months: u64 = LENGTHS.iter().take(usize::from(month) - 1).sum();
    let leap_day = u64::from(leap(year) && month > 2);
    let days = years + months + leap_day + u64::from(day) - 1;
    Some(days * DAY_NS + time.0.unsigned_abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_converted_to_time_since_1970() {
        let days = |date| stamp_ns(date, DurNs(0)).map(|ns| ns / DAY_NS);
        assert_eq!(days((1, 1, 1970)), Some(0));
        assert_eq!(days((1, 3, 2000)), Some(11_017));
        assert_eq!(days((18, 11, 2016)), Some(17_123));
        assert_eq!(days((31, 12, 2100)), Some(47_846));
        assert_eq!([days((0, 1, 2000)), days((1, 13, 2000)), days((1, 1, 1969))], [None; 3]);
    }
}
